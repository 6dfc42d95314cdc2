"""Read rows from Parquet, CSV and aircraft.json files, told apart by content."""

import gzip
import json
import zlib
from collections.abc import Iterator, Sequence
from pathlib import Path

import polars as pl

from descentflow.errors import DataError
from descentflow.surveillance.aircraft_json import rows_of_snapshots
from descentflow.surveillance.normalise import normalise
from descentflow.surveillance.report import DropReport
from descentflow.surveillance.units_check import check_units

ACCEPTED = "Parquet, CSV, or aircraft.json snapshots (JSON or JSON lines, gzip too)"


def read_rows(paths: Sequence[Path], report: DropReport) -> pl.DataFrame:
    """Read files, or all files of folders, as rows of the schema.

    Args:
        paths: Files and folders.
        report: Takes the counts of values that could not be read.

    Returns:
        Rows with the columns of :data:`descentflow.surveillance.schema.COLUMNS` that any file has.

    Raises:
        DataError: If a file cannot be read, is of no known kind, lacks a required column, holds one in a wrong unit,
            or if there is no row.
    """
    frames = [_rows_of(path, report) for path in files_of(paths)]
    rows = pl.concat(frames, how="diagonal")
    if rows.is_empty():
        raise DataError(
            f"no row in {', '.join(str(p) for p in paths)}", expected="surveillance rows", mend="pass other files"
        )
    return rows


def _rows_of(path: Path, report: DropReport) -> pl.DataFrame:
    rows = normalise(read_table(path), path, report)
    check_units(rows, str(path))
    return rows


def read_table(path: Path) -> pl.DataFrame:
    """Read one file as it is, with its own column names (snapshots become one row an aircraft)."""
    head = _head(path)
    if not head:
        raise DataError(f"{path} is empty", expected=ACCEPTED, mend="check how it was written or copied")
    try:
        if head.startswith(b"PAR1"):
            return pl.read_parquet(path)
        if head.startswith(b"\x1f\x8b"):
            return _from_text(gzip.decompress(path.read_bytes()), path)
        return _from_text(path.read_bytes(), path)
    except (gzip.BadGzipFile, EOFError, zlib.error) as error:
        raise DataError(f"{path}: damaged gzip ({error})", expected="a whole file", mend="copy it again") from error
    except (pl.exceptions.PolarsError, OSError) as error:
        reason = str(error).splitlines()[0]
        raise DataError(f"{path}: {reason}", expected="a whole, readable file", mend="copy it again") from error


def _from_text(content: bytes, path: Path) -> pl.DataFrame:
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise DataError(
            f"{path}: not UTF-8 at byte {error.start}", expected=ACCEPTED, mend="save text files as UTF-8"
        ) from error
    if not text.strip():
        raise DataError(f"{path} holds no text", expected=ACCEPTED, mend="check how it was written")
    if text.lstrip()[0] in "{[":
        return rows_of_snapshots(_snapshots(text, path), path)
    if "," not in text.splitlines()[0]:
        raise DataError(f"{path}: a first line without commas", expected=ACCEPTED, mend="convert it to one of these")
    try:
        # Everything as text first: a word in a column of numbers is then counted and not a crash.
        return pl.read_csv(text.encode(), infer_schema=False)
    except pl.exceptions.ComputeError as error:
        raise DataError(
            f"{path}: {str(error).splitlines()[0]}",
            expected="lines with no more fields than the first names",
            mend="remove or quote the damaged line",
        ) from error


def _snapshots(text: str, path: Path) -> Iterator[object]:
    """One JSON document, or one a line."""
    try:
        yield json.loads(text)
        return
    except RecursionError as error:
        raise DataError(
            f"{path}: JSON nested too deeply", expected="aircraft.json", mend="pass another file"
        ) from error
    except json.JSONDecodeError:
        pass
    except ValueError as error:  # a number of thousands of digits
        raise DataError(f"{path}: {error}", expected="aircraft.json", mend="pass another file") from error
    for number, line in enumerate(text.split("\n"), 1):
        if not line.strip():
            continue
        try:
            yield json.loads(line)
        except (ValueError, RecursionError) as error:
            raise DataError(
                f"{path}, line {number}: not JSON ({error})",
                expected="one JSON document a line",
                mend="remove the damaged line, or copy the file again",
            ) from error


def files_of(paths: Sequence[Path]) -> list[Path]:
    """Files given, and all files of folders given, hidden ones aside."""
    files: list[Path] = []
    for path in paths:
        if path.is_dir():
            files += sorted(p for p in path.rglob("*") if p.is_file() and not p.name.startswith("."))
        elif path.is_file():
            files.append(path)
        else:
            raise DataError(f"no file or folder {path}", expected=ACCEPTED, mend="check the path")
    if not files:
        raise DataError("no file in the folders given", expected=ACCEPTED, mend="pass files, or folders that hold some")
    return files


def _head(path: Path) -> bytes:
    try:
        with path.open("rb") as file:
            return file.read(4)
    except OSError as error:
        raise DataError(f"{path}: {error}", expected="a readable file", mend="check its permissions") from error
