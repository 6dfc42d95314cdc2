"""The prepared table of descents: how it is written, and how it is read back and checked."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import polars as pl

from descentflow.core.errors import DataError
from descentflow.core.files import whole_file

SCHEMA_VERSION = 1
KEY = "descentflow"
"""Key of the Parquet metadata under which the description stands."""
REQUIRED = ("flight_id", "icao24", "typecode", "level_fl", "timestamp", "time_s", "IAS", "Mach", "vertical_rate")
REACHED_BY = 0.25
"""The grid ends at the highest level that this share of the flights reach (paper, appendix A)."""
MEND = "pass the Parquet file or the folder that `descentflow prepare` wrote"


@dataclass(frozen=True)
class Descents:
    """Prepared descents: one row a flight and level, and what is known of how they were made.

    Attributes:
        frame: Columns :data:`REQUIRED` and channels; sorted by flight and falling level.
        metadata: `schema_version bottom_fl top_fl settings inputs report`.
    """

    frame: pl.DataFrame
    metadata: dict[str, Any]

    @property
    def bottom_fl(self) -> int:
        """Lowest level that they were prepared for."""
        return int(self.metadata["bottom_fl"])


def top_levels(frame: pl.DataFrame) -> dict[str, int]:
    """For each type, the highest level that at least a quarter of its flights reach."""
    reached = frame.group_by("typecode", "flight_id").agg(pl.col("level_fl").max())
    tops = reached.group_by("typecode").agg(
        pl.col("level_fl").sort(descending=True).get(((pl.len() * REACHED_BY).ceil() - 1).cast(pl.UInt32))
    )
    return dict(sorted(tops.iter_rows()))


def write_descents(descents: Descents, path: Path) -> None:
    """Write the table with its description, whole or not at all."""
    with whole_file(path) as temporary:
        descents.frame.write_parquet(temporary, metadata={KEY: json.dumps(descents.metadata)})


def read_descents(path: str | Path) -> Descents:
    """Read a prepared table: one file, or a store (a folder of Parquet files by type).

    Raises:
        DataError: If the file is missing, damaged, not written by `descentflow prepare`, of another schema version,
            or without a descent.

    Example:
        >>> read_descents("a320.parquet").frame["flight_id"].n_unique()
        2000
    """
    if Path(path).is_dir():
        from descentflow.surveillance.descents.store import read_store

        frame, metadata = read_store(Path(path))
    else:
        frame, metadata = _read_file(path)
    if metadata.get("schema_version") != SCHEMA_VERSION:
        raise DataError(
            f"{path}: schema version {metadata.get('schema_version')}",
            expected=f"version {SCHEMA_VERSION}",
            mend="prepare the rows again with this version of descentflow",
        )
    absent = [name for name in REQUIRED if name not in frame.columns]
    if absent:
        raise DataError(f"{path}: no column {', '.join(absent)}", expected=f"{', '.join(REQUIRED)}", mend=MEND)
    if frame.is_empty():
        raise DataError(f"{path}: no descent in it", expected="at least one", mend="prepare other rows")
    return Descents(frame, metadata)


def _read_file(path: str | Path) -> tuple[pl.DataFrame, dict[str, Any]]:
    if not Path(path).is_file():
        raise DataError(f"no file {path}", expected="prepared descents", mend=MEND)
    try:
        description = pl.read_parquet_metadata(path).get(KEY)
        frame = pl.read_parquet(path)
    except (pl.exceptions.PolarsError, OSError) as error:
        raise DataError(f"{path}: {str(error).splitlines()[0]}", expected="a whole Parquet file", mend=MEND) from error
    if description is None:
        raise DataError(f"{path}: Parquet, but not prepared descents", expected="a prepared table", mend=MEND)
    return frame, described(description, path)


def described(text: str, path: str | Path) -> dict[str, Any]:
    """The description of a prepared table.

    Raises:
        DataError: If it is no JSON object.
    """
    try:
        found = json.loads(text)
    except ValueError:
        found = None
    if not isinstance(found, dict):
        raise DataError(f"{path}: a damaged description", expected="a JSON object in the metadata", mend=MEND)
    return found
