"""SCAT: Swedish en-route radar with flight plans and clearances, one flight in a JSON file.

Plots are ASTERIX category 062 in the units of EUROCONTROL SPEC-0149-9: measured level in hundreds of feet, `ias` in kt,
`baro_vert_rate` in ft/min, magnetic heading in degrees, velocity in m/s. A clearance is valid from its time: `cfl` in
hundreds of feet where its unit is "F", in feet where it is "A"; speeds in "KNOT" (indicated) or "MACH". The aircraft is
not named, so the flight's number serves as its address. Source: Nilsson and Unger, Data in Brief 48 (2023) 109240.
"""

from collections.abc import Iterator
from typing import Any

import polars as pl

from descentflow.core.errors import DataError
from descentflow.core.units import KT_MPS
from descentflow.surveillance.formats.json_rows import Kinds, is_number, table, texts
from descentflow.surveillance.rows.drop_report import DropReport

REPORTED = {
    "vertical_rate": ("subitem13", "baro_vert_rate"),
    "IAS": ("subitem26", "ias"),
    "Mach": ("subitem27", "mach"),
    "heading": ("subitem3", "mag_hdg"),
    "selected_altitude": ("subitem6", "altitude"),
}
"""Row column -> its place in I062/380, what the aircraft itself reports."""
NUMBER, TEXT = pl.Float64(), pl.String()
PLOT_KINDS: Kinds = {
    "time_of_track": TEXT,
    "I062/105": pl.Struct({"lat": NUMBER, "lon": NUMBER}),
    "I062/136": pl.Struct({"measured_flight_level": NUMBER}),
    "I062/185": pl.Struct({"vx": NUMBER, "vy": NUMBER}),
    "I062/380": pl.Struct({item: pl.Struct({field: NUMBER}) for item, field in REPORTED.values()}),
}
CLEARANCE_KINDS: Kinds = {
    **dict.fromkeys(("time_stamp", "cfl_unit", "assigned_speed_unit"), TEXT),
    **dict.fromkeys(("cfl", "assigned_speed_val"), NUMBER),
}
CLEARED = ("cleared_flight_level", "cleared_speed_kt", "cleared_mach")


def rows(documents: Iterator[object], label: str, report: DropReport, block_rows: int) -> Iterator[pl.DataFrame]:
    """Rows of flights, a table each."""
    for document in documents:
        yield _rows_of_flight(document, label, report)


def _rows_of_flight(document: object, label: str, report: DropReport) -> pl.DataFrame:
    """Rows of one flight, with the clearances of their time."""
    if not isinstance(document, dict) or not is_flight(document):
        raise DataError(
            f"{label}: JSON without a flight's number and plots",
            expected="`id`, `plots` and `fpl`, as the SCAT data set has them",
            mend="pass such a file",
        )
    plots = [plot for plot in document["plots"] if type(plot) is dict]
    report.note("plots that are no object", len(document["plots"]) - len(plots))
    plan = document.get("fpl")
    base = _last(plan, "fpl_base")
    number = pl.lit(f"scat{document['id']}")
    velocity = pl.col("I062/185").struct
    east, north = velocity.field("vx"), velocity.field("vy")
    frame = table(plots, PLOT_KINDS).select(
        _times("time_of_track").alias("timestamp"),
        (pl.col("I062/136").struct.field("measured_flight_level") * 100).alias("altitude"),
        *(
            pl.col("I062/380").struct.field(item).struct.field(field).alias(name)
            for name, (item, field) in REPORTED.items()
        ),
        pl.col("I062/105").struct.field("lat").alias("latitude"),
        pl.col("I062/105").struct.field("lon").alias("longitude"),
        ((east**2 + north**2).sqrt() / KT_MPS).alias("groundspeed"),
        (pl.arctan2(east, north).degrees() % 360).alias("track"),
        number.alias("icao24"),
        number.alias("flight_id"),
        pl.lit(texts([base.get("callsign")])[0], pl.String).alias("callsign"),
        pl.lit(texts([base.get("aircraft_type")])[0], pl.String).alias("typecode"),
    )
    return _with_clearances(frame, plan)


def _with_clearances(frame: pl.DataFrame, plan: object) -> pl.DataFrame:
    """The last clearance at the time of each plot; one without a speed ends the one before."""
    entries = plan.get("fpl_clearance") if isinstance(plan, dict) else None
    given = [entry for entry in entries if type(entry) is dict] if isinstance(entries, list) else []
    clearances = (
        table(given, CLEARANCE_KINDS)
        .with_columns(timestamp=_times("time_stamp"))
        .drop_nulls("timestamp")
        .sort("timestamp", maintain_order=True)
        .select(
            "timestamp",
            pl.when(cfl_unit="F").then("cfl").when(cfl_unit="A").then(pl.col("cfl") / 100).alias(CLEARED[0]),
            pl.when(assigned_speed_unit="KNOT").then("assigned_speed_val").alias(CLEARED[1]),
            pl.when(assigned_speed_unit="MACH").then("assigned_speed_val").alias(CLEARED[2]),
        )
    )
    timed = frame.with_row_index("_row").drop_nulls("timestamp").sort("timestamp", maintain_order=True)
    cleared = timed.select("_row", "timestamp").join_asof(clearances, on="timestamp").select("_row", *CLEARED)
    return frame.with_row_index("_row").join(cleared, on="_row", how="left", maintain_order="left").drop("_row")


def _times(name: str) -> pl.Expr:
    return (
        pl.col(name).str.to_datetime("%Y-%m-%dT%H:%M:%S%.f", time_unit="us", strict=False).dt.replace_time_zone("UTC")
    )


def _last(plan: object, name: str) -> dict[str, Any]:
    """The last state of a part of the flight plan."""
    states = plan.get(name) if isinstance(plan, dict) else None
    known = [state for state in states if type(state) is dict] if isinstance(states, list) else []
    return known[-1] if known else {}


def is_flight(document: object) -> bool:
    """Test for a JSON document that looks like a flight of SCAT."""
    return isinstance(document, dict) and isinstance(document.get("plots"), list) and is_number(document.get("id"))
