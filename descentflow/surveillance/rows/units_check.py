"""Detect a column in a wrong unit by physics: many quantities of a row can be computed from others."""

import numpy as np
import polars as pl

from descentflow.core.errors import DataError
from descentflow.core.units import FPM_MPS, FT_M, KT_MPS
from descentflow.surveillance.rows.air_data import Array, cas_of_mach_kt, isa_tas_of_mach_kt
from descentflow.surveillance.rows.schema import POSSIBLE

AGREES = 0.06
"""Median relative difference of IAS and the CAS of Mach below which units are taken to be right."""
WIND = 0.15
"""The same of a groundspeed and the TAS of Mach: half of the aircraft have less wind than this along their track."""
SAMPLE = 20_000
"""Rows that are checked."""
RATE_SAMPLE = 200_000
"""First rows of a file whose rates are checked: differences need neighbours."""
MIN_VALUES = 20
"""Rows below which nothing is checked."""
MIN_AIRCRAFT = 3
"""Aircraft below which groundspeed is not checked: one in 160 kt of headwind looks as if it were in m/s."""


HUNDREDS = 100.0
RATE_UNITS = {"m/s": 1 / FPM_MPS, "hundreds of ft/min": HUNDREDS}
"""Unit that a vertical rate is met in -> what it is multiplied by to be in ft/min."""
OTHER_UNITS = {
    "TAS": ("m/s", KT_MPS, 0.15, "kt"),
    "groundspeed": ("m/s", KT_MPS, 0.25, "kt"),
    "geoaltitude": ("metres", FT_M, 0.1, "ft"),
}
"""Column -> unit that is often found in it, that unit in the expected one, how far real rows differ from the expected
value (hot or cold air, wind, pressure), and the expected unit."""


def check_units(rows: pl.DataFrame, source: str) -> None:
    """Refuse rows with a column that is evidently in a wrong unit.

    Args:
        rows: As read, before the check of possible values: 300 kt in km/h would be impossible.
        source: Begin of the message.

    Raises:
        DataError: Naming the column and the unit or sign that it seems to have.

    Example:
        >>> in_metres = pl.read_parquet("rows.parquet").with_columns(altitude=pl.col("altitude") * 0.3048)
        >>> check_units(in_metres, "rows.parquet")
        Traceback (most recent call last):
        ...
        descentflow.core.errors.DataError: rows.parquet: altitude seems to be in metres...
    """
    _check_airspeeds(rows, source)
    _check_others(rows, source)
    check_rate_units(rows.head(RATE_SAMPLE).sort("icao24", "timestamp"), source)


def _check_others(rows: pl.DataFrame, source: str) -> None:
    """TAS, groundspeed and geometric altitude against Mach and pressure altitude; temperature against zero."""
    for name, (unit, size, spread, wanted) in OTHER_UNITS.items():
        if name not in rows.columns or (name == "groundspeed" and rows["icao24"].n_unique() < MIN_AIRCRAFT):
            continue
        seen = _sample(rows, name).filter((pl.col("altitude") > 3000) & (pl.col(name) > 0))
        if len(seen) < MIN_VALUES:
            continue
        altitude, mach, values = (seen[column].to_numpy() for column in ("altitude", "Mach", name))
        expected = altitude if name == "geoaltitude" else isa_tas_of_mach_kt(mach, altitude)
        ratio = float(np.median(values / expected))
        if abs(ratio / size - 1) < spread:
            raise DataError(
                f"{source}: {name} seems to be in {unit}: it is {ratio:.2f} of what Mach and altitude make",
                expected=f"{name} in {wanted}",
                mend=f"multiply the column by {1 / size:.4f} before passing the rows",
            )
    if "temperature" in rows.columns:
        temperatures = rows["temperature"].drop_nulls().to_numpy()
        if len(temperatures) >= MIN_VALUES and float(np.median(temperatures)) < 100:
            raise DataError(
                f"{source}: temperature seems to be in degrees Celsius",
                expected="temperature in K",
                mend="add 273.15 to the column before passing the rows",
            )


def _sample(rows: pl.DataFrame, *names: str) -> pl.DataFrame:
    usable = rows.select("altitude", "Mach", *names).drop_nulls()
    usable = usable.filter(pl.col("Mach").is_between(0.2, 1.0) & pl.col("altitude").is_between(*POSSIBLE["altitude"]))
    return usable.gather_every(max(len(usable) // SAMPLE, 1))


def _check_airspeeds(rows: pl.DataFrame, source: str) -> None:
    """IAS, Mach and pressure altitude: each follows from the other two.

    They are read in every combination of units; if the expected one does not fit and another does, the column is in
    that one.
    """
    usable = _sample(rows, "IAS").filter(pl.col("IAS").is_between(1.0, 1000.0))
    if len(usable) < MIN_VALUES:
        return
    altitude, ias, mach = (usable[name].to_numpy() for name in ("altitude", "IAS", "Mach"))
    expected = _misfit(ias, mach, altitude)
    if expected <= AGREES:
        return
    readings = {
        "altitude seems to be in metres": (1.0, 1 / FT_M),
        "altitude seems to be in hundreds of feet": (1.0, 100.0),
        "IAS seems to be in m/s": (1 / KT_MPS, 1.0),
        "IAS seems to be in km/h": (1 / 1.852, 1.0),
        "altitude seems to be in metres and IAS in m/s": (1 / KT_MPS, 1 / FT_M),
    }
    misfits = {what: _misfit(speed * ias, mach, height * altitude) for what, (speed, height) in readings.items()}
    best = min(misfits, key=misfits.__getitem__)
    of_tas = float(np.median(np.abs(np.log(ias / isa_tas_of_mach_kt(mach, altitude)))))
    if of_tas < min(WIND, expected / 2, misfits[best]):
        raise DataError(
            f"{source}: IAS seems to be TAS or groundspeed: it differs by {of_tas:.0%} from the TAS of Mach and "
            f"altitude, and by {expected:.0%} from their CAS",
            expected="indicated airspeed in kt",
            mend="take the indicated airspeed of BDS 6,0; where there is none, compute CAS from Mach and altitude",
        )
    if misfits[best] < min(AGREES, expected / 2):
        raise DataError(
            f"{source}: {best}; read so, IAS agrees with Mach and altitude within {misfits[best]:.1%} (as given: "
            f"{expected:.0%})",
            expected="altitude in ft and IAS in kt",
            mend="convert the column before passing the rows",
        )


def _misfit(ias_kt: Array, mach: Array, altitude_ft: Array) -> float:
    possible = altitude_ft <= POSSIBLE["altitude"][1]
    if np.median(possible) < 1:
        return float("inf")  # read so, flights would leave the atmosphere
    cas_kt = cas_of_mach_kt(mach[possible], altitude_ft[possible])
    return float(np.median(np.abs(np.log(np.maximum(ias_kt[possible], 1e-3) / cas_kt))))


def check_rate_units(rows: pl.DataFrame, source: str) -> None:
    """Refuse a vertical rate in m/s, or positive downwards, by the differences of the altitudes.

    Args:
        rows: Sorted by aircraft and time.
        source: Begin of the message.

    Raises:
        DataError: Naming the unit or sign that it seems to have.

    Example:
        >>> rows = pl.read_parquet("rows.parquet").sort("icao24", "timestamp")
        >>> check_rate_units(rows.with_columns(vertical_rate=-pl.col("vertical_rate")), "rows.parquet")
        Traceback (most recent call last):
        ...
        descentflow.core.errors.DataError: rows.parquet: vertical_rate has the sign of a sink rate...
    """
    if "vertical_rate" not in rows.columns:
        return
    seconds = pl.col("timestamp").diff().dt.total_microseconds() / 1e6
    steps = rows.select(
        differenced=pl.col("altitude").diff() / seconds * 60,
        reported=pl.col("vertical_rate"),
        seconds=seconds,
        same=pl.col("icao24") == pl.col("icao24").shift(),
    )
    steady = steps.filter(
        pl.col("same") & pl.col("seconds").is_between(2, 60) & pl.col("differenced").abs().is_between(800, 6000)
    ).drop_nulls()
    if len(steady) < MIN_VALUES:
        return
    ratio = float(np.median(steady["reported"].to_numpy() / steady["differenced"].to_numpy()))
    if 0.5 * FPM_MPS < abs(ratio) < 2.0 / HUNDREDS:
        unit, factor = min(RATE_UNITS.items(), key=lambda known: abs(np.log(abs(ratio) * known[1])))
        raise DataError(
            f"{source}: vertical_rate seems to be in {unit}: it is {ratio:.4f} of the altitude's change in ft/min",
            expected="vertical_rate in ft/min, negative in descent",
            mend=f"multiply the column by {np.copysign(factor, ratio):.5g} before passing the rows",
        )
    if ratio < 0:
        raise DataError(
            f"{source}: vertical_rate has the sign of a sink rate: it is positive where the altitude falls",
            expected="a rate of climb, negative in descent",
            mend="change the sign of the column",
        )
