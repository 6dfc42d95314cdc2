"""Causes that a world can inject in its flights, each flown in time: those of the catalogue, and some outside it.

Reading order: :mod:`~descentflow.simulation.causes.cause` (what a cause is), any file of causes, then ``_injection``
(all of them, and how several act together). Their values stand in :mod:`~descentflow.simulation.plantable`.
"""

from descentflow.simulation.causes._injection import CAUSES, Injection

__all__ = ["CAUSES", "Injection"]
