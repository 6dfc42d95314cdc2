"""Checks of columns: units and quantities by physics, of all rows or some flights, and values that stand for none."""

from dataclasses import replace

import numpy as np
import polars as pl

from descentflow.core.errors import DataError, warn
from descentflow.core.units import FT_M
from descentflow.surveillance.rows._readings import (
    FASTEST_FPM,
    LEAP_FPM,
    LOWEST_TAS_FT,
    MAX_IAS_OF_MACH,
    MAX_RATE_OF_CHANGE,
    MAX_RATE_ROWS,
    MAX_TAS_OF_IAS,
    MIN_AIRCRAFT,
    SLOWEST_FPM,
    Reading,
    Solution,
    UnitEvidence,
    agreeing,
    flies,
    judged,
    steps_of,
    tried,
)
from descentflow.surveillance.rows._times import check_numbers_of_days, check_whole_minutes
from descentflow.surveillance.rows._units_words import contradiction, readings_in_words, refusal, scaled_by_hundred
from descentflow.surveillance.rows.air_data import cas_of_mach_kt, isa_tas_of_mach_kt, mach_of_cas
from descentflow.surveillance.rows.schema import MIN_CHECKED_VALUES, POSSIBLE, REQUIRED

CONTRADICTS_KT = 25.0
"""Difference of IAS and the CAS of Mach at which rows are dropped (`airspeeds_differ_kt`): a smaller one that no unit
explains is a poor instrument."""
GEOMETRIC_KT = 3.0
"""Median of IAS less the CAS of Mach and altitude above which altitude is hardly the pressure altitude: real sources
have up to 1.0, and a geometric altitude in ISA + 18 K has 7.5."""
MIN_EXCESS_GROWTH = 1.3
"""Relative excess of the upper half of the rows over that of the lower from which it is an error of the altitude."""
ALLOWED_OF_FLIGHT = {
    "IAS": MAX_IAS_OF_MACH,
    "TAS": MAX_TAS_OF_IAS,
    "groundspeed": 0.5,
    "vertical_rate": MAX_RATE_OF_CHANGE,
}
"""Column -> logarithm of the median ratio of a flight up to which it agrees; wind makes 0.4 of a
groundspeed (100 kt against 300)."""
MIN_AGREEING_SHARE = 0.1
"""Share of flights that agree from which the others are named, and the table is not refused as a whole."""
MAX_LISTED_FLIGHTS = 5
MAX_COPIED_SHARE = 0.9
"""Share of rows whose two altitudes are the same, above which one is a copy of the other."""


def check_units(rows: pl.DataFrame, source: str) -> None:
    """Refuse rows with a column that is evidently in a wrong unit, or of another quantity.

    Where altitude, IAS, Mach, TAS, groundspeed and vertical rate contradict each other as given, each is read in other
    units and meanings, and those together that tables were met with; what makes all agree is the error. Where nothing
    does, the column without which the others agree is named, or all that contradict.

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
    rows = rows.drop_nulls("icao24")
    check_whole_minutes(rows, source)
    check_consistency(rows, source)
    check_angles(rows, source)
    check_other_units(rows, source)
    check_possible(rows, source)


def check_ground_vector(rows: pl.DataFrame, source: str) -> None:
    """Refuse rows without airspeeds whose groundspeed, altitude or rate is evidently in a wrong unit.

    Above FL280 half of the groundspeeds are nearer to possible true airspeeds than to any in another unit.

    Args:
        rows: As read, with a groundspeed.
        source: Begin of the message.

    Raises:
        DataError: Naming the column and the unit that it seems to have, or an altitude that is the geometric one.
    """
    check_numbers_of_days(rows, source)
    rows = rows.drop_nulls("icao24")
    check_whole_minutes(rows, source)
    check_constant_rate(rows.head(MAX_RATE_ROWS), source)
    check_angles(rows, source)
    check_other_units(rows, source)
    check_possible(rows, source)
    _check_copied_altitude(rows, source)
    if set(rows.columns) >= {"groundspeed", "altitude"}:
        _check_speed_over_ground(rows, source)


def _check_speed_over_ground(rows: pl.DataFrame, source: str) -> None:
    others = [name for name in ("TAS", "Mach") if name in rows.columns]
    evidence = UnitEvidence.of(rows.drop(others).with_columns(IAS="groundspeed").drop("groundspeed"))
    if not evidence.columns:
        return

    def read(readings: dict[str, Reading]) -> Solution:
        # TAS, and shown as the groundspeed that it is nearly.
        speed = readings["IAS"]
        solution = judged(evidence, {**readings, "IAS": replace(speed, meaning="TAS")})
        shown = {"groundspeed" if name == "IAS" else name: one for name, one in readings.items() if one.words}
        return replace(solution, readings=shown)

    given = read(evidence.given)
    several = [] if given.agrees else tried(evidence, evidence.given)
    solutions = [read(readings) for readings in several if not readings["IAS"].meaning]
    if best := sorted((each for each in solutions if each.agrees and not each.off), key=lambda each: each.rank)[:1]:
        raise refusal(source, given, best)


def _check_copied_altitude(rows: pl.DataFrame, source: str) -> None:
    """Refuse an altitude that is the geometric one again: CAS follows from the pressure altitude."""
    seen = rows.select("altitude", "geoaltitude").drop_nulls() if "geoaltitude" in rows.columns else rows.clear()
    seen = seen.filter(pl.col("altitude") > LOWEST_TAS_FT)
    if len(seen) >= MIN_CHECKED_VALUES and (seen["altitude"] == seen["geoaltitude"]).mean() > MAX_COPIED_SHARE:  # type: ignore[operator]
        raise DataError(
            f"{source}: altitude is the geometric altitude in nearly all rows",
            expected="the pressure altitude (alt_baro, baroaltitude), of which CAS follows",
            mend="name the column of the pressure altitude, for instance --column altitude=baroaltitude",
        )


def check_consistency(rows: pl.DataFrame, source: str) -> None:
    """Refuse columns of which all rows contradict each other, and warn of flights that contradict what others do."""
    check_constant_rate(rows.head(MAX_RATE_ROWS), source)
    if flights := _contradicting_flights(rows):
        warn(f"{source}: {flights}")
        return
    evidence = UnitEvidence.of(rows)
    if not evidence.columns:
        return
    given = judged(evidence, evidence.given)
    if given.agrees:
        _check_geometric(evidence, source)
    else:
        _check_contradiction(evidence, given, rows, source)


def _check_geometric(evidence: UnitEvidence, source: str) -> None:
    """Warn of an altitude that IAS and Mach contradict as a geometric one would."""
    altitude, share = evidence.columns["altitude"], _excess_of_ias(evidence)
    shown = np.isfinite(share)
    altitude, share, ias = altitude[shown], share[shown], evidence.columns["IAS"][shown]
    high = altitude > np.median(altitude) if len(altitude) else shown[:0]
    if not high.any() or high.all():
        return
    excess_kt = float(np.median(share * ias))
    # An error of the altitude grows with it, one of the airspeed does not.
    above, below = (abs(float(np.median(share[part]))) for part in (high, ~high))
    if abs(excess_kt) > GEOMETRIC_KT and above > MIN_EXCESS_GROWTH * below:
        warn(
            f"{source}: altitude seems to be a geometric altitude (alt_geom, geoaltitude, GPS), and no pressure "
            f"altitude: IAS less the CAS of Mach and altitude is {excess_kt:+.1f} kt in the median, where real sources "
            f"are within 1 kt; levels are then too {'high' if excess_kt > 0 else 'low'}: name the column of the "
            "pressure altitude (alt_baro, baroaltitude)"
        )


def _excess_of_ias(evidence: UnitEvidence) -> np.ndarray:
    """(n,) IAS less the CAS of Mach and altitude, over IAS; NaN without Mach."""
    altitude, ias = evidence.columns["altitude"], evidence.columns["IAS"]
    with np.errstate(all="ignore"):
        return np.asarray((ias - cas_of_mach_kt(evidence.columns.get("Mach", np.nan * ias), altitude)) / ias)


def _check_contradiction(evidence: UnitEvidence, given: Solution, rows: pl.DataFrame, source: str) -> None:
    """Refuse by the reading that makes columns agree that do not, or name the column that contradicts the others.

    Nothing is said where airliners do not fly so in any reading, which the cleaning counts, or nobody can be blamed.
    """
    best = agreeing(evidence, given)
    if best and not best[0].off:
        raise refusal(source, given, best)
    if not best and not given.possible:
        return
    off = {name for reading in best for name in reading.off}
    excess_kt = np.abs(_excess_of_ias(evidence)) * evidence.columns["IAS"]
    poor = best and given.possible and given.wrong == ["IAS and Mach"] and float(np.median(excess_kt)) <= CONTRADICTS_KT
    if poor:
        return
    error = contradiction(source, given, best)
    if not best or (rows["icao24"].n_unique() >= MIN_AIRCRAFT and off != {"vertical_rate"}):
        raise error
    # Rows of several aircraft under one address make such rates, too.
    shared = ", or give rows of different aircraft different icao24" if off == {"vertical_rate"} else ""
    warn(f"{error.got}; {error.mend}{shared}")


def _contradicting_flights(rows: pl.DataFrame) -> str:
    """Words for flights whose columns agree in other units alone, while those of others agree as given; else empty."""
    names: list[str] = [name for name in ("flight_id", "icao24") if name in rows.columns]
    ratios = _ratios_of_flights(rows, names)
    compared = [name for name in ALLOWED_OF_FLIGHT if name in ratios.columns]
    agrees = [(pl.col(name).log().abs() <= ALLOWED_OF_FLIGHT[name]).fill_null(True) for name in compared]
    wrong = ratios.filter(~pl.all_horizontal(True, *agrees))
    number = len(ratios) - len(wrong)
    if wrong.is_empty() or number <= MIN_AGREEING_SHARE * len(ratios):
        return ""
    flights: dict[str, list[str]] = {}
    # Flights of one sign and factor are of one source.
    alike = wrong.with_columns(pl.col(compared).sign() * (pl.col(compared).abs().log(2).round() + 99))
    for some in alike.partition_by(compared, maintain_order=True):
        evidence = UnitEvidence.of(rows.join(some, on=names, how="semi"))
        given = judged(evidence, evidence.given) if evidence.columns else Solution({})
        best = [] if given.agrees else agreeing(evidence, given)[:1]
        if best and not best[0].off:
            flights.setdefault(readings_in_words(best[0]), []).extend(some[names[0]])
    if not flights:
        return ""
    described = "; in ".join(
        f"{len(which):,} flights ({', '.join(which[:MAX_LISTED_FLIGHTS])}"
        f"{', ...' * (len(which) > MAX_LISTED_FLIGHTS)}) {words}"
        for words, which in flights.items()
    )
    return (
        f"columns of some flights contradict each other: in {described}; the columns of {number:,} others "
        "agree as given: convert the rows of each source before they are put together"
    )


def _ratios_of_flights(rows: pl.DataFrame, names: list[str]) -> pl.DataFrame:
    """Medians of each flight: IAS over the CAS of Mach, TAS and groundspeed over the TAS of Mach, rate over change.

    They are null where a flight has too few rows; flights without any are left out.
    """
    flying = rows.filter(flies())
    values = {
        name: flying[name].cast(pl.Float64).to_numpy()
        for name in ("altitude", "IAS", "Mach", "TAS", "groundspeed")
        if name in rows.columns
    }
    altitude, ias = values["altitude"], values["IAS"]
    with np.errstate(all="ignore"):
        mach = values.get("Mach", mach_of_cas(ias, altitude))
        tas = np.where(altitude > LOWEST_TAS_FT, isa_tas_of_mach_kt(mach, altitude), np.nan)
        made = {"TAS": tas, "groundspeed": tas} | ({"IAS": cas_of_mach_kt(mach, altitude)} if "Mach" in values else {})
        shares = {name: values[name] / other for name, other in made.items() if name in values}
    table = flying.select(names).with_columns(pl.Series(name, share).fill_nan(None) for name, share in shares.items())
    enough = [pl.when(pl.count(name) >= MIN_CHECKED_VALUES).then(pl.median(name)).alias(name) for name in shares]
    ratios = table.group_by(names, maintain_order=True).agg(enough)
    if "vertical_rate" in rows.columns:
        moving = pl.any_horizontal(pl.col("change", "reported").abs().is_between(SLOWEST_FPM, FASTEST_FPM))
        steps = steps_of(rows).filter(moving, pl.col("change").is_between(-LEAP_FPM, 0)).group_by(names)
        rates = steps.agg(pl.len(), vertical_rate=(pl.col("reported") / pl.col("change")).median())
        rates = rates.filter(pl.col("len") >= MIN_CHECKED_VALUES).drop("len")
        ratios = ratios.join(rates, on=names, how="left", maintain_order="left")
    return ratios.filter(pl.any_horizontal(pl.exclude(names).is_not_null()))


OTHER_FPM, MAX_OTHER_SHARE = 500.0, 0.1
"""Difference of a rate from the change of altitude that rounding to 25 ft does not make, and share of such rows above
which a rate that is one number is none."""


def check_angles(rows: pl.DataFrame, source: str) -> None:
    """Refuse angles in radians: tracks, headings or winds of several aircraft within seven degrees of north."""
    for name in ("track", "heading", "wind_direction"):
        if name not in rows.columns or rows["icao24"].n_unique() < MIN_AIRCRAFT:
            continue
        angles = rows[name].drop_nulls().to_numpy()
        angles = np.abs(angles[np.isfinite(angles)])
        if len(angles) < MIN_CHECKED_VALUES or angles.max() > 2 * np.pi + 1e-6:
            continue
        # Of degrees near north some would be on the other side, at 350.
        if angles.min() < np.pi / 2 < angles.max() and np.any(angles % 1) and angles.max() > 2.5:
            raise DataError(
                f"{source}: {name} seems to be in radians: none of {len(angles):,} values is above {angles.max():.2f}",
                expected=f"{name} in degrees",
                mend=f"multiply the column {name} by {180 / np.pi:.4f} before passing the rows",
            )


def check_constant_rate(rows: pl.DataFrame, source: str) -> None:
    """Refuse a vertical rate that is one number throughout, of rows whose altitude often changes otherwise."""
    rates = rows["vertical_rate"].drop_nulls() if "vertical_rate" in rows.columns else pl.Series(dtype=pl.Float64)
    if len(rates) < MIN_CHECKED_VALUES or rates.n_unique() > 1:
        return
    names = [name for name in ("flight_id", "icao24") if name in rows.columns]
    ordered = rows.drop_nulls(["altitude", "timestamp"]).sort(*names, "timestamp", maintain_order=True)
    minutes = pl.col("timestamp").diff().over(*names).dt.total_microseconds() / 60e6
    changes = ordered.select(
        pl.when(minutes.is_between(1 / 30, 1)).then(pl.col("altitude").diff() / minutes)
    ).to_series()
    others = (changes.drop_nulls() - rates[0]).abs() > OTHER_FPM
    if len(others) >= MIN_CHECKED_VALUES and float(others.mean() or 0.0) > MAX_OTHER_SHARE:
        raise DataError(
            f"{source}: vertical_rate is {rates[0]:g} in all of {len(rates):,} rows, while the altitude changes",
            expected="vertical_rate in ft/min as the aircraft reported it, or no such column",
            mend="leave the column vertical_rate out: the rate is then differenced from altitude",
        )


def check_other_units(rows: pl.DataFrame, source: str) -> None:
    """Refuse a geometric altitude in metres and a temperature in degrees Celsius."""
    if "geoaltitude" in rows.columns:
        seen = rows.select("altitude", "geoaltitude").drop_nulls()
        seen = seen.filter(pl.col("altitude").is_between(3000, POSSIBLE["altitude"][1]) & (pl.col("geoaltitude") > 0))
        ratio = np.median((seen["geoaltitude"] / seen["altitude"]).to_numpy()) if len(seen) >= MIN_CHECKED_VALUES else 1
        if abs(ratio / FT_M - 1) < 0.1:
            raise DataError(
                f"{source}: geoaltitude seems to be in metres: it is {ratio:.2f} of the pressure altitude",
                expected="geoaltitude in ft",
                mend=f"multiply the column by {1 / FT_M:.4f} before passing the rows",
            )
    temperatures = rows["temperature"].drop_nulls().to_numpy() if "temperature" in rows.columns else np.zeros(0)
    if len(temperatures) >= MIN_CHECKED_VALUES and float(np.median(temperatures)) < 100:
        raise DataError(
            f"{source}: temperature seems to be in degrees Celsius",
            expected="temperature in K",
            mend="add 273.15 to the column before passing the rows",
        )


MIN_OUTSIDE_SHARE, MIN_SCALED_SHARE = 0.5, 0.9
"""Share of a column's values that are impossible from which the column is named, and share of these that a factor of a
hundred makes possible, if it is that."""


def check_possible(rows: pl.DataFrame, source: str) -> None:
    """Warn of a column of which most values are impossible; the judging of rows sets them to missing.

    A required column is refused where a factor of a hundred is the cause, and else left to the judging of rows.
    """
    for name in sorted(set(POSSIBLE) & set(rows.columns)):
        values, (low, high) = rows[name].drop_nulls(), POSSIBLE[name]
        outside = values.filter(~values.is_between(low, high))
        if len(values) < MIN_CHECKED_VALUES or len(outside) <= MIN_OUTSIDE_SHARE * len(values):
            continue
        factor = _factor_of_hundred(outside, low, high)
        if name not in REQUIRED:
            scaled = f" (times {factor:g} they would be possible)" if factor else ""
            warn(
                f"{source}: {len(outside):,} of {len(values):,} values of {name} are outside {low:g} to {high:g} and "
                f"taken for missing (the most frequent: {outside.mode().sort()[0]:g}): check the unit of the column"
                f"{scaled}, and leave values that stand for none empty"
            )
        elif factor:
            raise scaled_by_hundred(source, name, factor, len(outside), len(values))


def _factor_of_hundred(outside: pl.Series, low: float, high: float) -> float | None:
    """The factor that makes values possible; None for one number that stands for none, however it is scaled."""
    if outside.n_unique() <= 2:
        return None
    inside = {factor: (outside * factor).is_between(low, high).sum() for factor in (0.01, 100.0)}
    return next((factor for factor, number in inside.items() if number > MIN_SCALED_SHARE * len(outside)), None)
