"""JSON documents of a file: one, one a line, one after the other, or the elements of a list."""

import json
import re
from collections.abc import Iterator

import orjson

from descentflow.core.errors import DataError
from descentflow.surveillance.rows.drop_report import DropReport
from descentflow.surveillance.unpacking.streams import Input

BLANKS = re.compile(r"\s*")
DECODER = json.JSONDecoder()


def documents(source: Input, report: DropReport) -> Iterator[object]:
    r"""Documents of a file, read one at a time where they stand one a line; of a list each element is one.

    A last document that ends before its end, as where a recording was stopped, is left out and counted.

    Raises:
        DataError: If a document is damaged, too large or nested too deeply, or the text is not UTF-8.

    Example:
        >>> import io
        >>> source = Input(io.BytesIO(b'{"now": 1}\n[{"now": 2}, {"now": 3}]{"now": 4}'), "snapshots.json")
        >>> list(documents(source, DropReport()))
        [{'now': 1}, {'now': 2}, {'now': 3}, {'now': 4}]
    """
    begun = False
    for number, line in source.lines():
        try:
            found = [orjson.loads(line)]
        except orjson.JSONDecodeError:
            # One that the faster parser does not take, several, or the first line of a document of many.
            try:
                found = list(_one_after_the_other(line, number, source.label, begun, report))
            except DataError as error:
                if begun or not isinstance(error.__cause__, json.JSONDecodeError):
                    raise
                rest = Input(source.stream, source.label).whole()
                found = list(_one_after_the_other(line + rest, number, source.label, begun, report))
        for document in found:
            yield from document if isinstance(document, list) else [document]
        begun = True


def _one_after_the_other(text: bytes, first_line: int, label: str, begun: bool, report: DropReport) -> Iterator[object]:
    """Documents of a text, with NaN, infinity and numbers of any length.

    Args:
        text: One document or several.
        first_line: Number of its first line.
        label: Name of the file in messages.
        begun: Whether there were documents before.
        report: Takes the count of a last document that is cut.

    Raises:
        DataError: If one is damaged.
    """
    place, letters, where = 0, "", f"{label}, line {first_line}"
    try:
        letters = text.decode("utf-8-sig")
        while (place := BLANKS.match(letters, place).end()) < len(letters):  # type: ignore[union-attr] # it always fits
            document, place = DECODER.raw_decode(letters, place)
            yield document
    except RecursionError as error:
        raise DataError(
            f"{where}: JSON nested too deeply", expected="surveillance data", mend="pass another file"
        ) from error
    except UnicodeDecodeError as error:
        raise DataError(
            f"{where}: not UTF-8 at byte {error.start}", expected="JSON in UTF-8", mend="save it as UTF-8"
        ) from error
    except json.JSONDecodeError as error:
        if (begun or place) and not text.endswith(b"\n") and "}" not in letters[error.pos :]:
            report.note("JSON lines cut at the end of a file", 1)
            return
        raise DataError(
            f"{label}, line {first_line - 1 + error.lineno}: not JSON ({error.msg})",
            expected="one JSON document, or one a line",
            mend="remove the damaged line, or copy the file again",
        ) from error
    except ValueError as error:  # a number of thousands of digits
        raise DataError(f"{where}: {error}", expected="surveillance data", mend="pass another file") from error
