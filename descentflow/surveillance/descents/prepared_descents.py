"""Prepared descents: a table of one row per flight and level with its description, written to files and read back."""

import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import polars as pl

from descentflow.core.arguments import checked_arguments
from descentflow.core.errors import DataError
from descentflow.core.files import whole_file
from descentflow.core.parquet_pages import check_pages
from descentflow.core.tabular import to_dataset
from descentflow.core.threads import check_not_forked
from descentflow.reporting.in_notebook import WithTable
from descentflow.surveillance.cleaning.thresholds import Cleaning, differences_in_words, kept_cleaning
from descentflow.surveillance.descents._check_descents import checked_descents
from descentflow.surveillance.descents.store import KEY, MEND, SCHEMA_VERSION, described, read_store
from descentflow.surveillance.rows.air_data import IAS_COMPUTED, MACH_COMPUTED
from descentflow.surveillance.rows.airspeed_source import REPORTED
from descentflow.surveillance.rows.drop_report import DropReport
from descentflow.surveillance.rows.schema import CHANNELS, UNITS
from descentflow.surveillance.unpacking import whole_input

if TYPE_CHECKING:
    from matplotlib.figure import Figure


TOP_LEVEL_SHARE = 0.25
"""The grid ends at the highest level that this share of the flights reach (paper, appendix A)."""


class Descents(WithTable):
    """Prepared descents: one row per flight and level, and how they were made.

    Attributes:
        metadata: `schema_version bottom_fl top_fl settings typecodes inputs report`.
        dropped_rows: Rows of some flights with the reason for which each was dropped, if `prepare` was asked for them
            (:func:`~descentflow.surveillance.rows.drop_report.some_flights`), else None.
        level_flight: Level flight and held rates in the flights' descents
            (:func:`~descentflow.surveillance.cleaning.level_flight.stretches`, with types) from `prepare`, else None.

    Example:
        >>> descents = read_descents("descents.parquet")
        >>> print(descents)
        120 descents, 20,528 levels from FL150 to FL383, 2024-03-04 05:01 to 2024-03-08 22:05 UTC
          A320: 120, a quarter of them from FL354 or above
          rows: 23,216 read, 19,092 left
          dropped most by: not_descending 2,701, transient 1,203, constant_rate 220
    """

    def __init__(
        self,
        frame: pl.DataFrame | Callable[[], pl.DataFrame],
        metadata: dict[str, Any],
        *,
        flights: dict[str, int] | None = None,
        dropped_rows: pl.DataFrame | None = None,
        level_flight: pl.DataFrame | None = None,
    ) -> None:
        """Hold a table, or read one when it is first used.

        Args:
            frame: Columns :data:`REQUIRED` and channels, sorted by flight and falling level; or a function that reads
                such a table.
            metadata: See the class.
            flights: Number of flights per type, if known; else counted.
            dropped_rows: See the class.
            level_flight: See the class.
        """
        self._frame, self._flights = frame, flights
        self.metadata = metadata
        self.dropped_rows = dropped_rows
        self.level_flight = level_flight

    @property
    def frame(self) -> pl.DataFrame:
        """One row per flight and level, sorted by flight and falling level."""
        if not isinstance(self._frame, pl.DataFrame):
            self._frame = self._frame()
        return self._frame

    @property
    def period(self) -> list[str]:
        """First and last day (UTC) of the flights, as in ISO 8601."""
        days = self.frame.select(first=pl.col("timestamp").min(), last=pl.col("timestamp").max()).row(0)
        return [day.date().isoformat() for day in days]

    @property
    def bottom_fl(self) -> int:
        """Lowest flight level of the grid."""
        return int(self.metadata["bottom_fl"])

    @property
    def flights(self) -> dict[str, int]:
        """Number of flights per type.

        Example:
            >>> read_descents("descents.parquet").flights
            {'A320': 120}
        """
        if self._flights is None:
            counts = self.frame.group_by("typecode").agg(pl.col("flight_id").n_unique()).sort("typecode")
            self._flights = dict(counts.iter_rows())
        return self._flights

    @property
    def report(self) -> DropReport:
        """Rows and flights that each step of the cleaning dropped; empty if they are not known.

        Example:
            >>> read_descents("descents.parquet").report.steps[0].step
            'read'
        """
        kept = self.metadata.get("report")
        return DropReport.from_dict(kept) if kept else DropReport()

    @property
    def computed(self) -> list[str]:
        """Channels that carry no information of their own: Mach, where it or IAS was computed from the other.

        Example:
            >>> read_descents("descents.parquet").computed
            []
        """
        return ["Mach"] if {IAS_COMPUTED, MACH_COMPUTED} & set(self.report.notes) else []

    @property
    def reported(self) -> pl.DataFrame:
        """:attr:`frame` without channels that were computed from others, which say nothing of their own.

        Example:
            >>> "Mach" in read_descents("descents.parquet").reported.columns
            True
        """
        frame = self.frame.drop(self.computed, strict=False)
        if "airspeed_source" not in frame.columns:
            return frame
        # Of derived airspeeds both hold the field's temperature, and no measured one.
        own, names = pl.col("airspeed_source") == REPORTED, [name for name in ("TAS", "Mach") if name in frame.columns]
        frame = frame.with_columns(pl.when(own).then(name).alias(name) for name in names)
        return frame.drop(name for name in names if not frame[name].count())

    @property
    def cleaning(self) -> Cleaning | None:
        """Thresholds that they were cleaned with; None if they are not known.

        Example:
            >>> read_descents("descents.parquet").cleaning.slowest_fpm
            500.0
        """
        return kept_cleaning(self.metadata.get("settings"))

    def to_polars(self) -> pl.DataFrame:
        """The table as polars has it: :attr:`frame`; ``to_pandas`` gives it as pandas has it.

        Example:
            >>> read_descents("descents.parquet").to_pandas().shape
            (20528, 17)
        """
        return self.frame

    def to_xarray(self) -> Any:
        """An `xarray.Dataset` of the channels over flight and level, NaN where a flight was not observed.

        Raises:
            ConfigError: If xarray is not installed.

        Example:
            >>> read_descents("descents.parquet").to_xarray()["IAS"].dims
            ('flight_id', 'level_fl')
        """
        names = ["time_s", *(name for name in CHANNELS if name in self.frame.columns)]
        dataset = to_dataset(self.frame, ("flight_id", "level_fl"), names, {"time_s": "s", **UNITS})
        types = self.frame.unique("flight_id", keep="first").sort("flight_id")["typecode"]
        return dataset.assign_coords(typecode=("flight_id", types.to_list()))

    def notebook_figure(self) -> "Figure":
        """Airspeed and rate of some flights, see :func:`~descentflow.surveillance.figure_pages`."""
        from descentflow.surveillance.figure_pages import descents_figure

        return descents_figure(self.frame)

    def __repr__(self) -> str:
        """One line."""
        return f"Descents({sum(self.flights.values()):,} of {', '.join(self.flights)})"

    def __str__(self) -> str:
        """Flights, levels, types, period, and what was dropped."""
        frame = self.frame
        times = frame.select(first=pl.col("timestamp").min(), last=pl.col("timestamp").max()).row(0)
        period = " to ".join(f"{time:%Y-%m-%d %H:%M}" for time in times)
        head = (
            f"{sum(self.flights.values()):,} descents, {len(frame):,} levels from FL{self.bottom_fl} to "
            f"FL{frame['level_fl'].to_numpy().max()}, {period} UTC"
        )
        tops = self.metadata.get("top_fl", {})
        types = [
            f"  {name}: {number:,}" + (f", a quarter of them from FL{tops[name]} or above" if name in tops else "")
            for name, number in self.flights.items()
        ]
        pair = ("IAS", "Mach") if IAS_COMPUTED in self.report.notes else ("Mach", "IAS")
        computed = ["  {} is computed from {} and altitude: rows had none".format(*pair)] if self.computed else []
        return "\n".join([head, *types, *self.report.summary(), *computed])


def top_levels(frame: pl.DataFrame) -> dict[str, int]:
    """For each type, the highest level that at least a quarter of its flights reach."""
    reached = frame.group_by("typecode", "flight_id").agg(pl.col("level_fl").max())
    tops = reached.group_by("typecode").agg(
        pl.col("level_fl").sort(descending=True).get(((pl.len() * TOP_LEVEL_SHARE).ceil() - 1).cast(pl.UInt32))
    )
    return dict(sorted(tops.iter_rows()))


def write_descents(descents: Descents, path: Path) -> None:
    """Write the table with its description to a Parquet file, whole or not at all.

    Example:
        >>> write_descents(read_descents("descents.parquet"), Path("copy.parquet"))
    """
    with whole_file(path) as temporary:
        descents.frame.write_parquet(temporary, metadata={KEY: json.dumps(descents.metadata)})


@checked_arguments
def read_descents(path: str | Path) -> Descents:
    """Read prepared descents from one file, or from a store (a folder of Parquet files by type).

    Raises:
        DataError: If the file is missing, damaged, not written by `descentflow prepare`, of another schema version,
            without a descent, or with values that no descent has (``checked_descents``).

    Example:
        >>> read_descents("descents.parquet").frame.select("flight_id", "level_fl", "IAS").shape
        (20528, 3)
    """
    check_not_forked()
    frame, metadata = read_store(Path(path)) if Path(path).is_dir() else _read_file(path)
    if metadata.get("schema_version") != SCHEMA_VERSION:
        raise DataError(
            f"{path}: schema version {metadata.get('schema_version')}",
            expected=f"version {SCHEMA_VERSION}",
            mend="prepare the rows again with this version of descentflow",
        )
    return Descents(checked_descents(frame, path), metadata)


def read_description(path: str | Path) -> dict[str, Any]:
    """Description of a file of prepared descents, without reading them."""
    if not Path(path).is_file():
        raise DataError(f"no file {path}", expected="prepared descents", mend=MEND)
    with whole_input(path, "a whole Parquet file", MEND):
        metadata = pl.read_parquet_metadata(path)
    if KEY not in metadata:
        raise DataError(
            f"{path}: Parquet, but not prepared descents",
            expected="a prepared table",
            mend=f"{MEND}; saved again by another program a table lacks how it was prepared",
        )
    return described(metadata[KEY], path)


def _read_file(path: str | Path) -> tuple[pl.DataFrame, dict[str, Any]]:
    description = read_description(path)
    with whole_input(path, "a whole Parquet file", MEND):
        check_pages(Path(path))
        return pl.read_parquet(path), description


def join_descents(parts: Sequence[Descents], names: Sequence[str]) -> Descents:
    """All descents of several prepared files, sorted by flight.

    Their settings are known afterwards if they are known of every part.
    """
    first = parts[0]
    if len(parts) == 1:
        return first
    for part, name in zip(parts[1:], names[1:], strict=True):
        _check_alike({names[0]: first, name: part})
    frame = pl.concat([part.frame for part in parts], how="diagonal").sort("flight_id", maintain_order=True)
    flights = pl.concat([part.frame.select("flight_id").unique() for part in parts])
    twice = flights["flight_id"].filter(flights["flight_id"].is_duplicated())
    if len(twice):
        raise DataError(
            f"flight {twice[0]} in two of {', '.join(names)}",
            expected="every flight once",
            mend="prepare the rows of all of them together",
        )
    return Descents(frame, _joined_metadata(parts, frame))


def _check_alike(parts: Mapping[str, Descents]) -> None:
    """Refuse two parts that were cleaned with different settings, as far as these are known."""
    known = {name: part.cleaning for name, part in parts.items() if part.cleaning is not None}
    lowest = {name: Cleaning(bottom_fl=part.bottom_fl) for name, part in parts.items()}
    if words := differences_in_words(known if len(known) == len(parts) else lowest):
        raise DataError(
            f"descents of different cleaning settings: {words}",
            expected="descents that were all prepared with the same settings",
            mend="prepare their rows with the same settings",
        )


def _joined_metadata(parts: Sequence[Descents], frame: pl.DataFrame) -> dict[str, Any]:
    metadata = {**parts[0].metadata, "top_fl": top_levels(frame)}
    if any(part.cleaning is None for part in parts):
        metadata.pop("settings", None)
    metadata["inputs"] = [one for part in parts for one in part.metadata.get("inputs", [])]
    reports = [part.metadata.get("report") for part in parts]
    metadata.pop("report", None)
    if all(isinstance(report, dict) for report in reports):
        together = DropReport()
        together.extend([DropReport.from_dict(report) for report in reports if report])
        metadata["report"] = together.as_dict()
    return metadata
