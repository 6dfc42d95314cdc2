"""Flights of known truth: a point mass flown in time by the full equation of motion, and what a radar reports.

Reading order: :mod:`~descentflow.simulation.world`, :mod:`~descentflow.simulation.parameters`,
:mod:`~descentflow.simulation.motion`, :mod:`~descentflow.simulation.autopilot`, :mod:`~descentflow.simulation.observe`.
"""
