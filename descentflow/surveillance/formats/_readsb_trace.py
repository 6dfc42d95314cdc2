"""The traces that readsb and tar1090 write and adsb.lol publishes: one aircraft and day in a `trace_full_*.json`.

A point is a list: seconds after `timestamp`, latitude, longitude, altitude or "ground", groundspeed, track, flags,
vertical rate, details or null, and since 2022 kind of source, geometric altitude, geometric rate, IAS, roll. Details
are fields of aircraft.json, with every fourth point or so. Source: README-json.md of wiedehopf/readsb.
"""

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import polars as pl

from descentflow.core.errors import DataError
from descentflow.surveillance.formats.json_rows import Kinds, is_number, numbers, table, texts
from descentflow.surveillance.rows.air_data import MACH_COMPUTED, with_mach
from descentflow.surveillance.rows.drop_report import DropReport

STALE, NEW_LEG, GEOMETRIC_RATE, GEOMETRIC_ALTITUDE = 1, 2, 4, 8
"""Bits of a point's flags."""
POINT_VALUES = 14
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
DETAIL_KINDS: Kinds = {"flight": pl.String(), **dict.fromkeys(DETAILS.values(), pl.Float64())}


MACH_OF_POINTS = "trace points whose Mach was computed from IAS and altitude"
"""Note in the report: details, which report Mach, stand with every fourth point."""


@dataclass(frozen=True)
class Trace:
    """One trace as read, to be joined with others: columns of many points cost less than of a few."""

    icao24: object
    typecode: object
    begin: float
    points: list[list[Any]]

    def __len__(self) -> int:
        """Number of points."""
        return len(self.points)


def is_trace(document: object) -> bool:
    """Test for a JSON document that looks like a trace."""
    return isinstance(document, dict) and "trace" in document


def rows(documents: Iterator[object], label: str, report: DropReport, block_rows: int) -> Iterator[Trace]:
    """Traces for :func:`joined`."""
    for document in documents:
        trace = document.get("trace") if isinstance(document, dict) else None
        if not isinstance(document, dict) or not isinstance(trace, list) or not is_number(document.get("timestamp")):
            raise DataError(
                f"{label}: JSON without a trace and its time",
                expected="`icao`, `timestamp` and a list `trace`, as readsb and adsb.lol write them",
                mend="pass such a file",
            )
        points = [point for point in trace if type(point) is list and len(point) >= MIN_POINT_VALUES]
        report.note("trace points that are no list of 9 values or more", len(trace) - len(points))
        yield Trace(document.get("icao"), document.get("t"), float(document["timestamp"]), points)


def joined(traces: Sequence[Trace], report: DropReport) -> pl.DataFrame:
    """Rows of whole traces without those of a stale position; each leg is a flight of its own."""
    frame = _columns(traces)
    barometric = pl.when(~_has(GEOMETRIC_ALTITUDE)).then(pl.col("_altitude"))
    geometric = pl.when(_has(GEOMETRIC_ALTITUDE)).then(pl.col("_altitude"))
    rate = pl.when(~_has(GEOMETRIC_RATE)).then(pl.col("_rate"))
    geometric_rate = pl.when(_has(GEOMETRIC_RATE)).then(pl.col("_rate"))
    frame = frame.with_columns(
        altitude=barometric,
        geoaltitude=pl.coalesce("geoaltitude", "_geoaltitude", geometric),
        vertical_rate=pl.coalesce(rate, "vertical_rate"),
        geometric_rate=pl.coalesce("geometric_rate", "_geometric_rate", geometric_rate),
        IAS=pl.coalesce("IAS", "_IAS"),
        roll=pl.coalesce("roll", "_roll"),
        temperature=pl.col("temperature") + 273.15,
        track=pl.when(pl.col("_altitude").is_not_null()).then(pl.col("track")),  # on the ground it is a heading
    )
    fresh = _by_leg(frame).filter(~_has(STALE))
    report.note("trace points with a stale position, left out", len(frame) - len(fresh))
    return with_mach(fresh, report, MACH_OF_POINTS if fresh["Mach"].count() else MACH_COMPUTED)


def _columns(traces: Sequence[Trace]) -> pl.DataFrame:
    """Values of the points, with those of their details next to them."""
    points = list(itertools.chain.from_iterable(trace.points for trace in traces))
    columns: list[Any] = [*itertools.islice(itertools.zip_longest(*points), POINT_VALUES)]
    columns += [[None] * len(points)] * (POINT_VALUES - len(columns))
    columns[ALTITUDE] = [None if value == "ground" else value for value in columns[ALTITUDE]]
    lengths = np.array([len(trace) for trace in traces], dtype=np.int64)
    whole = pl.DataFrame(
        {
            "icao24": texts([trace.icao24 for trace in traces]),
            "typecode": texts([trace.typecode for trace in traces]),
            "begin": numbers([trace.begin for trace in traces]),
        }
    )[np.repeat(np.arange(len(traces)), lengths)]
    begins = np.zeros(len(points), dtype=bool)
    begins[(np.cumsum(lengths) - lengths)[lengths > 0]] = True
    details = [(place, value) for place, value in enumerate(columns[DETAIL]) if type(value) is dict]
    detailed = table([value for _, value in details], DETAIL_KINDS).select(
        pl.Series([place for place, _ in details], dtype=pl.UInt32).alias("place"),
        pl.col("flight").str.strip_chars().replace("", None).alias("callsign"),
        *(pl.col(field).alias(name) for name, field in DETAILS.items()),
    )
    flags = numbers(columns[FLAGS])
    own = pl.DataFrame({name: numbers(columns[place]) for name, place in POINT_PLACES.items()})
    return (
        pl.concat([whole, own], how="horizontal")
        .with_columns(
            timestamp=pl.col("begin") + numbers(columns[0]),
            begins=pl.Series(begins),
            flags=pl.when(flags.is_between(0, 255)).then(flags).fill_null(0).cast(pl.Int64),
        )
        .with_row_index("place")
        .join(detailed, on="place", how="left", maintain_order="left")
        .drop("place", "begin")
    )


ALTITUDE, FLAGS, DETAIL = 3, 6, 8
MIN_POINT_VALUES = 9
POINT_PLACES = {
    "latitude": 1,
    "longitude": 2,
    "_altitude": ALTITUDE,
    "groundspeed": 4,
    "track": 5,
    "_rate": 7,
    "_geoaltitude": 10,
    "_geometric_rate": 11,
    "_IAS": 12,
    "_roll": 13,
}
"""Positions of the numbers in a point; names with an underscore are combined with others."""


def _has(bit: int) -> pl.Expr:
    return (pl.col("flags") & bit) != 0


def _by_leg(frame: pl.DataFrame) -> pl.DataFrame:
    """Name each leg by address and time of its first point; a callsign is valid until the next one of its leg."""
    legs = frame.with_columns(leg=(pl.col("begins") | _has(NEW_LEG)).cast(pl.Int64).cum_sum())
    begin = pl.col("timestamp").first()
    first = pl.from_epoch(pl.when(begin.is_between(0, 1e10)).then(begin).cast(pl.Int64)).dt.strftime("%Y%m%dT%H%M%S")
    return legs.with_columns(
        flight_id=(pl.col("icao24") + "_" + first).over("leg"),
        callsign=pl.col("callsign").forward_fill().over("leg"),
    )
