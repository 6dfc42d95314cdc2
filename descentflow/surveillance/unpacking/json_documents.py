"""JSON documents of a file: one, or one a line."""

import contextlib
import json
from collections.abc import Iterator

import orjson

from descentflow.core.errors import DataError
from descentflow.surveillance.rows.drop_report import DropReport
from descentflow.surveillance.unpacking.streams import Input


def documents(source: Input, report: DropReport) -> Iterator[object]:
    r"""Documents of a file, read one at a time where they stand one a line.

    A last line that ends before its end, as where a recording was stopped, is left out and counted.

    Raises:
        DataError: If a document is damaged, too large or nested too deeply, or the text is not UTF-8.

    Example:
        >>> import io
        >>> source = Input(io.BytesIO(b'{"now": 1}\n{"now": 2}\n'), "snapshots.jsonl")
        >>> list(documents(source, DropReport()))
        [{'now': 1}, {'now': 2}]
    """
    lines = source.lines()
    number, first = next(lines, (0, b""))
    try:
        document = _parsed(first, f"{source.label}, line {number}")
    except DataError as error:
        following = next(lines, None)
        if following is None or error.got.endswith(TOO_DEEP):
            raise
        # Not a document by itself: either the first line of a document of many, or a damaged line of many documents.
        rest = Input(source.stream, source.label).whole()
        yield _of_many_lines(first + following[1] + rest, number, source.label)
        return
    yield document
    for number, line in lines:
        try:
            document = _parsed(line, f"{source.label}, line {number}")
        except DataError as error:
            if line.endswith(b"\n") or not isinstance(error.__cause__, json.JSONDecodeError):
                raise
            report.note("JSON lines cut at the end of a file", 1)
            return
        yield document


TOO_DEEP = "JSON nested too deeply"


def _of_many_lines(text: bytes, first_line: int, label: str) -> object:
    """A document of many lines; if it is none, the error is told of the line where it lies."""
    try:
        return _parsed(text, label)
    except DataError as error:
        if isinstance(error.__cause__, json.JSONDecodeError):
            line = first_line - 1 + error.__cause__.lineno
            raise DataError(
                f"{label}, line {line}: not JSON ({error.__cause__.msg})",
                expected="one JSON document, or one a line",
                mend="remove the damaged line, or copy the file again",
            ) from error.__cause__
        raise


def _parsed(text: bytes, label: str) -> object:
    """One document.

    Raises:
        DataError: If the text is none.
    """
    with contextlib.suppress(orjson.JSONDecodeError):
        return orjson.loads(text)
    # What the faster parser does not take is read again by the one of the standard library: it knows NaN, infinity and
    # numbers of any length, and says what is wrong with the rest.
    try:
        return json.loads(text.decode("utf-8-sig"))
    except RecursionError as error:
        raise DataError(f"{label}: {TOO_DEEP}", expected="surveillance data", mend="pass another file") from error
    except UnicodeDecodeError as error:
        raise DataError(
            f"{label}: not UTF-8 at byte {error.start}", expected="JSON in UTF-8", mend="save it as UTF-8"
        ) from error
    except json.JSONDecodeError as error:
        raise DataError(
            f"{label}: not JSON ({error})",
            expected="one JSON document, or one a line",
            mend="remove the damaged line, or copy the file again",
        ) from error
    except ValueError as error:  # a number of thousands of digits
        raise DataError(f"{label}: {error}", expected="surveillance data", mend="pass another file") from error
