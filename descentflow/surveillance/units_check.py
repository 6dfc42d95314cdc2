"""Detect a column in the wrong unit: IAS, Mach and pressure altitude say the same thing three times."""

import numpy as np
import polars as pl

from descentflow.errors import DataError
from descentflow.surveillance.airdata import Array, cas_of_mach_kt
from descentflow.surveillance.schema import POSSIBLE
from descentflow.units import FPM_MPS, FT_M, KT_MPS

AGREES = 0.06
"""Median relative difference of IAS and the CAS of Mach below which a reading of the units fits."""
SAMPLE = 20_000
"""Rows that are looked at."""
FEWEST = 20
"""Rows below which nothing can be said."""


def check_airspeed_units(rows: pl.DataFrame) -> None:
    """Refuse altitude in metres and IAS in m/s or km/h.

    The airspeeds are read in every combination of units; if the expected one does not fit and another does, that is
    what the column holds.

    Args:
        rows: As read: a range check before this one would take 300 kt in km/h for impossible.

    Raises:
        DataError: Naming the column and the unit that it seems to have.
    """
    usable = rows.select("altitude", "IAS", "Mach").drop_nulls()
    usable = usable.filter(
        pl.col("Mach").is_between(0.2, 1.0)
        & pl.col("altitude").is_between(*POSSIBLE["altitude"])
        & pl.col("IAS").is_between(1.0, 1000.0)
    )
    usable = usable.gather_every(max(len(usable) // SAMPLE, 1))
    if len(usable) < FEWEST:
        return
    altitude, ias, mach = (usable[name].to_numpy() for name in ("altitude", "IAS", "Mach"))
    expected = _misfit(ias, mach, altitude)
    if expected <= AGREES:
        return
    readings = {
        "altitude seems to be in metres": (1.0, 1 / FT_M),
        "IAS seems to be in m/s": (1 / KT_MPS, 1.0),
        "IAS seems to be in km/h": (1 / 1.852, 1.0),
        "altitude seems to be in metres and IAS in m/s": (1 / KT_MPS, 1 / FT_M),
    }
    misfits = {what: _misfit(speed * ias, mach, height * altitude) for what, (speed, height) in readings.items()}
    best = min(misfits, key=misfits.__getitem__)
    if misfits[best] < min(AGREES, expected / 2):
        raise DataError(
            f"{best}: read so, IAS agrees with Mach and altitude within {misfits[best]:.1%} (as given: {expected:.0%})",
            expected="altitude in ft and IAS in kt",
            mend="convert the column before passing the rows",
        )


def _misfit(ias_kt: Array, mach: Array, altitude_ft: Array) -> float:
    return float(np.median(np.abs(np.log(np.maximum(ias_kt, 1e-3) / cas_of_mach_kt(mach, altitude_ft)))))


def check_rate_units(rows: pl.DataFrame) -> None:
    """Refuse a vertical rate in m/s, or positive downwards, by the differences of the altitudes.

    Args:
        rows: Sorted by aircraft and time.

    Raises:
        DataError: Naming the unit or sign that it seems to have.
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
    if len(steady) < FEWEST:
        return
    ratio = float(np.median(steady["reported"].to_numpy() / steady["differenced"].to_numpy()))
    if 0.5 < ratio * (1 / FPM_MPS) < 2.0:
        raise DataError(
            f"vertical_rate seems to be in m/s: it is {ratio:.4f} of the altitude's change in ft/min",
            expected="vertical_rate in ft/min",
            mend="multiply the column by 196.85 before passing the rows",
        )
    if ratio < 0:
        raise DataError(
            "vertical_rate has the sign of a sink rate: it is positive where the altitude falls",
            expected="a rate of climb, negative in descent",
            mend="change the sign of the column",
        )
