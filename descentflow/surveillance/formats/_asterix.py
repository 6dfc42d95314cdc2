"""ASTERIX categories 062 (tracks of a tracker) and 048 (plots of one radar), as data blocks one after the other.

The bytes are decoded by pyasteryx, after EUROCONTROL's specifications. IAS and Mach come in I062/380, or in register
6,0 of I048/250. A message has a time of day and no date: that is taken from the file's name, as in
`2024-03-01_radar.ast` or `240301-radar.ast`.
"""

import cmath
import re
from collections.abc import Callable, Iterator
from contextlib import suppress
from datetime import UTC, date, datetime, time
from math import nan
from typing import Any

import polars as pl

from descentflow.core.errors import DataError
from descentflow.core.tabular import optional_library
from descentflow.core.units import KT_MPS
from descentflow.surveillance.formats.json_rows import numbers, texts
from descentflow.surveillance.rows.drop_report import DropReport
from descentflow.surveillance.unpacking import Input

REGISTERS: dict[tuple[int, int], dict[str, tuple[int, int | None, int, int, float]]] = {
    (4, 0): {"selected_altitude": (1, None, 2, 12, 16.0)},
    (5, 0): {
        "roll": (1, 2, 3, 9, 45 / 256),
        "track": (12, 13, 14, 10, 90 / 512),
        "groundspeed": (24, None, 25, 10, 2.0),
        "TAS": (46, None, 47, 10, 2.0),
    },
    (6, 0): {
        "heading": (1, 2, 3, 10, 90 / 512),
        "IAS": (13, None, 14, 10, 1.0),
        "Mach": (24, None, 25, 10, 2.048 / 512),
        "vertical_rate": (35, 36, 37, 9, 32.0),
    },
}
"""Register -> row column -> status bit, sign bit, first bit, number of bits, and unit."""


def values_of(register: tuple[int, int], content: int) -> dict[str, float]:
    """Values of a register: track and heading from 0 to 360 degrees, a selected altitude in whole 100 ft.

    The last is selected in hundreds of feet and sent in steps of 16.
    """
    values = {}
    for name, (status, sign, first, count, unit) in REGISTERS.get(register, {}).items():
        if not _bits(content, status, 1):
            continue
        number = _bits(content, first, count)
        if sign is not None and _bits(content, sign, 1):
            number -= 1 << count
        value = number * unit
        if name in ("track", "heading"):
            value %= 360
        values[name] = round(value, -2) if name == "selected_altitude" else value
    return values


def _bits(content: int, first: int, count: int) -> int:
    """Bits of the 56, numbered from 1."""
    return content >> (57 - first - count) & ((1 << count) - 1)


HEADER_BYTES = 3
"""Bytes of a block's category and length."""
KNOWN_CATEGORIES = frozenset({1, 2, 4, 8, 10, 11, 19, 20, 21, 23, 34, 48, 62, 63, 65, 240, 247})
"""Categories that occur in recordings of radars and trackers."""
MAX_BLOCK_BYTES = 0x1FFF
"""Longer blocks do not fit into the packets that they are sent in; text read as a block would be longer."""
CATEGORIES_READ = frozenset({48, 62})
DAY_PATTERNS = (
    ("", re.compile(r"(?<!\d)((?:19|20)\d\d)[-_.]?(\d\d)[-_.]?(\d\d)(?=(?:\d{6})?(?!\d))")),
    ("20", re.compile(r"(?<!\d)(\d\d)(\d\d)(\d\d)(?!\d)")),
)
"""Century and pattern of a day in a name, eight digits before six; a time may follow the eight at once."""
NO_DAY = date(1970, 1, 1)
WITHOUT_DAY = "files of ASTERIX without a day in their name, put on 1970-01-01"
"""Note in the report."""
FIRST_YEAR = 2004
"""Year of the first enhanced surveillance: six digits of before are a number."""
HALF_DAY_S = 43_200.0
TEXT_COLUMNS = ("icao24", "callsign")
TRACK_PLACES = {
    "icao24": ("I062/380", "ADR", "ADR"),
    "callsign": ("I062/380", "ID", "ACID"),
    "altitude": ("I062/136", "MFL"),
    "vertical_rate": ("I062/380", "BVR", "BVR"),
    "IAS": ("I062/380", "IAR", "IAS"),
    "Mach": ("I062/380", "MAC", "MNO"),
    "TAS": ("I062/380", "TAS", "TAS"),
    "heading": ("I062/380", "MHG", "MAH"),
    "roll": ("I062/380", "RAN", "RAN"),
    "latitude": ("I062/105", "Lat"),
    "longitude": ("I062/105", "Lon"),
    "selected_altitude": ("I062/380", "SAL", "Alt"),
    "geometric_rate": ("I062/380", "GVR", "GVR"),
}
"""Row column -> its place in a message of category 062."""
PLOT_PLACES = {
    "icao24": ("I048/220", "ACAddr"),
    "callsign": ("I048/240", "TId"),
    "groundspeed": ("I048/200", "CGS"),
    "track": ("I048/200", "CHdg"),
}
"""The same of category 048, whose altitude may be garbled."""
WEATHER_NAMES = {"wind_direction": "WD", "wind_speed": "WS", "temperature": "TMP"}
"""Row column -> its name in I062/380/MET, the temperature in degrees Celsius."""
ROW_COLUMNS = tuple(dict.fromkeys((*TRACK_PLACES, *PLOT_PLACES, *WEATHER_NAMES)))

Row = dict[str, Any]


def rows(source: Input, report: DropReport, block_rows: int) -> Iterator[pl.DataFrame]:
    """Rows of the messages of both categories that name an aircraft; others are counted."""
    decode = _decoder()
    categories = set[int]()
    clock = _Clock(_day(source.label))
    waiting: list[Row] = []
    seconds: list[float | None] = []
    for content in _blocks(source, report, categories):
        for row, of_day in _rows_of_block(content, decode, report):
            waiting.append(row)
            seconds.append(clock.seconds(of_day))
        if len(waiting) >= block_rows:
            yield _frame(waiting, seconds)
            waiting, seconds = [], []
    if not categories & CATEGORIES_READ:
        raise DataError(
            f"{source.label}: ASTERIX without airspeeds, of category "
            f"{' and '.join(f'{category:03}' for category in sorted(categories))} alone",
            expected="category 062 with IAS and Mach (I062/380), or 048 with register 6,0 (I048/250)",
            mend="record the tracks (062) or the Mode S radar's plots (048)",
        )
    yield _frame(waiting, seconds)
    report.note(WITHOUT_DAY, int(clock.day == NO_DAY))


def _decoder() -> Callable[[bytes], list[Any]]:
    decode: Callable[[bytes], list[Any]] = optional_library("pyasteryx", "asterix").Decoder().decode
    return decode


def _blocks(source: Input, report: DropReport, categories: set[int]) -> Iterator[bytes]:
    """Blocks of both categories; all that occur are added to the set."""
    place = 0
    while header := source.stream.read(HEADER_BYTES):
        length = int.from_bytes(header[1:], "big")
        if len(header) == HEADER_BYTES and length < HEADER_BYTES:
            raise DataError(
                f"{source.label}: an ASTERIX block of length {length} at byte {place}",
                expected="blocks of category, length and records, one after the other",
                mend="take the blocks out of the recording's own frames, or copy the file again",
            )
        body = source.stream.read(max(length - HEADER_BYTES, 0))
        if len(header) + len(body) < length or len(header) < HEADER_BYTES:
            report.note("ASTERIX blocks cut at the end of a file", 1)
            return
        place += length
        categories.add(header[0])
        if header[0] in CATEGORIES_READ:
            yield header + body
        else:
            report.note("ASTERIX blocks of other categories", 1)


def _rows_of_block(
    content: bytes, decode: Callable[[bytes], list[Any]], report: DropReport
) -> Iterator[tuple[Row, float]]:
    from pyasteryx import AsteryxError

    try:
        messages = decode(content)
    except (AsteryxError, ValueError, IndexError, KeyError):
        report.note("ASTERIX blocks that could not be decoded", 1)
        return
    for message in messages:
        items = message.items if isinstance(message.items, dict) else dict(message)
        row, of_day = _of_track(items) if message.category == 62 else _of_plot(items)
        if row.get("icao24") and of_day is not None:
            yield row, float(of_day)
        else:
            report.note("ASTERIX messages without an aircraft's address or a time", 1)


def _of_track(items: Row) -> tuple[Row, float | None]:
    """A row of category 062."""
    row = {name: _at(items, *path) for name, path in TRACK_PLACES.items()}
    if row["vertical_rate"] is None:
        row["vertical_rate"] = _at(items, "I062/220", "RoC")
    row["groundspeed"], row["track"] = _polar(_at(items, "I062/185", "Vx"), _at(items, "I062/185", "Vy"))
    # Wind and temperature have a bit each that says whether they are there.
    weather = _at(items, "I062/380", "MET") or {}
    row |= {name: weather.get(f"{field}_D") for name, field in WEATHER_NAMES.items() if weather.get(field)}
    return row, _at(items, "I062/070", "ToT")


def _of_plot(items: Row) -> tuple[Row, float | None]:
    """A row of category 048, without a position: range and azimuth are from a radar of unknown place."""
    row = {name: _at(items, *path) for name, path in PLOT_PLACES.items()}
    level = items.get("I048/090", {})
    if level.get("FL") is not None and not level.get("V") and not level.get("G"):
        row["altitude"] = 100 * level["FL"]
    for register in items.get("I048/250", []):
        row |= values_of((register["BDS1"], register["BDS2"]), int(register["MB"], 16))
    return row, _at(items, "I048/140", "ToD")


def _at(items: Row, *path: str) -> Any:
    """Value at a place in a message; None where anything on the way to it is missing."""
    for name in path[:-1]:
        items = items.get(name, {})
    return items.get(path[-1])


def _polar(east_mps: float | None, north_mps: float | None) -> tuple[float | None, float | None]:
    """Speed in kt and direction in degrees."""
    if east_mps is None or north_mps is None:
        return None, None
    velocity = complex(north_mps, east_mps)
    return abs(velocity) / KT_MPS, cmath.phase(velocity) * 180 / cmath.pi % 360


class _Clock:
    """Seconds since 1970 of times of day, across midnight."""

    def __init__(self, day: date) -> None:
        self.day = day
        self._midnight = datetime.combine(day, time(), UTC).timestamp()
        self._last = nan  # no time is before or after it

    def seconds(self, of_day: float) -> float:
        if of_day < self._last - HALF_DAY_S:
            self._midnight += 2 * HALF_DAY_S
        late = of_day > self._last + HALF_DAY_S and self._midnight > 0
        if late:  # a message from before midnight that came after it
            return self._midnight - 2 * HALF_DAY_S + of_day
        self._last = of_day
        return self._midnight + of_day


def _day(label: str) -> date:
    name = label.rpartition("/")[2]
    for century, year, month, day in (
        (century, *written) for century, days in DAY_PATTERNS for written in days.findall(name)
    ):
        with suppress(ValueError):
            written = date(int(century + year), int(month), int(day))
            if written.year >= FIRST_YEAR:
                return written
    return NO_DAY


def _frame(waiting: list[Row], seconds: list[float | None]) -> pl.DataFrame:
    columns = {
        name: (texts if name in TEXT_COLUMNS else numbers)([row.get(name) for row in waiting]) for name in ROW_COLUMNS
    }
    return pl.DataFrame({"timestamp": numbers(seconds), **columns}).with_columns(pl.col("temperature") + 273.15)


def is_asterix(head: bytes) -> bool:
    """Test for a file that begins with whole blocks of known categories: three, or fewer with 048 or 062 among them.

    What follows does not matter, so that damage is reported as damage.
    """
    place, seen = 0, list[int]()
    while place + HEADER_BYTES <= len(head):
        category, length = head[place], int.from_bytes(head[place + 1 : place + HEADER_BYTES], "big")
        if category not in KNOWN_CATEGORIES or not HEADER_BYTES < length <= MAX_BLOCK_BYTES:
            return len(seen) > 2
        seen.append(category)
        place += length
    return len(seen) > 2 or bool(CATEGORIES_READ & set(seen))
