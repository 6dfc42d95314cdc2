"""Causes that a world can inject in its flights, each flown in time: those of the catalogue, and some outside it.

Their values stand in :mod:`~descentflow.simulation.plantable`. Read
:mod:`~descentflow.simulation.causes.cause` (what a cause is) and
:mod:`~descentflow.simulation.causes.injection` (how several act together), then any of the files of causes;
:mod:`~descentflow.simulation.causes.injection` has all of them.
"""

from descentflow.simulation.causes.injection import CAUSES, Injection

__all__ = ["CAUSES", "Injection"]
