"""The coefficients of each aircraft type and where they come from.

Reading order: :mod:`~descentflow.aircraft_types.aircraft` (the coefficients),
:mod:`~descentflow.aircraft_types.registry` (type designator to coefficients), then the two sources:
:mod:`~descentflow.aircraft_types.open_types` (embedded, open) and :mod:`~descentflow.aircraft_types.bada3`
(EUROCONTROL's files).

To add an open type: copy a file of ``open_types/coefficients/``, one TOML file per type; every number names its source.

To read another source, BADA 4 for instance: add a folder beside :mod:`~descentflow.aircraft_types.bada3` whose reader
returns an :class:`~descentflow.aircraft_types.aircraft.Aircraft`, and choose it in
:func:`~descentflow.aircraft_types.registry.aircraft`. BADA 4 has other equations for drag and thrust, and so
other coefficients: its equations belong in :mod:`descentflow.physics.forces`, its coefficients in a class beside
``Aircraft``.

Example:
    >>> from descentflow.aircraft_types.registry import aircraft
    >>> aircraft("B738").n_engines
    2
"""
