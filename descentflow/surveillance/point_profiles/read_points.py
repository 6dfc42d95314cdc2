"""Points of flight profiles from a file, whichever of the two formats it has."""

import gzip
import zlib
from dataclasses import dataclass
from io import TextIOWrapper
from pathlib import Path

import polars as pl

from descentflow.core.errors import DataError
from descentflow.surveillance.point_profiles.allft import allft_points, is_allft
from descentflow.surveillance.point_profiles.so6 import is_so6, so6_points
from descentflow.surveillance.rows.drop_report import DropReport

GZIP = b"\x1f\x8b"
HEAD_CHARACTERS = 4096


@dataclass(frozen=True, repr=False)
class PointProfiles:
    """Points of flights, with times and altitudes and nothing else that a diagnosis measures.

    Attributes:
        points: Columns :data:`~.so6.POINTS`.
        source: ``so6`` or ``ALL_FT+``.
        report: What could not be read.

    Example:
        >>> points = pl.DataFrame({"flight_id": ["a", "a"], "typecode": ["A320", "A320"]})
        >>> print(PointProfiles(points, "so6", DropReport()).of_type("A320"))
        1 flights of A320 in 2 points of so6
    """

    points: pl.DataFrame
    source: str
    report: DropReport

    def of_type(self, typecode: str) -> "PointProfiles":
        """Flights of one type.

        Raises:
            DataError: If there is none.
        """
        kept = self.points.filter(pl.col("typecode") == typecode)
        if kept.is_empty():
            types = ", ".join(self.points["typecode"].drop_nulls().unique().sort().to_list()[:10])
            raise DataError(
                f"{self.source} without a flight of {typecode}",
                expected=f"one; there are {types}",
                mend="pass other files",
            )
        return PointProfiles(kept, self.source, self.report)

    def __str__(self) -> str:
        """Flights, types and points."""
        types = ", ".join(self.points["typecode"].drop_nulls().unique().sort().to_list()[:10])
        flights = self.points["flight_id"].n_unique()
        return f"{flights:,} flights of {types} in {len(self.points):,} points of {self.source}"

    __repr__ = __str__


def holds_points(path: object) -> bool:
    """Whether a path is a file of so6 or of ALL_FT+, plain or packed with gzip; told by its first lines.

    Example:
        >>> holds_points("rows.parquet"), holds_points(Path("absent.so6"))
        (False, False)
    """
    if not isinstance(path, str | Path) or not Path(path).is_file():
        return False
    head = _head(Path(path))
    return bool(head) and (is_so6(head[0]) or (is_allft(head[0]) and (len(head) < 2 or head[1].count(";") > 100)))


def read_points(path: str | Path) -> PointProfiles:
    """Read a file of so6 segments, or of ALL_FT+ flights.

    Args:
        path: The file.

    Raises:
        DataError: If it is neither, cannot be read, or has no flight.

    Example:
        >>> read_points("rows.parquet")
        Traceback (most recent call last):
        descentflow.core.errors.DataError: rows.parquet: neither so6 nor ALL_FT+; ...
    """
    source = Path(path)
    if not holds_points(source):
        raise DataError(
            f"{source}: neither so6 nor ALL_FT+",
            expected="segments of so6 (twenty fields between blanks), or flights of ALL_FT+ below the format's version",
            mend="export them from NEST or DDR2, and unpack them unless they are packed with gzip",
        )
    report, is_allft_file = DropReport(), is_allft(_head(source)[0])
    try:
        # Line by line: a day of ALL_FT+ is larger than what is read of it.
        with _opened(source) as lines:
            points = allft_points(lines, report) if is_allft_file else so6_points(lines, report)
    except (OSError, EOFError, zlib.error) as error:
        raise DataError(f"{source}: {error}", expected="a whole file", mend="copy it again") from error
    if points.is_empty():
        raise DataError(f"{source}: no flight in it", expected="flights with points", mend="pass another file")
    return PointProfiles(points, "ALL_FT+" if is_allft_file else "so6", report)


def _opened(path: Path) -> TextIOWrapper:
    """The file as text, unpacked; letters that are none do not stop the reading."""
    with path.open("rb") as file:
        packed = file.read(2) == GZIP
    stream = gzip.open(path) if packed else path.open("rb")  # noqa: SIM115 - the wrapper closes it
    return TextIOWrapper(stream, encoding="utf-8-sig", errors="replace")


def _head(path: Path) -> list[str]:
    """The first two lines, or as much of them as tells the format."""
    try:
        with _opened(path) as file:
            return file.read(HEAD_CHARACTERS).splitlines()[:2]
    except (OSError, EOFError, zlib.error):
        return []
