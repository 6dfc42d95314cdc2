"""Level flight in descents, EUROCONTROL's harmonised indicator of continuous descents: by segment and by flight.

Limits are those of the Performance Review Unit, *Vertical Flight Efficiency during Climb and Descent* (methodology,
ansperformance.eu), which follows the European CCO/CDO Task Force. A height above the airport is a pressure altitude
here: where the airport is, rows do not say.
"""

from collections.abc import Mapping

import polars as pl

from descentflow.surveillance.cleaning.rates import MIN_SIDE_REPORTS, SIDE_S, with_rate
from descentflow.surveillance.rows.air_data import isa_tas_of_mach_kt
from descentflow.surveillance.rows.drop_report import DropReport

LEVEL_FPM = 300.0
"""A flight is level while its vertical rate is within this of zero."""
LEAST_S = 20.0
"""Shorter level flight does not count."""
BOTTOM_FT = 1800.0
"""The descent ends here: below, aircraft are on the glide path."""
BOX_SHARE, BOX_S = 0.9, 300.0
"""Level flight longer than this, above this share of the highest altitude, is cruise: the descent begins after it."""
TOP_FT = 200.0
"""The descent begins where a flight is for the last time so near to its highest altitude. Ours, for altitudes come in
steps and with errors."""
LEAST_DESCENT_FT = 5000.0
"""Height that a flight loses at least to be counted among descents. Ours, for receivers see parts of flights."""
LONGEST_GAP_S = 60.0
"""Between reports of one segment. Ours."""
RARE_S = SIDE_S / (MIN_SIDE_REPORTS - 1)
"""Reports so far apart do not show where a held rate begins and ends, and level flight by the mean rate between them
too."""
BAND_FT = 5000
"""Height of the bands of altitude in which the report counts."""
FLIGHTS, CONTINUOUS = "flights that descend by 5,000 ft or more", "of them without level flight (300 ft/min, 20 s)"
IN_BAND, HELD = "seconds level in descents from FL", "seconds at a held rate in descents"
RARE = f"descents whose reports are {RARE_S:.0f} s apart or more, too rare to show a held rate"
SPEEDS = ("groundspeed", "TAS", "Mach", "IAS")


def stretches(rows: pl.DataFrame, held: pl.Series | None = None, gap_s: float = LONGEST_GAP_S) -> pl.DataFrame:
    """Descents and their level segments: the rate within 300 ft/min for 20 s or more, from the top down to 1,800 ft.

    Of reports 10 s apart or more, the mean rate between two counts as well: a segment of few reports is seen by it.

    Args:
        rows: Reports of whole flights with ``flight_id timestamp altitude``, and ``vertical_rate``, ``groundspeed``,
            ``TAS``, ``Mach`` or ``IAS`` where they are known; a missing rate is the slope of the altitude.
        held: Whether each row is at a held rate, where that is known; ``rows`` are sorted then, and have rates.
        gap_s: Longest time between reports of one segment.

    Returns:
        ``flight_id kind timestamp seconds interval_s altitude_ft distance_nm IAS IAS_change``: one row with the kind
        ``descent`` for each flight that loses 5,000 ft, and one for each of its segments, ``level`` or ``held``. The
        time is that of the begin, altitude and IAS (kt) are means, ``IAS_change`` is from the first to the last,
        ``interval_s`` is the median time between reports. The distance is over the ground, or through standard air
        without a groundspeed; missing where no speed is known.

    Example:
        >>> from datetime import datetime, timedelta
        >>> times = [datetime(2024, 3, 1) + timedelta(seconds=s) for s in range(0, 1000, 10)]
        >>> altitude = [max(30_000 - 20 * s, 20_000) - max(20 * (s - 560), 0) for s in range(0, 1000, 10)]
        >>> rows = pl.DataFrame({"flight_id": "a", "timestamp": times, "altitude": altitude})
        >>> stretches(rows).select("kind", "seconds").rows()
        [('descent', 980.0), ('level', 60.0)]
    """
    names = [name for name in ("altitude", "vertical_rate", *SPEEDS) if name in rows.columns]
    used = rows.select("flight_id", "timestamp", *(pl.col(name).cast(pl.Float64) for name in names))
    if held is None:
        used = with_rate(used.sort("flight_id", "timestamp"))
    marks = [] if held is None else [held.alias("held")]
    descent = _descents(_with_speed(used).with_columns(*marks))
    level = _runs(descent, _is_level(gap_s), "level", gap_s)
    level = level.filter(pl.col("seconds") >= LEAST_S)
    # Cruise a little below the highest altitude is none of the descent.
    cruise = (pl.col("altitude_ft") >= BOX_SHARE * pl.col("top_ft")) & (pl.col("seconds") > BOX_S)
    begins = level.filter(cruise).group_by("flight_id").agg(begin=pl.col("end").max())

    def after(some: pl.DataFrame) -> pl.DataFrame:
        both = some.join(begins, on="flight_id", how="left", maintain_order="left")
        return both.filter(pl.col("begin").is_null() | (pl.col("timestamp") >= pl.col("begin"))).drop("begin")

    descent = after(descent)
    parts = [_runs(descent, pl.col("altitude").is_not_null(), "descent", float("inf")), after(level)]
    parts += [_runs(descent, pl.col("held"), "held", gap_s)] if marks else []
    return pl.concat(parts).drop("end", "top_ft").sort("flight_id", "kind", "timestamp")


def _is_level(gap_s: float) -> pl.Expr:
    """Rates within 300 ft/min, and both ends of longer times between reports in which the mean rate is."""
    mean = pl.col("altitude").diff().over("flight_id") / pl.col("seconds") * 60
    since = (mean.abs() <= LEVEL_FPM) & pl.col("seconds").is_between(RARE_S, gap_s)
    at_once = (pl.col("vertical_rate").abs() <= LEVEL_FPM).fill_null(False)
    return at_once | (since | since.shift(-1).over("flight_id")).fill_null(False)


def _with_speed(rows: pl.DataFrame) -> pl.DataFrame:
    """Rows with one speed (kt) for the distance and one IAS, each missing where none is known."""
    if "Mach" in rows.columns:
        through = isa_tas_of_mach_kt(*(rows[name].to_numpy() for name in ("Mach", "altitude")))
        rows = rows.with_columns(pl.Series("through_air", through).fill_nan(None))
    speed = [pl.col(name) for name in ("groundspeed", "TAS", "through_air") if name in rows.columns]
    none = pl.lit(None, pl.Float64)
    ias = pl.col("IAS") if "IAS" in rows.columns else none.alias("IAS")
    return rows.select(
        "flight_id",
        "timestamp",
        "altitude",
        "vertical_rate",
        ias,
        (pl.coalesce(*speed) if speed else none).alias("speed"),
    )


def _descents(rows: pl.DataFrame) -> pl.DataFrame:
    """Rows after the top of descent of flights that lose enough height, down to the bottom."""
    altitude, flight = pl.col("altitude"), "flight_id"
    highest = altitude.max().over(flight)
    last = pl.col("timestamp").filter(altitude >= highest - TOP_FT).max().over(flight)
    # Of what comes after: a climb begins low as well.
    after = rows.with_columns(top_ft=highest).filter(pl.col("timestamp") >= last)
    lost = pl.col("top_ft") - altitude.min().over(flight)
    kept = after.filter((lost >= LEAST_DESCENT_FT) & (altitude >= BOTTOM_FT))
    seconds = pl.col("timestamp").diff().over(flight).dt.total_microseconds() / 1e6
    flown = (pl.col("speed") + pl.col("speed").shift()) / 2 * seconds / 3600
    return kept.with_columns(seconds=seconds, flown=flown)


def _runs(descent: pl.DataFrame, flag: pl.Expr, kind: str, gap_s: float) -> pl.DataFrame:
    """Stretches of neighbouring rows with a flag."""
    new_flight = (pl.col("flight_id") != pl.col("flight_id").shift()).fill_null(True)
    gap = pl.col("seconds").fill_null(0.0) > gap_s
    begins = flag & (~flag.shift(fill_value=False) | gap | new_flight)
    runs = descent.with_columns(flag.alias("flag")).with_columns(begins.cum_sum().alias("run"))
    inside = pl.int_range(pl.len()).over("run") > 0
    return (
        runs.filter("flag")
        .with_columns(seconds=pl.when(inside).then("seconds"), flown=pl.when(inside).then("flown"))
        .group_by("flight_id", "run", maintain_order=True)
        .agg(
            pl.lit(kind).alias("kind"),
            pl.col("timestamp").first(),
            pl.col("seconds").sum(),
            interval_s=pl.col("seconds").median(),
            altitude_ft=pl.col("altitude").mean(),
            distance_nm=pl.when(pl.col("speed").is_not_null().all()).then(pl.col("flown").sum()),
            IAS=pl.col("IAS").mean(),
            IAS_change=pl.col("IAS").drop_nulls().last() - pl.col("IAS").drop_nulls().first(),
            end=pl.col("timestamp").last(),
            top_ft=pl.col("top_ft").first(),
        )
        .drop("run")
    )


def by_flight(segments: pl.DataFrame) -> pl.DataFrame:
    """Level flight of each flight that descends.

    Args:
        segments: Of :func:`stretches`; the fuel of level segments may be there
            (:mod:`descentflow.measurements.level_fuel`).

    Returns:
        One row for each flight: ``flight_id segments level_s distance_nm descent_s interval_s lowest_ft held_s``, and
        the sums of ``fuel_kg`` and ``idle_fuel_kg`` where the segments have them. Zeros where its descent is
        continuous, missing where a segment's is, or where reports are too rare for a held rate; ``lowest_ft`` is the
        altitude of the lowest level segment.

    Example:
        >>> flights = by_flight(stretches(pl.read_parquet("rows.parquet")))
        >>> len(flights), bool((flights["level_s"] < flights["descent_s"]).all())
        (120, True)
    """
    level, seconds = pl.col("kind") == "level", pl.col("seconds")
    interval = pl.col("interval_s").filter(pl.col("kind") == "descent").first()

    def known(name: str) -> pl.Expr:
        value = pl.col(name).filter(level)
        return pl.when(value.is_not_null().all()).then(value.sum()).alias(name)

    return segments.group_by("flight_id", maintain_order=True).agg(
        *([pl.col("typecode").first()] if "typecode" in segments.columns else []),
        level.sum().cast(pl.Int64).alias("segments"),
        seconds.filter(level).sum().alias("level_s"),
        known("distance_nm"),
        seconds.filter(pl.col("kind") == "descent").sum().alias("descent_s"),
        interval.alias("interval_s"),
        pl.col("altitude_ft").filter(level).min().alias("lowest_ft"),
        pl.when(interval < RARE_S).then(seconds.filter(pl.col("kind") == "held").sum()).alias("held_s"),
        *(known(name) for name in ("fuel_kg", "idle_fuel_kg") if name in segments.columns),
    )


def note_level_flight(stretches_flown: pl.DataFrame, report: DropReport) -> None:
    """Count flights that descend, those without level flight, seconds level by altitude, and seconds at held rates."""
    level, descents = stretches_flown.filter(kind="level"), stretches_flown.filter(kind="descent")
    flights = descents.height
    report.note(FLIGHTS, flights)
    report.note(CONTINUOUS, flights - level["flight_id"].n_unique())
    report.note("level segments in descents", len(level))
    bands = level.group_by((pl.col("altitude_ft") // BAND_FT).cast(pl.Int64).alias("band")).agg(pl.col("seconds").sum())
    for band, seconds in bands.sort("band").iter_rows():
        report.note(f"{IN_BAND}{band * BAND_FT // 100:03d}", round(seconds))
    report.note(HELD, round(stretches_flown.filter(kind="held")["seconds"].sum()))
    report.note(RARE, int((descents["interval_s"] >= RARE_S).sum()))


def side_by_side(sides: Mapping[str, Mapping[str, int]]) -> pl.DataFrame:
    """Level flight of several sets of flights by altitude, from the notes of their reports.

    Args:
        sides: Name of a set -> notes of its report; one that does not count flights is left out.

    Returns:
        ``side flights continuous low_ft level_s``: flights, the share of them without level flight, and the mean
        seconds of a flight that are level in the band of 5,000 ft from ``low_ft`` up.

    Example:
        >>> side_by_side({"radar": {FLIGHTS: 4, CONTINUOUS: 1, f"{IN_BAND}050": 200}}).rows()
        [('radar', 4, 0.25, 5000, 50.0)]
    """
    counted = {name: notes for name, notes in sides.items() if notes.get(FLIGHTS)}
    bands = sorted({note.removeprefix(IN_BAND) for notes in counted.values() for note in notes if IN_BAND in note})
    rows = [
        (name, n, notes.get(CONTINUOUS, 0) / n, 100 * int(band), notes.get(f"{IN_BAND}{band}", 0) / n)
        for name, notes in counted.items()
        for n in [notes[FLIGHTS]]
        for band in bands or ["000"]
    ]
    kinds = {
        "side": pl.String,
        "flights": pl.Int64,
        "continuous": pl.Float64,
        "low_ft": pl.Int64,
        "level_s": pl.Float64,
    }
    return pl.DataFrame(rows, schema=kinds, orient="row")
