"""Rows of made-up flights, consistent in IAS, Mach and altitude, for the tests of cleaning."""

from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import polars as pl

from descentflow.core.isa import pressure_ratio
from descentflow.core.units import FT_M

START = datetime(2024, 3, 1, 10, tzinfo=UTC)
SPEED_OF_SOUND_KT = np.sqrt(1.4 * 101_325.0 / 1.225) / 0.514444


def mach_of_cas(cas_kt: np.ndarray, altitude_ft: np.ndarray) -> np.ndarray:
    impact = ((1 + 0.2 * (cas_kt / SPEED_OF_SOUND_KT) ** 2) ** 3.5 - 1) / pressure_ratio(altitude_ft * FT_M)
    return np.sqrt(5 * ((impact + 1) ** (1 / 3.5) - 1))


def flight(
    icao24: str = "4ca001",
    *,
    top_ft: float = 35_000.0,
    every_s: float = 5.0,
    start_s: float = 0.0,
    typecode: str = "A320",
) -> pl.DataFrame:
    """Two minutes level, an idle-like descent (its rate wanders) to 5,000 ft, two minutes level."""
    step_s = 0.5
    time, height, rate = [0.0], [top_ft], [0.0]
    end = None
    while end is None or time[-1] < end:
        now = time[-1] + step_s
        down = now > 120 and end is None
        slope = -(1000 + 4 * height[-1] / 100) + 150 * np.sin(2 * np.pi * now / 60) if down else 0.0
        height.append(height[-1] + slope * step_s / 60)
        time.append(now)
        rate.append(slope)
        if end is None and height[-1] <= 5000:
            end = now + 120
    keep = slice(None, None, int(every_s / step_s))
    altitude = np.array(height)[keep]
    ias = np.full(len(altitude), 270.0)
    stamps = [int((START.timestamp() + start_s + t) * 1e6) for t in time[keep]]
    return pl.DataFrame(
        {
            "timestamp": pl.from_epoch(pl.Series(stamps), time_unit="us").dt.replace_time_zone("UTC"),
            "icao24": [icao24] * len(altitude),
            "callsign": ["TST1"] * len(altitude),
            "typecode": [typecode] * len(altitude),
            "altitude": altitude,
            "vertical_rate": np.array(rate)[keep],
            "IAS": ias,
            "Mach": mach_of_cas(ias, altitude),
            "track": [90.0] * len(altitude),
        }
    )


def fleet(flights: int = 4, **options: float) -> pl.DataFrame:
    """Several aircraft from different levels, 3,620 s apart: whole hours would be those of another clock."""
    return pl.concat(
        flight(f"4ca{number:03d}", top_ft=36_000.0 - 1000 * (number % 5), start_s=3620.0 * number, **options)
        for number in range(flights)
    )


def rows_at(times_s: list[float], flight_id: str = "a", **columns: list[float | None] | list[float]) -> pl.DataFrame:
    """Rows of one flight with just the columns named."""
    stamps = [int((START.timestamp() + t) * 1e6) for t in times_s]
    return pl.DataFrame(
        {
            "flight_id": [flight_id] * len(times_s),
            "icao24": ["4ca001"] * len(times_s),
            "typecode": ["A320"] * len(times_s),
            "timestamp": pl.from_epoch(pl.Series(stamps, dtype=pl.Int64), time_unit="us").dt.replace_time_zone("UTC"),
            **{name: pl.Series(values, dtype=pl.Float64) for name, values in columns.items()},
        }
    )


def written(frame: pl.DataFrame, path: Path) -> Path:
    """Write a table by the path's extension."""
    if path.suffix == ".parquet":
        frame.write_parquet(path)
    else:
        frame.write_csv(path)
    return path
