"""The kinds of files that can be read, and how each is known by its first bytes."""

import itertools
from collections.abc import Callable, Iterator, Sequence

import polars as pl

from descentflow.core.errors import ConfigError, DataError
from descentflow.surveillance.formats import (
    aircraft_json,
    asterix,
    json_rows,
    mode_s_frames,
    readsb_trace,
    scat,
    tables,
)
from descentflow.surveillance.formats.documents import documents
from descentflow.surveillance.formats.streams import Input
from descentflow.surveillance.rows.drop_report import DropReport

FORMATS = {
    "parquet": "Parquet, as traffic, OpenSky and pandas write it",
    "feather": "Feather (Arrow IPC), as traffic and pandas write it",
    "csv": "CSV with column names and commas",
    "json-rows": "JSON of rows (a list, one a line, or columns), as traffic and pandas write it",
    "readsb-trace": "trace_full_*.json of readsb, tar1090 and adsb.lol",
    "aircraft-json": "snapshots that dump1090-fa, readsb and tar1090 serve, one or one a line",
    "jet1090": "JSON lines of jet1090, decoded or with frames alone",
    "modes-hex": "lines of time (seconds since 1970) and raw Mode S frame in hexadecimal digits",
    "scat": "SCAT, Swedish radar with flight plans and clearances, one flight a file",
    "asterix": "data blocks of ASTERIX categories 048 and 062, the day in the file's name",
}
"""Name -> meaning; each is also known by content, in gzip and in tar archives too."""
ACCEPTED = "one of " + "; ".join(f"{name} ({meaning})" for name, meaning in FORMATS.items())

Rows = pl.DataFrame | readsb_trace.Trace
Reader = Callable[[Input, DropReport, int], Iterator[pl.DataFrame]]
OfDocuments = Callable[[Iterator[object], Input, DropReport, int], Iterator[Rows]]

TABLES: dict[str, Reader] = {"parquet": tables.parquet, "feather": tables.feather, "csv": tables.csv}
JSON: dict[str, OfDocuments] = {
    "json-rows": json_rows.rows,
    "aircraft-json": aircraft_json.rows,
    "readsb-trace": readsb_trace.rows,
    "jet1090": mode_s_frames.jet1090,
    "scat": scat.rows,
}
OTHERS: dict[str, Reader] = {"modes-hex": mode_s_frames.lines, "asterix": asterix.rows}

OF_ANYBODY = frozenset({*TABLES, "json-rows"})
"""Tables of anybody's making: names and units have to be looked at file by file."""
MOST_POINTS = 50_000
"""Points of traces that are held as JSON."""


def put_together(parts: Sequence[Rows], report: DropReport) -> pl.DataFrame:
    """One table of many small ones of one kind."""
    traces = [part for part in parts if isinstance(part, readsb_trace.Trace)]
    return readsb_trace.finished(traces, report) if traces else pl.concat(parts)  # type: ignore[type-var, return-value]


def belongs(part: Rows, waiting: Sequence[Rows], rows: int) -> bool:
    """Whether a part can be put together with those that wait, by kind and number of rows."""
    if not waiting:
        return True
    count = sum(map(len, waiting))
    if isinstance(part, readsb_trace.Trace):
        return isinstance(waiting[0], readsb_trace.Trace) and count < MOST_POINTS
    same = isinstance(waiting[0], pl.DataFrame) and part.schema == waiting[0].schema
    return same and count < rows and len(waiting) < MOST_TABLES


MOST_TABLES = 2000
"""Tables that are put together at once."""


def check_format(name: str | None) -> None:
    """Refuse a format that there is not.

    Raises:
        ConfigError: With those that there are.
    """
    if name is not None and name not in FORMATS:
        raise ConfigError(
            f"no format {name!r}",
            expected=f"one of {', '.join(FORMATS)}",
            mend="name one of these, or none so that the kind of file is found from its content",
        )


def recognised(source: Input, report: DropReport, name: str | None, rows: int) -> tuple[str, Iterator[Rows]]:
    """Name of a file's format, and its rows as it names their columns, in parts of about `rows` rows.

    Raises:
        DataError: If the file is of no known kind or damaged.
    """
    head, source = source.head()
    if not head:
        raise DataError(f"{source.label} is empty", expected=ACCEPTED, mend="check how it was written or copied")
    kind = name or kind_of(head, source.label)
    if kind in TABLES:
        found_tables = TABLES[kind](source, report, rows)
        first_table = next(found_tables)
        chained = itertools.chain([first_table], found_tables)
        if mode_s_frames.is_table(first_table):
            return "modes-hex", mode_s_frames.of_tables(chained, report)
        return kind, chained
    if kind in OTHERS:
        return kind, OTHERS[kind](source, report, rows)
    found = documents(source, report)
    first = next(found, None)
    kind = kind_of_document(first, source.label) if kind == "json" else kind
    return kind, JSON[kind](itertools.chain([first], found), source, report, rows)


MAGIC = {b"PAR1": "parquet", b"ARROW1": "feather"}
REFUSED = {
    b"\x80\x02": ("a pickle", "write the table as Parquet: opening a pickle runs whatever code it holds"),
    b"\x80\x03": ("a pickle", "write the table as Parquet: opening a pickle runs whatever code it holds"),
    b"\x80\x04": ("a pickle", "write the table as Parquet: opening a pickle runs whatever code it holds"),
    b"\x80\x05": ("a pickle", "write the table as Parquet: opening a pickle runs whatever code it holds"),
    b"PK\x03\x04": ("a zip archive", "unpack it and pass the folder"),
    b"BZh": ("bzip2", "unpack it, or pack it with gzip"),
    b"\xfd7zXZ": ("xz", "unpack it, or pack it with gzip"),
    b"\x28\xb5\x2f\xfd": ("zstandard", "unpack it, or pack it with gzip"),
    b"\x89HDF": ("HDF5", "write the table as Parquet"),
    b"FEA1": ("Feather version 1", "write it again as Feather version 2 or Parquet"),
    b"\xd4\xc3\xb2\xa1": ("a capture of network packets", "take the payloads out of the packets first"),
    b"\xa1\xb2\xc3\xd4": ("a capture of network packets", "take the payloads out of the packets first"),
    b"\x0a\x0d\x0d\x0a": ("a capture of network packets", "take the payloads out of the packets first"),
    b"\x1a\x31": ("Beast binary", "write it as lines of time and frame, or as JSON with jet1090"),
    b"\x1a\x32": ("Beast binary", "write it as lines of time and frame, or as JSON with jet1090"),
    b"\x1a\x33": ("Beast binary", "write it as lines of time and frame, or as JSON with jet1090"),
}
"""First bytes -> what is recognised but not read, and what to do about it."""


def kind_of(head: bytes, label: str) -> str:
    """Name of the format that begins so, "json" for all that are JSON.

    Raises:
        DataError: If it is none of these.
    """
    for magic, kind in MAGIC.items():
        if head.startswith(magic):
            return kind
    for magic, (what, mend) in REFUSED.items():
        if head.startswith(magic):
            raise DataError(f"{label} is {what}", expected=ACCEPTED, mend=mend)
    if asterix.looks_so(head):
        return "asterix"
    if b"\0" in head:
        raise DataError(
            f"{label}: neither text nor of a known binary kind", expected=ACCEPTED, mend="convert it to one of these"
        )
    text = head.removeprefix(b"\xef\xbb\xbf").lstrip()
    if not text:
        raise DataError(f"{label} holds no text", expected=ACCEPTED, mend="check how it was written")
    if mode_s_frames.looks_untimed(text):
        raise DataError(
            f"{label}: Mode S frames without the time of each",
            expected=mode_s_frames.MADE_BY,
            mend="record frames with a clock in seconds, for instance with jet1090",
        )
    if text[:1] in (b"{", b"["):
        return "json"
    return "modes-hex" if mode_s_frames.looks_raw(text) else "csv"


def kind_of_document(document: object, label: str) -> str:
    """Name of the JSON format by the first document.

    Raises:
        DataError: If it is none of these.
    """
    known = document if isinstance(document, dict) else {}
    keys = known.keys()
    if "trace" in keys:
        return "readsb-trace"
    if "aircraft" in keys or keys >= {"ac", "now"}:
        return "aircraft-json"
    if "timestamp" in keys and keys & {"frame", "df"}:
        return "jet1090"
    if scat.is_flight(known):
        return "scat"
    if json_rows.looks_so(document):
        return "json-rows"
    raise DataError(
        f"{label}: JSON of no known kind (it has {', '.join(map(str, list(keys)[:8])) or type(document).__name__})",
        expected=ACCEPTED,
        mend="pass such a file",
    )
