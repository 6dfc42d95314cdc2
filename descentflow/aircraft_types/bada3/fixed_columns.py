"""Lines of BADA's fixed-column text files, with errors that name file and line."""

from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

from descentflow.core.errors import AircraftError

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

    def real(self, place: int, what: str, first: int = 4) -> float:
        """Number in the given ``3X, E10.5`` field, counted from zero after column ``first``.

        The blanks on either side are checked too: a line that slipped by a column could read as another number.
        """
        start = first + place * (_GAP + _FIELD) + _GAP
        stop = start + _FIELD
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


def read_lines(path: Path) -> list[Line]:
    """Read a whole file (Latin-1, any line ends)."""
    try:
        text = path.read_bytes().decode("latin-1")
    except OSError as error:
        raise AircraftError(
            f"{path}: {error.strerror}",
            expected="a readable BADA file",
            mend="check the BADA directory (--bada-dir, of fit: --data.bada_dir) and the file's permissions",
        ) from error
    return [Line(path, number, line) for number, line in enumerate(text.splitlines(), start=1)]


def data_lines(lines: list[Line]) -> list[Line]:
    """Keep the lines that carry data: those that start with CD."""
    kept = [line for line in lines if line.text.startswith("CD")]
    if not kept:
        path = lines[0].path if lines else "file"
        raise AircraftError(
            f"{path} holds no data line",
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
