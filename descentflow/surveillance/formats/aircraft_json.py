"""The `aircraft.json` snapshots that dump1090-fa, readsb and tar1090 serve, and answers of version 2 of the open APIs.

The APIs (adsb.lol, airplanes.live, adsbexchange) name the list `ac` and give `now` in milliseconds. The JSON output of
readsb is one aircraft a line, each with a `now` of its own. Snapshots of one receiver come with the package.
"""

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import polars as pl

from descentflow.core.errors import DataError
from descentflow.surveillance.formats.json_rows import Kinds, is_number, table
from descentflow.surveillance.rows.drop_report import DropReport

NUMBER_FIELDS = {
    "altitude": "alt_baro",
    "vertical_rate": "baro_rate",
    "geometric_rate": "geom_rate",
    "IAS": "ias",
    "Mach": "mach",
    "TAS": "tas",
    "groundspeed": "gs",
    "track": "track",
    "heading": "mag_heading",
    "roll": "roll",
    "geoaltitude": "alt_geom",
    "latitude": "lat",
    "longitude": "lon",
    "temperature": "oat",
    "wind_direction": "wd",
    "wind_speed": "ws",
    "selected_altitude": "nav_altitude_mcp",
}
"""Row column -> field of an aircraft in a snapshot; `heading` is magnetic, `oat` in degrees Celsius."""
TEXT_FIELDS = {"icao24": "hex", "callsign": "flight", "typecode": "t"}
MILLISECONDS = 1e11
"""Larger numbers cannot be seconds since 1970 before the year 5138."""
MAX_HELD_AIRCRAFT = 50_000
"""Aircraft that are held as JSON at a time."""


def is_snapshot(document: object) -> bool:
    """Test for a JSON document that looks like a snapshot, of a receiver or of an open API."""
    if not isinstance(document, dict):
        return False
    return "aircraft" in document or document.keys() >= {"ac", "now"} or document.keys() >= {"hex", "now"}


def rows(documents: Iterable[object], label: str, report: DropReport, block_rows: int) -> Iterator[pl.DataFrame]:
    """One row per aircraft and snapshot, with the time of its last message (`now` minus `seen`).

    Aircraft on the ground have the word "ground" for an altitude; it becomes missing, and the row is dropped and
    counted later, like those of aircraft that report no airspeed.
    """
    times: list[float] = []
    waiting: list[dict[str, Any]] = []
    any_snapshot = False
    for snapshot in documents:
        single = [snapshot] if isinstance(snapshot, dict) and "hex" in snapshot else None
        aircraft = snapshot.get("aircraft", snapshot.get("ac", single)) if isinstance(snapshot, dict) else None
        if not isinstance(snapshot, dict) or not isinstance(aircraft, list) or not is_number(snapshot.get("now")):
            report.note("JSON documents that are no snapshot with aircraft and time", 1)
            continue
        any_snapshot = True
        objects = [thing for thing in aircraft if type(thing) is dict]
        report.note("aircraft in snapshots that are no object", len(aircraft) - len(objects))
        if any("altitude" in thing and not thing.keys() & {"alt_baro", "ias", "mach"} for thing in objects):
            raise DataError(
                f"{label}: snapshots with `altitude` for `alt_baro`, of a dump1090 that reports no IAS and no Mach",
                expected="snapshots of readsb, dump1090-fa or tar1090, with `ias` and `mach`",
                mend="receive with one of these; what dump1090-mutability and its elders wrote cannot be mended",
            )
        waiting += objects
        now = float(snapshot["now"])
        times += [now / 1000 if now > MILLISECONDS else now] * len(objects)
        if len(waiting) >= min(block_rows, MAX_HELD_AIRCRAFT):
            yield _frame(times, waiting)
            times, waiting = [], []
    if not any_snapshot:
        raise DataError(
            f"{label}: JSON without aircraft and time",
            expected="snapshots with `now` and a list `aircraft`, as dump1090-fa and readsb serve them",
            mend="pass such a file",
        )
    yield _frame(times, waiting)


def _frame(times: list[float], aircraft: list[dict[str, Any]]) -> pl.DataFrame:
    # The word is known, and would slow down the reading of all that have a number there.
    airborne = [thing if thing.get("alt_baro") != "ground" else {**thing, "alt_baro": None} for thing in aircraft]
    return table(airborne, FIELD_KINDS).select(
        (pl.Series(times, dtype=pl.Float64) - pl.col("seen").fill_null(0.0)).alias("timestamp"),
        *(pl.col(field).str.strip_chars().replace("", None).alias(name) for name, field in TEXT_FIELDS.items()),
        *(pl.col(field).alias(name) for name, field in NUMBER_FIELDS.items() if field != "oat"),
        (pl.col("oat") + 273.15).alias("temperature"),
    )


FIELD_KINDS: Kinds = {
    "seen": pl.Float64(),
    **dict.fromkeys(TEXT_FIELDS.values(), pl.String()),
    **dict.fromkeys(NUMBER_FIELDS.values(), pl.Float64()),
}

DATA = Path(__file__).parent / "data"


def embedded_rows() -> Path:
    """Snapshots of a receiver near Bengaluru, 2023: 336 aircraft in 13 sessions, mostly arrivals and departures.

    Example:
        >>> embedded_rows().name
        'dump1090fa_bengaluru_2023.jsonl.gz'
    """
    return DATA / "dump1090fa_bengaluru_2023.jsonl.gz"


def embedded_types() -> pl.DataFrame:
    """Types of those aircraft that could be looked up: columns `icao24 typecode`.

    Example:
        >>> embedded_types().columns
        ['icao24', 'typecode']
    """
    return pl.read_csv(DATA / "bengaluru_typecodes.csv")
