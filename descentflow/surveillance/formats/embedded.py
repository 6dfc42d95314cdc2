"""The real surveillance data that comes with the package (public domain, see data/README.md)."""

from pathlib import Path

import polars as pl

DATA = Path(__file__).parent / "data"


def embedded_rows() -> Path:
    """Snapshots of a receiver near Bengaluru, 2023: 336 aircraft in 13 sessions, mostly arrivals and departures.

    Example:
        >>> embedded_rows().name
        'dump1090fa_bengaluru_2023.jsonl.gz'
    """
    return DATA / "dump1090fa_bengaluru_2023.jsonl.gz"


def embedded_types() -> pl.DataFrame:
    """Types of those aircraft that could be looked up: columns `icao24 typecode`.

    Example:
        >>> embedded_types().columns
        ['icao24', 'typecode']
    """
    return pl.read_csv(DATA / "bengaluru_typecodes.csv")
