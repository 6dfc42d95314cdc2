"""Raw Mode S: JSON lines of jet1090, and lines or tables of times and frames in hexadecimal digits."""

import itertools
import re
from collections.abc import Iterable, Iterator
from typing import Any

import polars as pl

from descentflow.core.errors import DataError
from descentflow.core.tabular import optional_library
from descentflow.surveillance.formats import mode_s
from descentflow.surveillance.formats.json_rows import is_number
from descentflow.surveillance.rows.drop_report import DropReport
from descentflow.surveillance.rows.times import in_seconds, timestamps
from descentflow.surveillance.unpacking.streams import Input

BATCH = 100_000
"""Messages that are joined at a time."""
FRAME = r"^[0-9a-fA-F]{14}(?:[0-9a-fA-F]{14})?$"
WHOLE = re.compile(FRAME)
LINE = re.compile(rb"^\s*\"?(\d+(?:\.\d*)?)\"?[\s,;]+\"?\*?((?:[0-9a-fA-F]{14}){1,2});?\"?\s*$")
"""A time in seconds since 1970 and a frame, with blanks, a comma or a semicolon between them; a `*` and `;` around the
frame are AVR's."""
MADE_BY = "lines `seconds frame` or `seconds,frame`, seconds since 1970 and frames of 14 or 28 hexadecimal digits"


def is_message(document: object) -> bool:
    """Test for a JSON document that looks like a line of jet1090."""
    return isinstance(document, dict) and "timestamp" in document and bool(document.keys() & {"frame", "df"})


def jet1090(documents: Iterator[object], label: str, report: DropReport, block_rows: int) -> Iterator[pl.DataFrame]:
    """Rows of jet1090's lines: as decoded by the receiver, or decoded here where a line has only time and frame."""

    def batches() -> Iterator[pl.DataFrame]:
        while some := list(itertools.islice(documents, BATCH)):
            messages = [m for m in some if isinstance(m, dict) and is_number(m.get("timestamp"))]
            report.note("lines that are no message with a time", len(some) - len(messages))
            done = [m for m in messages if "df" in m]
            if len(done) < len(messages):
                rest = [m for m in messages if "df" not in m]
                raw = [m for m in rest if isinstance(m.get("frame"), str) and WHOLE.fullmatch(m["frame"])]
                report.note("lines without fields or a frame of 14 or 28 hexadecimal digits", len(rest) - len(raw))
                done += decoded([m["frame"] for m in raw], [float(m["timestamp"]) for m in raw], report)
            yield mode_s.columns_of(done)

    yield from mode_s.rows(batches(), report)


def lines(source: Input, report: DropReport, block_rows: int) -> Iterator[pl.DataFrame]:
    """Rows of lines of time and frame."""

    def batches() -> Iterator[pl.DataFrame]:
        read = (line for _, line in source.lines())
        first = True
        while batch := list(itertools.islice(read, BATCH)):
            parts = [match.groups() for line in batch if (match := LINE.match(line))]
            if first and len(parts) < len(batch) / 2:
                raise DataError(
                    f"{source.label}: {len(batch) - len(parts)} of the first {len(batch)} lines are no time and frame",
                    expected=MADE_BY,
                    mend="write such lines, for instance with jet1090, readsb or dump1090 and a clock",
                )
            header = first and not LINE.match(batch[0])  # names of columns
            first = False
            report.note("lines that are no time and frame", len(batch) - len(parts) - header)
            frames = [frame.decode() for _, frame in parts]
            yield mode_s.columns_of(decoded(frames, [float(time) for time, _ in parts], report))

    yield from mode_s.rows(batches(), report)


def is_table(table: pl.DataFrame) -> bool:
    """Test for a table of times and undecoded frames, as OpenSky's replies and traffic's raw data are."""
    decoded_already = {name.lower() for name in table.columns} >= {"ias", "mach"}
    return not decoded_already and bool(_column(table, TIMES)) and bool(_column(table, FRAMES))


def of_tables(tables: Iterable[pl.DataFrame], report: DropReport) -> Iterator[pl.DataFrame]:
    """Rows of tables of times and frames."""

    def batches() -> Iterator[pl.DataFrame]:
        for table in tables:
            time = timestamps(table[_column(table, TIMES)]).dt.epoch("us").cast(pl.Float64) / 1e6
            both = pl.DataFrame({"time": time, "frame": table[_column(table, FRAMES)].cast(pl.String)})
            usable = both.filter(pl.col("frame").str.contains(FRAME) & pl.col("time").is_not_null())
            report.note("rows without a time and a Mode S frame", len(both) - len(usable))
            for part in usable.iter_slices(BATCH):
                yield mode_s.columns_of(decoded(part["frame"].to_list(), part["time"].to_list(), report))

    yield from mode_s.rows(batches(), report)


TIMES = ("mintime", "timestamp", "time")
FRAMES = ("rawmsg", "frame")
"""Names of the columns in OpenSky's tables, and in traffic's."""


def _column(table: pl.DataFrame, names: tuple[str, ...]) -> str:
    return next((name for name in names if name in table.columns), "")


def decoded(frames: list[str], times: list[float], report: DropReport) -> list[dict[str, Any]]:
    """Messages of frames whose parity is right."""
    decode = optional_library("rs1090", "modes").decode
    if not frames:
        return []
    # The decoder pairs positions by time in seconds, and would not survive other digits than those looked at.
    seconds = pl.DataFrame({"time": times}).select(in_seconds(pl.col("time"))).to_series().to_list()
    messages: list[Any] = decode(frames, seconds)
    report.note("Mode S frames that could not be decoded (parity or format)", len(frames) - len(messages))
    return messages


def begins_with_frames(head: bytes) -> bool:
    """Test for text that begins with lines of time and frame, under a line of names or not."""
    first = [line for line in head.splitlines()[:4] if line.strip()]
    return any(LINE.match(line) for line in first[:2])
