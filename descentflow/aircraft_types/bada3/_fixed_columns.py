"""Lines of BADA's fixed-column text files: read with errors that name file and line, and changed in their columns."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NoReturn

from descentflow.core.errors import AircraftError
from descentflow.core.files import write_whole

_FIELD, _GAP = 10, 3
"""BADA's numbers are written as ``3X, E10.5``: three blanks, ten columns."""


@dataclass(frozen=True)
class Line:
    """One line with its file and number."""

    path: Path
    number: int
    text: str

    def fail(self, got: str, expected: str) -> NoReturn:
        """Raise an AircraftError that names file and line."""
        raise AircraftError(
            f"{self.path} line {self.number}: {got} in {self.text!r}",
            expected=expected,
            mend="restore the file from the BADA release; its columns are fixed, so do not re-indent it",
        )

    def cut(self, first: int, last: int) -> str:
        """Text of the columns ``first`` to ``last`` (from zero, ``last`` not included) without outer blanks."""
        return self.text[first:last].strip()

    def integer(self, first: int, last: int, what: str) -> int:
        """Whole number in a range of columns."""
        text = self.cut(first, last)
        if not text.isdecimal():
            self.fail(f"{what} {text!r}", f"a whole number in columns {first + 1} to {last}")
        return int(text)

    def put(self, first: int, last: int, text: str) -> "Line":
        """The line with another text in a range of columns."""
        if len(text) > last - first or "\n" in text:
            raise AircraftError(
                f"text {text!r}",
                expected=f"at most {last - first} characters on one line",
                mend="shorten it before writing",
            )
        return replace(self, text=f"{self.text[:first]}{text:<{last - first}}{self.text[last:]}")

    def put_real(self, place: int, value: float) -> "Line":
        """The line with another number in a field, see :meth:`real`."""
        return self.put(*_columns(place), e10(value))

    def real(self, place: int, what: str) -> float:
        """Number in the given ``3X, E10.5`` field, counted from zero after the fourth column.

        The blanks on either side are checked too: a line that slipped by a column could read as another number.
        """
        start, stop = _columns(place)
        text = self.text[start:stop]
        around = self.text[start - 1 : start] + self.text[stop : stop + 1].replace("/", " ")
        if text.strip() != text or len(text) < _FIELD or around.strip():
            self.fail(f"{what} {text!r}", f"a number that fills columns {start + 1} to {stop}, a blank on either side")
        try:
            value = float(text)
        except ValueError:
            self.fail(f"{what} {text!r}", f"a number such as .58000E+02 in columns {start + 1} to {stop}")
        if value in (float("inf"), float("-inf")) or value != value:
            self.fail(f"{what} {text!r}", "a finite number")
        return value


def _columns(place: int) -> tuple[int, int]:
    start = 4 + place * (_GAP + _FIELD) + _GAP
    return start, start + _FIELD


def read_lines(path: Path) -> list[Line]:
    """Read a whole file (Latin-1, any line ends)."""
    try:
        text = path.read_text(encoding="latin-1")
    except OSError as error:
        raise AircraftError(
            f"{path}: {error.strerror}",
            expected="a readable BADA file",
            mend="check the BADA directory (--bada-dir, of fit: --data.bada_dir) and the file's permissions",
        ) from error
    return [Line(path, number, line) for number, line in enumerate(text.split("\n"), start=1)]


def data_lines(lines: list[Line]) -> list[Line]:
    """Keep the lines that carry data: those that start with CD."""
    kept = [line for line in lines if line.text.startswith("CD")]
    if not kept:
        raise AircraftError(
            f"{lines[0].path} holds no data line",
            expected="lines that start with CD",
            mend="check that this is a BADA 3 file and not truncated",
        )
    return kept


def header(lines: list[Line], key: str) -> str:
    """Text after ``key:`` in the comment lines, such as a modification date; empty where the file has none."""
    for line in lines:
        if line.text.startswith("CC") and f"{key}:" in line.text:
            return line.text.split(f"{key}:", 1)[1].rstrip("/ ").strip()
    return ""


def write_lines(lines: Iterable[Line], path: Path, names: tuple[str, str], dates: dict[str, str]) -> None:
    """Write lines to a file, whole or not at all, with other names and dates in its comments.

    Args:
        lines: Content.
        path: File.
        names: Name of the file without suffix in its comments, and the new one.
        dates: Texts after keys such as ``Modification_date``.
    """
    text = "\n".join(_commented(line.text, names, dates) for line in lines)
    write_whole(path, text.encode("latin-1"))


def _commented(text: str, names: tuple[str, str], dates: dict[str, str]) -> str:
    if not text.startswith("CC"):
        return text
    for key, date in dates.items():
        before, key_there, _ = text.partition(f"{key}:")
        text = f"{before}{key_there} {date}".ljust(len(text) - 1) + "/" if key_there else text
    return text.replace(f"{names[0]}.", f"{names[1]}.")


def e10(value: float) -> str:
    """Write a number in BADA's ten columns: five digits, four when negative (``.58000E+02``, ``-.3885E+02``)."""
    digits = 4 if value < 0 else 5
    if value == 0:
        return ".00000E+00"
    mantissa, _, exponent = f"{abs(value):.{digits - 1}E}".partition("E")
    power = int(exponent) + 1 if exponent else 100
    if abs(power) > 99:
        raise AircraftError(
            f"coefficient {value!r}",
            expected="a finite number between 1e-99 and 1e99",
            mend="correct the coefficient before writing it to a BADA file",
        )
    return f"{'-' if value < 0 else ''}.{mantissa.replace('.', '')}E{power:+03d}"
