"""Open aircraft: coefficients in BADA 3 form from open sources, one TOML file per type in ``coefficients/``.

Read :mod:`~descentflow.aircraft_types.open_types.open_aircraft`. To add a type, copy a file of ``coefficients/``; its
name is the type designator, and ``sources.toml`` holds the sources that the numbers name.
"""
