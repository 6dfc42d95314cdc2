"""Made-up files of so6 and ALL_FT+, of the structure that public readers of them expect."""

from collections.abc import Sequence
from datetime import datetime
from itertools import pairwise
from pathlib import Path

import polars as pl

Point = tuple[datetime, int]


def segments(points: Sequence[Point], flight: int, typecode: str = "A320") -> list[str]:
    """Lines of so6 between points (time, level)."""
    lines = []
    for number, ((begin, high), (end, low)) in enumerate(pairwise(points), 1):
        status = 2 if high == low else int(low < high)
        lines.append(
            f"P{number}_P{number + 1} EGLL LFPG {typecode} {begin:%H%M%S} {end:%H%M%S} {high} {low} {status} "
            f"CS{flight} {begin:%y%m%d} {end:%y%m%d} 3088.65 -27.5 3090.1 -26.9 {flight} {number} 4.071 0"
        )
    return lines


def flight_of_allft(points: Sequence[Point], flight: int, typecode: str = "A320", version: int = 6) -> str:
    """A line of ALL_FT+ with filed, regulated and current points; only the last are those that are given."""
    place = {2: 107, 6: 113, 8: 117}[version]
    fields = [""] * 190
    fields[0:7] = ["EGLL", "LFPG", f"CS{flight}", "CSX", typecode, "20260101000000", f"AA{flight:08d}"]
    text = [f"{time:%Y%m%d%H%M%S}:PNT:UL1:{level}:10:V:513000N0003000W:50:Y" for time, level in points]
    fields[place - 1 : place + 1] = [str(len(text)), " ".join(text)]
    return ";".join(fields)


def points_of(frame: pl.DataFrame, step_fl: int = 10) -> dict[str, list[Point]]:
    """Points of flights in a table of levels, every so many levels."""
    shown = frame.filter(pl.col("level_fl") % step_fl == 0).sort("flight_id", "timestamp")
    parts = shown.partition_by("flight_id", as_dict=True, maintain_order=True)
    return {str(name): part.select("timestamp", "level_fl").rows() for (name,), part in parts.items()}


def write_so6(frame: pl.DataFrame, path: Path, typecode: str = "A320") -> Path:
    """Flights of a table of levels as so6."""
    flights = enumerate(points_of(frame).values(), 1)
    path.write_text("\n".join(line for number, own in flights for line in segments(own, number, typecode)) + "\n")
    return path
