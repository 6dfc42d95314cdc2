"""EUROCONTROL's ALL_FT+: a flight a line with its profiles, as DDR2 and NEST write them.

The first line is the number of the format's version; then a flight a line, fields between semicolons. Read are the
callsign (3rd), the aircraft type (5th), the number of the flight plan (7th) and the points of the current profile
(``ctfm``), whose place depends on the version, with their number in the field before. Points stand between blanks, each
with fields between colons: time (YYYYMMDDHHMMSS), point, route, flight level, and what is not read here. So read in the
readers of the library traffic (xoolive/traffic, `data/eurocontrol/ddr/allft.py` and `allft_fields.txt`), and, for the
versions, in a table of headers of versions 2, 3, 4, 6 and 8 in another public reader, which takes version 5 for 4.
"""

from collections.abc import Iterable, Iterator
from itertools import islice

import polars as pl

from descentflow.core.errors import DataError
from descentflow.surveillance.point_profiles.so6 import POINTS
from descentflow.surveillance.rows.drop_report import DropReport

CALLSIGN, TYPE, FLIGHT = 2, 4, 6
"""Places of the fields that all versions have alike, from zero."""
CURRENT = {2: 107, 3: 113, 4: 113, 5: 113, 6: 113, 8: 117}
"""Version -> place of the points of the current profile: version 3 added fuel and charges to each of the three profiles
up to there, version 8 a profile of the fuel to the first two."""
FIELDS_OF_POINT = 4


def is_allft(line: str) -> bool:
    """Whether a first line is that of ALL_FT+: the number of a version and nothing else.

    Example:
        >>> is_allft("6"), is_allft("timestamp;altitude")
        (True, False)
    """
    return line.strip().isdecimal() and len(line.strip()) <= 2


def allft_points(lines: Iterable[str], report: DropReport) -> pl.DataFrame:
    """Points of the current profile of every flight that has one.

    Args:
        lines: Of the file, that with the version first.
        report: Takes the numbers of flights without such a profile, and of points that cannot be read.

    Returns:
        Columns :data:`~.so6.POINTS`, in the order of each flight's points.

    Raises:
        DataError: If the version is not known, or the number of points is not what the field before them says: then the
            fields have other places.

    Example:
        >>> fields = [""] * 120
        >>> fields[2], fields[4], fields[6] = "AFL2193", "A321", "AA00000007"
        >>> fields[112:114] = "2", "20171214235950:A:UL1:300:1 20171215000010:B:UL1:295:2"
        >>> allft_points(["6", ";".join(fields)], DropReport()).select("flight_id", "level_fl").rows()
        [('AA00000007', 300.0), ('AA00000007', 295.0)]
    """
    rest = iter(lines)
    version = int(next(rest).strip())
    if version not in CURRENT:
        raise DataError(
            f"ALL_FT+ of version {version}",
            expected=f"one of versions {', '.join(map(str, CURRENT))}",
            mend="export the flights as so6 segments from NEST",
        )
    columns: dict[str, list[object]] = {name: [] for name in POINTS}
    without = odd = number = 0
    for number, (fields, points) in enumerate(_flights(rest, CURRENT[version]), 1):
        without += not points
        for point in points:
            parts = point.split(":")
            if len(parts) < FIELDS_OF_POINT or not parts[3].lstrip("-").isdecimal():
                odd += 1
                continue
            values = (fields[FLIGHT], fields[TYPE], fields[CALLSIGN], number, parts[0], float(parts[3]))
            for name, value in zip(POINTS, values, strict=True):
                columns[name].append(value)
    report.note("flights of ALL_FT+ without a current profile", without)
    found = pl.DataFrame(columns, schema={**POINTS, "timestamp": pl.String()}, orient="col")
    time = pl.col("timestamp").str.to_datetime("%Y%m%d%H%M%S", time_unit="us", strict=False)
    timed = found.with_columns(time.dt.replace_time_zone("UTC")).drop_nulls("timestamp")
    report.note("points of ALL_FT+ that cannot be read", odd + len(found) - len(timed))
    return timed


def _flights(lines: Iterator[str], place: int) -> Iterator[tuple[list[str], list[str]]]:
    """Fields and points of each flight.

    Raises:
        DataError: If the fields have other places.
    """
    for line in lines:
        if not line.strip():
            continue
        fields = line.rstrip("\r\n").split(";")
        told, text = [*islice(fields, place - 1, place + 1), "", ""][:2]
        points = text.split()
        if (told.strip() or "0") != str(len(points)):
            raise DataError(
                f"a flight of ALL_FT+ with {len(points)} points where {told or 'none'} are announced",
                expected=f"the number of points in field {place} and the points in field {place + 1}",
                mend="check that the file is whole and of the version that its first line says",
            )
        yield fields, points
