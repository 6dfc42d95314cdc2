"""Flights of known truth: a point mass flown in time by the full equation of motion, and what a radar reports of it.

Reading order: :mod:`~descentflow.simulation.world` (the front function), :mod:`~descentflow.simulation.scenarios` and
:mod:`~descentflow.simulation.world_config` (its settings), :mod:`~descentflow.simulation.parameters` (what is drawn for
each flight, with :mod:`~descentflow.simulation.planned_changes` and :mod:`~descentflow.simulation.weather`),
:mod:`~descentflow.simulation.flight`, :mod:`~descentflow.simulation.motion` and
:mod:`~descentflow.simulation.autopilot` (how it is flown), :mod:`~descentflow.simulation.truth` and
:mod:`~descentflow.simulation.observe` (the tables that result). Effects that a diagnosis is to find are injected by
:mod:`~descentflow.simulation.causes` through :mod:`~descentflow.simulation.injected`. Nothing of this shares an
equation with the decoder that it tests.

Descents alone are flown. To fly climbs, begin with the list in :mod:`descentflow.physics`; here an autopilot that
climbs goes next to the one that descends.
"""
