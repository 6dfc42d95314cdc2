"""The kinds of files that can be read, and how each is known by its first bytes."""

import itertools
from collections.abc import Callable, Iterator

import polars as pl

from descentflow.errors import ConfigError, DataError
from descentflow.surveillance.report import DropReport
from descentflow.surveillance.sources import aircraft_json, tables
from descentflow.surveillance.sources.documents import documents
from descentflow.surveillance.sources.streams import Input

FORMATS = {
    "parquet": "Parquet, as traffic, OpenSky and pandas write it",
    "feather": "Feather (Arrow IPC), as traffic and pandas write it",
    "csv": "CSV with column names and commas",
    "aircraft-json": "snapshots that dump1090-fa, readsb and tar1090 serve, one or one a line",
}
"""Name -> meaning; each is also known by content, in gzip too."""
ACCEPTED = "one of " + "; ".join(f"{name} ({meaning})" for name, meaning in FORMATS.items())

Reader = Callable[[Input, DropReport, int], Iterator[pl.DataFrame]]
Documents = Callable[[Iterator[object], Input, DropReport, int], Iterator[pl.DataFrame]]

TABLES: dict[str, Reader] = {"parquet": tables.parquet, "feather": tables.feather, "csv": tables.csv}
JSON: dict[str, Documents] = {"aircraft-json": aircraft_json.rows}


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


def read(source: Input, report: DropReport, name: str | None, rows: int) -> Iterator[pl.DataFrame]:
    """Rows as the source names their columns, in parts of about `rows` rows.

    Raises:
        DataError: If the file is of no known kind or damaged.
    """
    head, source = source.head()
    if not head:
        raise DataError(f"{source.label} is empty", expected=ACCEPTED, mend="check how it was written or copied")
    kind = name or kind_of(head, source.label)
    if kind in TABLES:
        yield from TABLES[kind](source, report, rows)
        return
    found = documents(source)
    first = next(found, None)
    kind = kind_of_document(first, source.label) if kind == "json" else kind
    yield from JSON[kind](itertools.chain([first], found), source, report, rows)


def kind_of(head: bytes, label: str) -> str:
    """Name of the format that begins so, "json" for all that are JSON.

    Raises:
        DataError: If it is none of these.
    """
    if head.startswith(b"PAR1"):
        return "parquet"
    if head.startswith(b"ARROW1"):
        return "feather"
    if b"\0" in head:
        raise DataError(
            f"{label}: neither text nor of a known binary kind", expected=ACCEPTED, mend="convert it to one of these"
        )
    text = head.removeprefix(b"\xef\xbb\xbf").lstrip()
    if not text:
        raise DataError(f"{label} holds no text", expected=ACCEPTED, mend="check how it was written")
    return "json" if text[:1] in (b"{", b"[") else "csv"


def kind_of_document(document: object, label: str) -> str:
    """Name of the JSON format by the first document.

    Raises:
        DataError: If it is none of these.
    """
    if isinstance(document, dict) and isinstance(document.get("aircraft"), list):
        return "aircraft-json"
    raise DataError(
        f"{label}: JSON without aircraft and time", expected=ACCEPTED, mend="pass such a file, or name its --format"
    )
