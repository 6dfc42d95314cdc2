"""Tables: Parquet, Feather and CSV, as the `traffic` library, OpenSky and pandas write them."""

import io
from collections.abc import Iterator, Sequence

import polars as pl

from descentflow.core.errors import DataError
from descentflow.core.parquet_pages import check_pages
from descentflow.surveillance.rows._column_names import note_unused
from descentflow.surveillance.rows._normalise import wanted
from descentflow.surveillance.rows.drop_report import DropReport
from descentflow.surveillance.rows.schema import check_types
from descentflow.surveillance.unpacking import MAX_LINE_BYTES, Input

CSV_BYTES = 32 << 20
"""Text that is read at a time."""
MIN_LINE_BYTES, EMPTY_BYTES = 3, 1 << 20
"""Mean length of lines below which so much text has no values: a row of two columns without any has two bytes."""


def parquet(source: Input, report: DropReport, rows: int) -> Iterator[pl.DataFrame]:
    """Rows of a Parquet file, a slice at a time; inside gzip or an archive it is held whole."""
    content = source.path or source.whole()
    check_pages(content)
    table = pl.scan_parquet(io.BytesIO(content) if isinstance(content, bytes) else content)
    yield from _slices(table, rows, source.label, source.columns, report)


def feather(source: Input, report: DropReport, rows: int) -> Iterator[pl.DataFrame]:
    """Rows of an Arrow IPC file (Feather version 2)."""
    table = pl.scan_ipc(source.path or io.BytesIO(source.whole()))
    yield from _slices(table, rows, source.label, source.columns, report)


def held(
    table: pl.DataFrame, label: str, report: DropReport, rows: int, columns: Sequence[str] = ()
) -> Iterator[pl.DataFrame]:
    """Rows of a table in memory, with the columns whose names are known and those named here."""
    yield from _slices(table.lazy(), rows, label, columns, report)


def is_parquet(head: bytes) -> bool:
    """Test for the first bytes of Parquet."""
    return head.startswith(b"PAR1")


def is_feather(head: bytes) -> bool:
    """Test for the first bytes of Arrow IPC (Feather version 2)."""
    return head.startswith(b"ARROW1")


def _slices(
    table: pl.LazyFrame, rows: int, label: str, columns: Sequence[str], report: DropReport
) -> Iterator[pl.DataFrame]:
    total = table.select(pl.len()).collect().item()
    schema = table.collect_schema()
    names = wanted(schema.names(), columns)
    # Before anything is read: a list that is long and always the same takes no place in a file.
    check_types({name: schema[name] for name in names}, label)
    table = table.select(names)
    note_unused([name for name in schema.names() if name not in names], total, report)
    for start in range(0, max(total, 1), rows):
        yield table.slice(start, rows).collect()


def csv(source: Input, report: DropReport, rows: int) -> Iterator[pl.DataFrame]:
    """Rows of a CSV file, everything as text: a word in a column of numbers is then counted and not a crash."""
    header = _checked(source.stream.readline(MAX_LINE_BYTES), source.label, 0).removeprefix(BYTE_ORDER_MARK)
    if b"," not in header:
        raise _without_commas(header, source.label)
    header = header.rstrip(b"\r\n") + b"\n"
    quote = "'" if header.startswith(b"'") else '"'  # OpenSky's list of aircraft has the former
    theirs = _parsed(header, None, quote, source.label).columns
    names = wanted(theirs, source.columns)
    unused = [name for name in theirs if name not in names]
    place, empty = len(header), True
    for chunk in _chunks(source, quote.encode()):
        _check_has_values(chunk, source.label, place)
        table = _parsed(header + _checked(chunk, source.label, place), names, quote, source.label)
        note_unused(unused, len(table), report)
        yield table
        place += len(chunk)
        empty = False
    if empty:
        yield _parsed(header, names, quote, source.label)


def _check_has_values(chunk: bytes, label: str, place: int) -> None:
    """Refuse text of empty lines: a few hundred kilobytes unpack to hundreds of millions of them, a row each."""
    lines = chunk.count(b"\n")
    if len(chunk) > EMPTY_BYTES and lines * MIN_LINE_BYTES > len(chunk):
        raise DataError(
            f"{label}: {lines:,} lines in {len(chunk):,} bytes from byte {place}",
            expected="rows with values",
            mend="take the empty lines out of the file",
        )


def _without_commas(header: bytes, label: str) -> DataError:
    """The error for a first line that is no list of names."""
    got, mend = "without commas", "convert the table to CSV with commas, or to Parquet"
    if header.lstrip().startswith(b"#"):
        got, mend = "without commas, a comment", "take the lines before the names out of the file"
    elif b";" in header:
        got += ", but with semicolons"
        mend += ", for instance by pandas: read_csv(NAME, sep=';', decimal=',').to_parquet('rows.parquet')"
    elif b"\t" in header:
        got += ", but with tabs"
        mend += ", for instance by pandas: read_csv(NAME, sep='\\t').to_parquet('rows.parquet')"
    return DataError(f"{label}: a first line {got}", expected="column names with commas between them", mend=mend)


BYTE_ORDER_MARK = b"\xef\xbb\xbf"


def _parsed(text: bytes, names: list[str] | None, quote: str, label: str) -> pl.DataFrame:
    try:
        return pl.read_csv(text, infer_schema=False, columns=names, quote_char=quote)
    except pl.exceptions.ComputeError as error:
        raise DataError(
            f"{label}: {str(error).splitlines()[0]}",
            expected="lines with no more fields than the first names",
            mend="remove or quote the damaged line",
        ) from error


def _chunks(source: Input, quote: bytes) -> Iterator[bytes]:
    """Bytes up to an end of a line that is not inside quotes."""
    rest = b""
    while read := source.stream.read(CSV_BYTES):
        rest += read
        end = len(rest) if len(read) < CSV_BYTES else _end_of_rows(rest, quote)
        if end:
            yield rest[:end]
            rest = rest[end:]
        elif len(rest) > CSV_BYTES + MAX_LINE_BYTES:
            raise DataError(
                f"{source.label}: a row longer than {MAX_LINE_BYTES >> 20} MiB",
                expected="a row a line",
                mend="look for a quote that is not closed",
            )
    if rest:
        yield rest


def _end_of_rows(text: bytes, quote: bytes) -> int:
    """Place after the last end of a line before which all quotes are closed; 0 if there is none."""
    end = text.rfind(b"\n") + 1
    open_quote = text.count(quote, 0, end) % 2
    while end and open_quote:
        # No row ends behind the last quote. Only what lies between is counted again: the text is passed once.
        before = text.rfind(b"\n", 0, text.rfind(quote, 0, end)) + 1
        open_quote ^= text.count(quote, before, end) % 2
        end = before
    return end


def _checked(content: bytes, label: str, place: int) -> bytes:
    """The same bytes, if they are UTF-8."""
    try:
        content.decode()
    except UnicodeDecodeError as error:
        raise DataError(
            f"{label}: not UTF-8 at byte {place + error.start}",
            expected="a table, JSON or text in UTF-8",
            mend="save text files as UTF-8",
        ) from error
    return content
