"""The traces that readsb and tar1090 write and adsb.lol publishes: one aircraft and day in a `trace_full_*.json`.

A point is a list: seconds after `timestamp`, latitude, longitude, altitude or "ground", groundspeed, track, flags,
vertical rate, details or null, and since 2022 kind of source, geometric altitude, geometric rate, IAS, roll.
Details are fields of aircraft.json, with every fourth point or so. Source: README-json.md of wiedehopf/readsb.
"""

import itertools
from collections.abc import Iterator
from typing import Any

import numpy as np
import polars as pl

from descentflow.errors import DataError
from descentflow.surveillance.airdata import mach_of_cas
from descentflow.surveillance.report import DropReport
from descentflow.surveillance.sources.streams import Input
from descentflow.surveillance.sources.values import Kinds, is_number, numbers, table, texts

STALE, NEW_LEG, GEOMETRIC_RATE, GEOMETRIC_ALTITUDE = 1, 2, 4, 8
"""Bits of a point's flags."""
POINT = 14
"""Values of a point."""
DETAILS = {
    "vertical_rate": "baro_rate",
    "geometric_rate": "geom_rate",
    "IAS": "ias",
    "Mach": "mach",
    "TAS": "tas",
    "heading": "mag_heading",
    "roll": "roll",
    "geoaltitude": "alt_geom",
    "temperature": "oat",
    "wind_direction": "wd",
    "wind_speed": "ws",
    "selected_altitude": "nav_altitude_mcp",
}
"""Row column -> field of a point's details."""
KINDS: Kinds = {"flight": pl.String(), **dict.fromkeys(DETAILS.values(), pl.Float64())}


def rows(found: Iterator[object], source: Input, report: DropReport, block: int) -> Iterator[pl.DataFrame]:
    """Points of traces, a table each, for :func:`finished`.

    Raises:
        DataError: If a document is no trace.
    """
    for document in found:
        yield points_of_trace(document, source.label, report)


def points_of_trace(document: object, label: str, report: DropReport) -> pl.DataFrame:
    """Values of a trace's points, column by column, as they are.

    Raises:
        DataError: If the document lacks the address, the time or the list of points.
    """
    trace = document.get("trace") if isinstance(document, dict) else None
    if not isinstance(document, dict) or not isinstance(trace, list) or not is_number(document.get("timestamp")):
        raise DataError(
            f"{label}: JSON without a trace and its time",
            expected="`icao`, `timestamp` and a list `trace`, as readsb and adsb.lol write them",
            mend="pass such a file",
        )
    points = [point for point in trace if type(point) is list and len(point) >= 9]
    report.note("trace points that are no list of 9 values or more", len(trace) - len(points))
    columns: list[Any] = [*itertools.islice(itertools.zip_longest(*points), POINT)]
    columns += [[None] * len(points)] * (POINT - len(columns))
    details = columns[8]
    filled = [place for place, value in enumerate(details) if type(value) is dict]
    objects = [details[place] for place in filled]
    frame = {
        "timestamp": numbers(columns[0]) + float(document["timestamp"]),
        "icao24": _repeated(document.get("icao"), len(points)),
        "typecode": _repeated(document.get("t"), len(points)),
        "flags": numbers(columns[6]),
        **{f"_{name}": numbers(columns[place]) for name, place in PLACES.items()},
    }
    detailed = table(objects, KINDS).with_columns(place=pl.Series(filled, dtype=pl.UInt32))
    return pl.DataFrame(frame).with_row_index("place").join(detailed, on="place", how="left", maintain_order="left")


def finished(points: pl.DataFrame, report: DropReport) -> pl.DataFrame:
    """Rows of the points of whole traces: none with a stale position, and a flight of its own for each leg."""
    barometric = pl.when(~_has(GEOMETRIC_ALTITUDE)).then(pl.col("_altitude"))
    geometric = pl.when(_has(GEOMETRIC_ALTITUDE)).then(pl.col("_altitude"))
    rate = pl.when(~_has(GEOMETRIC_RATE)).then(pl.col("_rate"))
    geometric_rate = pl.when(_has(GEOMETRIC_RATE)).then(pl.col("_rate"))
    bits = pl.when(pl.col("flags").is_between(0, 255)).then(pl.col("flags")).fill_null(0).cast(pl.Int64)
    named = {"callsign": pl.col("flight").str.strip_chars().replace("", None)}
    named |= {name: pl.col(field) for name, field in DETAILS.items()}
    frame = points.with_columns(flags=bits, **named).drop("flight", *(set(DETAILS.values()) - set(DETAILS)))
    frame = frame.with_columns(
        latitude=pl.col("_latitude"),
        longitude=pl.col("_longitude"),
        groundspeed=pl.col("_groundspeed"),
        track=pl.when(pl.col("_altitude").is_not_null()).then(pl.col("_track")),  # on the ground it is a heading
        altitude=barometric,
        geoaltitude=pl.coalesce("geoaltitude", "_geoaltitude", geometric),
        vertical_rate=pl.coalesce(rate, "vertical_rate"),
        geometric_rate=pl.coalesce("geometric_rate", "_geometric_rate", geometric_rate),
        IAS=pl.coalesce("IAS", "_IAS"),
        roll=pl.coalesce("roll", "_roll"),
        temperature=pl.col("temperature") + 273.15,
    )
    fresh = _by_leg(frame).filter(~_has(STALE))
    report.note("trace points with a stale position, left out", len(frame) - len(fresh))
    return _with_mach(fresh, report).drop("place", "flags", "leg", *(f"_{name}" for name in PLACES))


PLACES = {
    "latitude": 1,
    "longitude": 2,
    "altitude": 3,
    "groundspeed": 4,
    "track": 5,
    "rate": 7,
    "geoaltitude": 10,
    "geometric_rate": 11,
    "IAS": 12,
    "roll": 13,
}
"""Where the numbers of a point stand."""


def _repeated(value: object, length: int) -> pl.Series:
    return pl.repeat(texts([value])[0], length, dtype=pl.String, eager=True)


def _has(bit: int) -> pl.Expr:
    return (pl.col("flags") & bit) != 0


def _by_leg(frame: pl.DataFrame) -> pl.DataFrame:
    """Name each leg by address and time of its first point; a callsign holds until the next one of its leg."""
    begins = (pl.col("place") == 0) | _has(NEW_LEG)
    legs = frame.with_columns(leg=begins.cast(pl.Int64).cum_sum())
    begin = pl.col("timestamp").first()
    first = pl.from_epoch(pl.when(begin.is_between(0, 1e10)).then(begin).cast(pl.Int64)).dt.strftime("%Y%m%dT%H%M%S")
    return legs.with_columns(
        flight_id=(pl.col("icao24") + "_" + first).over("leg"),
        callsign=pl.col("callsign").forward_fill().over("leg"),
    )


def _with_mach(frame: pl.DataFrame, report: DropReport) -> pl.DataFrame:
    """Fill in Mach where a point has IAS and pressure altitude, of which it is a function, but no details.

    Only in legs whose details report Mach: there the aircraft is known to answer with both.
    """
    reported = pl.col("Mach").is_not_null().any().over("leg")
    fillable = frame.select(
        reported & pl.col("Mach").is_null() & pl.col("IAS").is_between(40, 500) & pl.col("altitude").is_not_null()
    ).to_series()
    count = int(fillable.sum())
    if not count:
        return frame
    report.note("trace points whose Mach was computed from IAS and altitude", count)
    chosen = frame.filter(fillable)
    mach = mach_of_cas(chosen["IAS"].to_numpy(), chosen["altitude"].to_numpy())
    return frame.with_columns(frame["Mach"].scatter(np.flatnonzero(fillable.to_numpy()), mach))
