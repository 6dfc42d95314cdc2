"""EUROCONTROL's so6: segments of flight profiles, a line each, as DDR2 and NEST write them (`.m1.so6`, `.m3.so6`).

Twenty fields between blanks, in this order: segment (names of its two points), origin, destination, aircraft type, time
at its begin and its end (HHMMSS), flight level at its begin and its end, status (0 climb, 1 descent, 2 cruise),
callsign, date at its begin and its end (YYMMDD), latitude and longitude at its begin and its end (minutes of arc),
number of the flight, number of the segment in the flight, length (NM), parity. So read in the reader of the library
traffic (xoolive/traffic, `data/eurocontrol/ddr/so6.py`) and in one for Julia, which quotes four lines of a file.
"""

from collections.abc import Iterable

import polars as pl

from descentflow.surveillance.rows.drop_report import DropReport

FIELDS = 20
TYPE, TIMES, LEVELS, CALLSIGN, DATES, FLIGHT, SEQUENCE = 3, (4, 5), (6, 7), 9, (10, 11), 16, 17
"""Places of the fields that are read, from zero."""
POINTS = {
    "flight_id": pl.String(),
    "typecode": pl.String(),
    "callsign": pl.String(),
    "segment": pl.Int64(),
    "timestamp": pl.Datetime("us", "UTC"),
    "level_fl": pl.Float64(),
}
"""Columns of points; those of one ``segment`` follow each other without a gap."""


def is_so6(line: str) -> bool:
    """Whether a line is a segment of so6: twenty fields, with two times, levels and dates in their places.

    Example:
        >>> is_so6("A_B EHAM UUEE A321 214900 214926 0 10 0 AFL2193 171214 171214 1 2 3 4 213765625 1 1.4 0")
        True
        >>> is_so6("timestamp,icao24,altitude")
        False
    """
    fields = line.split()
    numbers = (*TIMES, *LEVELS, *DATES, SEQUENCE)
    return len(fields) == FIELDS and all(fields[place].isdecimal() for place in numbers)


def so6_points(lines: Iterable[str], report: DropReport) -> pl.DataFrame:
    """Points of so6: of each flight, the begin of every segment and the end of the last before a gap.

    Args:
        lines: Of the file.
        report: Takes the number of lines that are no segment.

    Returns:
        Columns :data:`POINTS`, in the order of each flight's segments.

    Example:
        >>> line = "A_B EHAM UUEE A321 {} {} {} {} 1 AFL2193 171214 171214 1 2 3 4 7 {} 1.4 0"
        >>> lines = [line.format("235950", "000010", 300, 295, 1), line.format("000010", "000030", 295, 290, 2)]
        >>> lines[0] = lines[0].replace("171214 171214", "171214 171215")
        >>> lines[1] = lines[1].replace("171214 171214", "171215 171215")
        >>> points = so6_points(lines, DropReport())
        >>> points["level_fl"].to_list(), points["timestamp"].diff().dt.total_seconds().to_list()
        ([300.0, 295.0, 290.0], [None, 20, 20])
    """
    kept, odd = [], 0
    for line in lines:
        if is_so6(line):
            kept.append(line.split())
        elif line.strip():
            odd += 1
    report.note("lines that are no segment of so6", odd)
    segments = pl.DataFrame(
        {
            "flight_id": [fields[FLIGHT] for fields in kept],
            "typecode": [fields[TYPE] for fields in kept],
            "callsign": [fields[CALLSIGN] for fields in kept],
            "sequence": [int(fields[SEQUENCE]) for fields in kept],
            **{f"time_{k}": [_joined(fields[DATES[k]], fields[TIMES[k]]) for fields in kept] for k in (0, 1)},
            **{f"level_{k}": [float(fields[LEVELS[k]]) for fields in kept] for k in (0, 1)},
        },
        schema_overrides=dict.fromkeys(("flight_id", "typecode", "callsign", "time_0", "time_1"), pl.String()),
    )
    timed = segments.with_columns(
        pl.col(f"time_{k}").str.to_datetime("%Y%m%d%H%M%S", time_unit="us", strict=False).dt.replace_time_zone("UTC")
        for k in (0, 1)
    )
    whole = timed.drop_nulls(["time_0", "time_1"])
    report.note("segments of so6 whose date or time cannot be", len(timed) - len(whole))
    ordered = whole.sort("flight_id", "sequence", maintain_order=True)
    follows = (
        (pl.col("flight_id") == pl.col("flight_id").shift())
        & (pl.col("time_0") == pl.col("time_1").shift())
        & (pl.col("level_0") == pl.col("level_1").shift())
    )
    chained = ordered.with_columns(segment=(~follows).fill_null(True).cum_sum().cast(pl.Int64))
    names = ("flight_id", "typecode", "callsign", "segment")
    begins = chained.select(*names, "sequence", end=pl.lit(0), timestamp="time_0", level_fl="level_0")
    # Of a chain only the last end is new: the others are the begins of what follows.
    last = chained.filter(pl.col("sequence") == pl.col("sequence").max().over("segment"))
    ends = last.select(*names, "sequence", end=pl.lit(1), timestamp="time_1", level_fl="level_1")
    points = pl.concat([begins, ends]).sort("segment", "sequence", "end", maintain_order=True)
    return points.select(*POINTS).cast(pl.Schema(POINTS))


def _joined(date: str, time: str) -> str:
    """Year and century before a date; programs that write numbers leave out the zeros in front."""
    return f"20{date.zfill(6)}{time.zfill(6)}"
