"""Detect a column in a wrong unit, or of another quantity, by physics: columns of a row follow from each other."""

import warnings

import numpy as np
import polars as pl

from descentflow.core.errors import DataError, DescentflowWarning
from descentflow.core.units import FT_M
from descentflow.surveillance.rows.air_data import cas_of_mach_kt
from descentflow.surveillance.rows.flight_ratios import contradicting_flights
from descentflow.surveillance.rows.other_checks import check_angles, check_constant_rate, check_possible
from descentflow.surveillance.rows.readings import (
    MIN_AIRCRAFT,
    MIN_VALUES,
    RATE_SAMPLE,
    Evidence,
    Solution,
    agreeing,
    as_given,
)
from descentflow.surveillance.rows.schema import POSSIBLE
from descentflow.surveillance.rows.times import check_numbers_of_days, check_whole_minutes
from descentflow.surveillance.rows.units_words import contradiction, refusal

CONTRADICTS_KT = 25.0
"""Difference of IAS and the CAS of Mach at which rows are dropped (`airspeeds_differ_kt`): a smaller one that no unit
explains is a poor instrument."""
GEOMETRIC_KT = 3.0
"""Median of IAS less the CAS of Mach and altitude above which altitude is hardly the pressure altitude: real sources
have up to 1.0, and a geometric altitude in ISA + 18 K has 7.5."""
GROWS = 1.3
"""Relative excess of the upper half of the rows over that of the lower from which it is an error of the altitude."""


def check_units(rows: pl.DataFrame, source: str) -> None:
    """Refuse rows with a column that is evidently in a wrong unit, or of another quantity.

    Altitude, IAS, Mach, TAS, groundspeed and vertical rate are read in every combination of units and meanings; where
    they contradict each other as given, the combination that changes least and makes all of them agree is the
    error. Where none does, the column without which the others agree is named, or all that contradict.

    Args:
        rows: As read, before the check of possible values: 300 kt in km/h would be impossible. Without a column Mach
            if the source has none, for one that is computed from IAS proves nothing of IAS.
        source: Begin of the message.

    Raises:
        DataError: Naming the column and the unit, sign or quantity that it seems to have.

    Example:
        >>> in_metres = pl.read_parquet("rows.parquet").with_columns(altitude=pl.col("altitude") * 0.3048)
        >>> check_units(in_metres, "rows.parquet")
        Traceback (most recent call last):
        ...
        descentflow.core.errors.DataError: rows.parquet: altitude seems to be in metres...
    """
    check_numbers_of_days(rows, source)
    # Rows of no address are of any aircraft; they are dropped, and counted, when rows are judged.
    rows = rows.drop_nulls("icao24") if rows["icao24"].has_nulls() else rows
    check_whole_minutes(rows, source)
    check_consistency(rows, source)
    check_angles(rows, source)
    _check_others(rows, source)
    check_possible(rows, source)


def check_consistency(rows: pl.DataFrame, source: str) -> None:
    """Refuse columns of which all rows contradict each other, and warn of flights that contradict what others do.

    Args:
        rows: Rows, or prepared descents with an altitude.
        source: Begin of the message.

    Raises:
        DataError: Naming the column and the unit, sign or quantity that it seems to have.

    Example:
        >>> check_consistency(pl.read_parquet("rows.parquet"), "rows.parquet")
    """
    check_constant_rate(rows.head(RATE_SAMPLE), source)
    if said := contradicting_flights(rows):
        warnings.warn(f"{source}: {said}", DescentflowWarning, stacklevel=4)
    elif (evidence := Evidence.of(rows)) is not None:
        given = as_given(evidence)
        if given.agrees:
            _check_geometric(evidence, source)
        elif error := _refusal(evidence, given, rows, source):
            raise error


def _check_geometric(evidence: Evidence, source: str) -> None:
    """Warn of an altitude that IAS and Mach contradict as a geometric one would."""
    if "Mach" not in evidence.columns:
        return
    altitude, ias, mach = (evidence.columns[name] for name in ("altitude", "IAS", "Mach"))
    with np.errstate(all="ignore"):
        excess = ias - cas_of_mach_kt(mach, altitude)
        shown = np.isfinite(excess / ias)
    altitude, excess, ias = altitude[shown], excess[shown], ias[shown]
    high = altitude > np.median(altitude) if len(altitude) else shown[:0]
    if not high.any() or high.all():
        return
    excess_kt = float(np.median(excess))
    # An error of the altitude grows with it, one of the airspeed does not.
    above, below = (abs(float(np.median((excess / ias)[part]))) for part in (high, ~high))
    if abs(excess_kt) > GEOMETRIC_KT and above > GROWS * below:
        warnings.warn(
            f"{source}: altitude seems to be a geometric altitude (alt_geom, geoaltitude, GPS), and no pressure "
            f"altitude: IAS less the CAS of Mach and altitude is {excess_kt:+.1f} kt in the median, where real sources "
            f"are within 1 kt; levels are then too {'high' if excess_kt > 0 else 'low'}: name the column of the "
            "pressure altitude (alt_baro, baroaltitude)",
            DescentflowWarning,
            stacklevel=4,
        )


def _refusal(evidence: Evidence, given: Solution, rows: pl.DataFrame, source: str) -> DataError | None:
    """The reading that makes columns agree that do not, or the column that contradicts the others.

    Returns:
        None where airliners do not fly so in any reading, which the cleaning counts, or nobody can be blamed.
    """
    found = agreeing(evidence, given)
    if not found:
        return contradiction(source, given, []) if given.possible else None
    best = [one for one in found if one.rank[:2] == found[0].rank[:2] and one.rank[2] < found[0].rank[2] + 0.2]
    if not any(reading.off for reading in best[0].readings.values()):
        return refusal(source, given, best)
    if _is_poor_instrument(evidence, given):
        return None
    error = contradiction(source, given, best)
    off = {name for one in best for name, reading in one.readings.items() if reading.off}
    if rows["icao24"].n_unique() >= MIN_AIRCRAFT and off != {"vertical_rate"}:
        return error
    # Rows of several aircraft under one address make such rates, too.
    shared = ", or give rows of different aircraft different icao24" if off == {"vertical_rate"} else ""
    warnings.warn(f"{error.got}; {error.mend}{shared}", DescentflowWarning, stacklevel=4)
    return None


def _is_poor_instrument(evidence: Evidence, given: Solution) -> bool:
    """Test for IAS and Mach alone in disagreement, by less than rows are dropped for."""
    if not given.possible or [pair for pair, misfit in given.misfits.items() if misfit > 1] != ["IAS and Mach"]:
        return False
    altitude, ias, mach = (evidence.columns[name] for name in ("altitude", "IAS", "Mach"))
    return float(np.median(np.abs(ias - cas_of_mach_kt(mach, altitude)))) <= CONTRADICTS_KT


def _check_others(rows: pl.DataFrame, source: str) -> None:
    """Geometric altitude against pressure altitude, temperature against zero."""
    if "geoaltitude" in rows.columns:
        seen = rows.select("altitude", "geoaltitude").drop_nulls()
        seen = seen.filter(pl.col("altitude").is_between(3000, POSSIBLE["altitude"][1]) & (pl.col("geoaltitude") > 0))
        ratio = np.median((seen["geoaltitude"] / seen["altitude"]).to_numpy()) if len(seen) >= MIN_VALUES else 1.0
        if abs(ratio / FT_M - 1) < 0.1:
            raise DataError(
                f"{source}: geoaltitude seems to be in metres: it is {ratio:.2f} of the pressure altitude",
                expected="geoaltitude in ft",
                mend=f"multiply the column by {1 / FT_M:.4f} before passing the rows",
            )
    if "temperature" in rows.columns:
        temperatures = rows["temperature"].drop_nulls().to_numpy()
        if len(temperatures) >= MIN_VALUES and float(np.median(temperatures)) < 100:
            raise DataError(
                f"{source}: temperature seems to be in degrees Celsius",
                expected="temperature in K",
                mend="add 273.15 to the column before passing the rows",
            )
