"""The coefficients of each aircraft type and where they come from.

Read :mod:`~descentflow.aircraft_types.aircraft` (the coefficients), then :mod:`~descentflow.aircraft_types.registry`
(type designator to coefficients), then the two sources: :mod:`~descentflow.aircraft_types.open_types` (embedded,
open) and :mod:`~descentflow.aircraft_types.bada3` (EUROCONTROL's files).
"""
