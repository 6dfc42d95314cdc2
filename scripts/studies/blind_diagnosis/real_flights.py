"""Real flights with a channel withheld: the diagnosis with it and without, beside what it never saw."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import polars as pl

from descentflow.surveillance.descents.prepared_descents import Descents
from descentflow.surveillance.formats.aircraft_json import embedded_rows, embedded_types
from descentflow.surveillance.prepare import prepare
from studies.blind_diagnosis.hypsometry import Deviation, hypsometric_deviation, speed_deviation
from studies.blind_diagnosis.winds import Gradient, tailwind_gradient, wind_profile

BASIC: Final = ("IAS", "Mach", "vertical_rate")
WIND: Final = ("TAS", "groundspeed", "track", "heading")
BENGALURU_DEG: Final = 13.2
"""Latitude of the receiver's arrivals."""
DUTCH_DECLINATION_DEG: Final = 1.0
"""Magnetic declination over the Netherlands in January 2017, east."""
DUTCH_TYPES: Final = ("A319", "A320", "A321", "B737", "B738", "B739")
LONGEST_GAP_S: Final = 20.0
Diagnose = Callable[[Descents, str, Sequence[str]], dict[str, Any]]
"""Descents, nominal type and channels to the content of gap.json."""


@dataclass(frozen=True)
class TemperatureCheck:
    """Flights near Bengaluru, diagnosed with TAS and without, geometric altitude kept from both.

    Example:
        >>> check = check_temperature(lambda descents, typecode, channels: {"causes": [], "channels": channels})
        >>> check.with_channel["channels"], check.without["channels"]
        (('IAS', 'Mach', 'vertical_rate', 'TAS'), ('IAS', 'Mach', 'vertical_rate'))
    """

    with_channel: dict[str, Any]
    without: dict[str, Any]
    by_height: Deviation
    by_speed: Deviation
    descents: Descents


@dataclass(frozen=True)
class WindCheck:
    """Flights over the Netherlands, diagnosed with the wind's channels and without.

    Example:
        >>> rows = pl.read_parquet("rows.parquet")
        >>> others = pl.col("icao24") > rows["icao24"].min()  # diagnosed is one aircraft, by the wind of the others
        >>> rows = rows.with_columns(typecode=pl.when(others).then(pl.lit("B772")).otherwise("typecode"))
        >>> check = check_wind(rows, Path("."), lambda descents, typecode, channels: {"causes": []})
        >>> check.profile["aircraft"].max() == rows["icao24"].n_unique() - 1
        True
    """

    with_channel: dict[str, Any]
    without: dict[str, Any]
    profile: pl.DataFrame
    """By aircraft that were not diagnosed."""
    by_others: Gradient
    descents: Descents


def check_temperature(diagnose: Diagnose, bottom_fl: int = 60) -> TemperatureCheck:
    """Diagnose the embedded A20N and A21N against nominal open A20N, and their air by its heights.

    Args:
        diagnose: The diagnosis under test.
        bottom_fl: Lowest level: most of these arrivals start below FL220.

    Returns:
        The two diagnoses, and the deviations that they did not see.

    Example:
        >>> check = check_temperature(lambda descents, typecode, channels: {"causes": []})
        >>> round(check.by_height.mean_k), round(check.by_speed.mean_k)  # kelvins above the standard, near Bengaluru
        (17, 14)
    """
    descents = prepare(embedded_rows(), types=embedded_types(), typecode=["A20N", "A21N"], bottom_fl=bottom_fl)
    hidden = Descents(descents.frame.drop("geoaltitude"), descents.metadata)
    return TemperatureCheck(
        diagnose(hidden, "A20N", (*BASIC, "TAS")),
        diagnose(hidden, "A20N", BASIC),
        hypsometric_deviation(descents.frame, latitude_deg=BENGALURU_DEG),
        speed_deviation(descents.frame),
        descents,
    )


def check_wind(rows: pl.DataFrame, folder: Path, diagnose: Diagnose, bottom_fl: int = 60) -> WindCheck:
    """Diagnose Dutch arrivals against nominal open A320, and the wind by the other aircraft of that hour.

    Args:
        rows: Rows of the hour.
        folder: For a file of rows with gaps filled.
        diagnose: The diagnosis under test.
        bottom_fl: Lowest level.

    Returns:
        The two diagnoses, and the wind that they did not see.

    Raises:
        DataError: If the other aircraft give no wind, or no descent is left.

    Example:
        >>> rows = pl.read_parquet("rows.parquet")  # A320 alone: no other aircraft to tell the wind
        >>> check_wind(rows, Path("."), lambda descents, typecode, channels: {"causes": []})
        Traceback (most recent call last):
            ...
        descentflow.core.errors.DataError: 0 layers with a wind...
    """
    path = folder / "filled.parquet"
    filled(rows, WIND).write_parquet(path)
    descents = prepare(path, typecode=list(DUTCH_TYPES), bottom_fl=bottom_fl)
    diagnosed = descents.frame["icao24"].unique().implode()
    profile = wind_profile(rows.filter(~pl.col("icao24").is_in(diagnosed)), DUTCH_DECLINATION_DEG)
    return WindCheck(
        diagnose(descents, "A320", (*BASIC, *WIND)),
        diagnose(descents, "A320", BASIC),
        profile,
        tailwind_gradient(descents.frame, profile),
        descents,
    )


def filled(rows: pl.DataFrame, columns: Sequence[str]) -> pl.DataFrame:
    """Values between two reports of an aircraft at most 20 s apart, by a straight line in time.

    Mode S registers are asked for in turn, so that a row with a Mach number often misses the TAS of a second before.

    Args:
        rows: Rows with ``icao24``, ``timestamp`` and the columns.
        columns: What to fill; angles the short way round.

    Returns:
        The rows sorted by aircraft and time.

    Example:
        >>> rows = pl.read_parquet("rows.parquet").with_row_index("k")
        >>> gappy = rows.with_columns(pl.when(pl.col("k") % 2 == 0).then("TAS").alias("TAS"))
        >>> filled(gappy, ["TAS"])["TAS"].null_count() < gappy["TAS"].null_count() / 10
        True
    """
    rows = rows.sort("icao24", "timestamp").with_columns((pl.col("timestamp").dt.epoch("us") / 1e6).alias("_s"))
    aircraft = "icao24"
    for name in columns:
        at = pl.when(pl.col(name).is_not_null()).then("_s")
        before, after = at.forward_fill().over(aircraft), at.backward_fill().over(aircraft)
        first, last = pl.col(name).forward_fill().over(aircraft), pl.col(name).backward_fill().over(aircraft)
        step = last - first
        if name in ("track", "heading"):
            step = (step + 180) % 360 - 180
        share = pl.when(after > before).then((pl.col("_s") - before) / (after - before)).otherwise(0.0)
        value = first + share * step
        value = value % 360 if name in ("track", "heading") else value
        rows = rows.with_columns(
            pl.when(pl.col(name).is_null() & (after - before <= LONGEST_GAP_S)).then(value).otherwise(name).alias(name)
        )
    return rows.drop("_s")


def found(report: dict[str, Any], effect: str, parameter: str) -> dict[str, Any] | None:
    """Estimate of an effect's parameter, None where the effect is not named.

    Example:
        >>> cause = {"effect": "temperature", "parameters": {"deviation_k": {"estimate": 9.8}}}
        >>> found({"causes": [cause]}, "temperature", "deviation_k")
        {'estimate': 9.8}
    """
    named = next((cause for cause in report["causes"] if cause["effect"] == effect), None)
    return None if named is None else named["parameters"].get(parameter)
