"""Performance models of aircraft types and where their coefficients come from.

Reading order: :mod:`~descentflow.aircraft_types.registry` (type designator to model),
:mod:`~descentflow.aircraft_types.bada3` (BADA 3's coefficients, equations and files),
:mod:`~descentflow.aircraft_types.open_types` (embedded open coefficients in BADA 3 form).

To add an open type: copy a file of ``open_types/coefficients/``, one TOML file per type; every number names its source.

To add a performance model, BADA 4 for instance: a folder beside :mod:`~descentflow.aircraft_types.bada3` with a class
that has all of :class:`~descentflow.physics.performance_model.PerformanceModel` and a reader of its files, and a line
for each in both functions of :mod:`~descentflow.aircraft_types.registry`. Nothing else reads coefficients.

Example:
    >>> from descentflow.aircraft_types.registry import aircraft
    >>> aircraft("B738").n_engines
    2
"""
