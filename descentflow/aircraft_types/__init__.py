"""Performance models of aircraft types and where their coefficients come from.

Reading order: :mod:`~descentflow.aircraft_types.registry` (type designator to model),
:mod:`~descentflow.aircraft_types.standard_descent` (speeds and configurations of BADA 3 and 4),
:mod:`~descentflow.aircraft_types.bada3` and :mod:`~descentflow.aircraft_types.bada4` (their equations and files),
:mod:`~descentflow.aircraft_types.open_types` (embedded open coefficients in BADA 3 form).

To add an open type: copy a file of ``open_types/coefficients/``, one TOML file per type; every number names its source.

To add a performance model: a folder next to :mod:`~descentflow.aircraft_types.bada4` with a class that has all of
:class:`~descentflow.physics.performance_model.PerformanceModel` and a reader of its files, and a line in each function
of :mod:`~descentflow.aircraft_types.registry`. Nothing else reads coefficients. To be repaired it needs two methods of
``Repairable``, and its files in :mod:`~descentflow.repairs.repaired_files`.

Example:
    >>> from descentflow.aircraft_types.registry import aircraft
    >>> aircraft("B738").n_engines
    2
"""
