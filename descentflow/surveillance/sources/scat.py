"""SCAT: Swedish en-route radar with flight plans and clearances, one flight in a JSON file.

Plots are ASTERIX category 062 in the units of EUROCONTROL SPEC-0149-9: measured level in hundreds of feet, `ias` in kt,
`baro_vert_rate` in ft/min, magnetic heading in degrees, velocity in m/s. A clearance holds from its time on: `cfl` in
hundreds of feet where its unit is "F", in feet where it is "A"; speeds in "KNOT" (indicated) or "MACH". The aircraft is
not named, so the flight's number stands for its address. Source: Nilsson and Unger, Data in Brief 48 (2023) 109240.
"""

from collections.abc import Iterator
from typing import Any

import polars as pl

from descentflow.errors import DataError
from descentflow.surveillance.report import DropReport
from descentflow.surveillance.sources.streams import Input
from descentflow.surveillance.sources.values import is_number, numbers, texts
from descentflow.units import KT_MPS

AIRCRAFT = {
    "vertical_rate": ("subitem13", "baro_vert_rate"),
    "IAS": ("subitem26", "ias"),
    "Mach": ("subitem27", "mach"),
    "heading": ("subitem3", "mag_hdg"),
    "selected_altitude": ("subitem6", "altitude"),
}
"""Row column -> where it stands in I062/380, what the aircraft itself reports."""
CLEARED = ("cleared_flight_level", "cleared_speed_kt", "cleared_mach")


def rows(found: Iterator[object], source: Input, report: DropReport, block: int) -> Iterator[pl.DataFrame]:
    """Rows of flights, a table each.

    Raises:
        DataError: If a document is no flight.
    """
    for document in found:
        yield rows_of_flight(document, source.label, report)


def rows_of_flight(document: object, label: str, report: DropReport) -> pl.DataFrame:
    """Rows of one flight, with what was cleared at the time.

    Raises:
        DataError: If the document lacks the plots, or has no number for the flight.
    """
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
    reported = [_part(plot, "I062/380") for plot in plots]
    velocity = [_part(plot, "I062/185") for plot in plots]
    position = [_part(plot, "I062/105") for plot in plots]
    east, north = (numbers([v.get(name) for v in velocity]) for name in ("vx", "vy"))
    number = str(document["id"])
    frame = pl.DataFrame(
        {
            "timestamp": texts([plot.get("time_of_track") for plot in plots]),
            "altitude": numbers([_part(plot, "I062/136").get("measured_flight_level") for plot in plots]) * 100,
            **{
                name: numbers([_part(r, item).get(field) for r in reported]) for name, (item, field) in AIRCRAFT.items()
            },
            "latitude": numbers([p.get("lat") for p in position]),
            "longitude": numbers([p.get("lon") for p in position]),
            "east": east,
            "north": north,
        }
    ).with_columns(
        timestamp=_times("timestamp"),
        groundspeed=(pl.col("east") ** 2 + pl.col("north") ** 2).sqrt() / KT_MPS,
        track=pl.arctan2("east", "north").degrees() % 360,
        icao24=pl.lit(f"scat{number}"),
        flight_id=pl.lit(f"scat{number}"),
        callsign=pl.lit(texts([base.get("callsign")])[0], pl.String),
        typecode=pl.lit(texts([base.get("aircraft_type")])[0], pl.String),
    )
    return _with_clearances(frame.drop("east", "north"), plan)


def _with_clearances(frame: pl.DataFrame, plan: object) -> pl.DataFrame:
    """What was cleared last at each plot's time; a clearance without a speed ends the one before."""
    entries = plan.get("fpl_clearance") if isinstance(plan, dict) else None
    given = [entry for entry in entries if type(entry) is dict] if isinstance(entries, list) else []
    clearances = (
        pl.DataFrame(
            {
                "timestamp": texts([entry.get("time_stamp") for entry in given]),
                "level": numbers([entry.get("cfl") for entry in given]),
                "level_unit": texts([entry.get("cfl_unit") for entry in given]),
                "speed": numbers([entry.get("assigned_speed_val") for entry in given]),
                "speed_unit": texts([entry.get("assigned_speed_unit") for entry in given]),
            }
        )
        .with_columns(timestamp=_times("timestamp"))
        .drop_nulls("timestamp")
        .sort("timestamp", maintain_order=True)
        .select(
            "timestamp",
            pl.when(level_unit="F").then("level").when(level_unit="A").then(pl.col("level") / 100).alias(CLEARED[0]),
            pl.when(speed_unit="KNOT").then("speed").alias(CLEARED[1]),
            pl.when(speed_unit="MACH").then("speed").alias(CLEARED[2]),
        )
    )
    timed = frame.with_row_index("_row").drop_nulls("timestamp").sort("timestamp", maintain_order=True)
    cleared = timed.select("_row", "timestamp").join_asof(clearances, on="timestamp").select("_row", *CLEARED)
    return frame.with_row_index("_row").join(cleared, on="_row", how="left", maintain_order="left").drop("_row")


def _times(name: str) -> pl.Expr:
    return (
        pl.col(name).str.to_datetime("%Y-%m-%dT%H:%M:%S%.f", time_unit="us", strict=False).dt.replace_time_zone("UTC")
    )


def _part(thing: dict[str, Any], name: str) -> dict[str, Any]:
    part = thing.get(name)
    return part if isinstance(part, dict) else {}


def _last(plan: object, name: str) -> dict[str, Any]:
    """The last state of a part of the flight plan."""
    states = plan.get(name) if isinstance(plan, dict) else None
    known = [state for state in states if type(state) is dict] if isinstance(states, list) else []
    return known[-1] if known else {}


def is_flight(document: dict[Any, Any]) -> bool:
    """Whether a JSON object looks like a flight of SCAT."""
    return isinstance(document.get("plots"), list) and is_number(document.get("id"))
