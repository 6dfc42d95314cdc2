"""The `aircraft.json` snapshots that dump1090-fa, readsb and tar1090 serve."""

from collections.abc import Iterable, Iterator
from pathlib import Path

import polars as pl

from descentflow.errors import DataError
from descentflow.surveillance.report import DropReport
from descentflow.surveillance.sources.streams import Input

FIELDS = {
    "icao24": "hex",
    "callsign": "flight",
    "typecode": "t",
    "altitude": "alt_baro",
    "vertical_rate": "baro_rate",
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
    "oat": "oat",
}
"""Row column -> field of an aircraft in a snapshot; `heading` is magnetic, `oat` in degrees Celsius."""

TEXT = ("icao24", "callsign", "typecode")


def rows_of_snapshots(snapshots: Iterable[object], path: Path) -> pl.DataFrame:
    """One row for each aircraft of each snapshot, timed at its last message (`now` less `seen`).

    Aircraft on the ground have the word "ground" for an altitude; it becomes missing and the row is dropped and
    counted later, as are aircraft that report no airspeed.

    Raises:
        DataError: If the JSON holds no list of aircraft.
    """
    columns: dict[str, list[object]] = {name: [] for name in ("timestamp", *FIELDS)}
    found = False
    for snapshot in snapshots:
        if not isinstance(snapshot, dict) or not isinstance(snapshot.get("aircraft"), list):
            continue
        now = _number(snapshot.get("now"))
        if now is None:
            continue
        found = True
        for aircraft in snapshot["aircraft"]:
            if not isinstance(aircraft, dict):
                continue
            seen = _number(aircraft.get("seen", 0))
            columns["timestamp"].append(None if seen is None else now - seen)
            for name, field in FIELDS.items():
                columns[name].append(_value(aircraft.get(field), text=name in TEXT))
    if not found:
        raise DataError(
            f"{path}: JSON without aircraft and time",
            expected="snapshots with `now` and a list `aircraft`, as dump1090-fa and readsb serve them",
            mend="pass such a file",
        )
    kinds = {name: pl.String() if name in TEXT else pl.Float64() for name in columns}
    frame = pl.DataFrame(columns, schema=kinds)
    return frame.with_columns((pl.col("oat") + 273.15).alias("temperature")).drop("oat")


def _value(value: object, *, text: bool) -> object:
    if text:
        # JSON may escape half a surrogate pair, which is no text that could be stored.
        return value.encode(errors="replace").decode().strip() or None if isinstance(value, str) else None
    return _number(value)


def _number(value: object) -> float | None:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    try:
        return float(value)
    except OverflowError:  # an integer of more than 308 digits
        return None


def rows(found: Iterable[object], source: Input, report: DropReport, block: int) -> Iterator[pl.DataFrame]:
    """Rows of snapshots, about `block` at a time."""
    waiting: list[object] = []
    aircraft = 0
    for snapshot in found:
        waiting.append(snapshot)
        if isinstance(snapshot, dict) and isinstance(snapshot.get("aircraft"), list):
            aircraft += len(snapshot["aircraft"])
        if aircraft >= block or len(waiting) >= block:
            yield rows_of_snapshots(waiting, Path(source.label))
            waiting, aircraft = [], 0
    if waiting:
        yield rows_of_snapshots(waiting, Path(source.label))
