"""Prepared descents on disk: one file or a store by type, written from parts that are sorted by flight, and described.

A store is a folder: ``typecode=A320/part-00000.parquet`` and so on, as Hive, Spark, DuckDB, Polars and Arrow read it,
and ``_descentflow.json``, which describes it (schema version, inputs with hashes, settings, report) and lists its
files.
"""

import itertools
import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import quote

import orjson
import polars as pl
from polars.io.plugins import register_io_source

from descentflow.core.errors import ConfigError, DataError
from descentflow.core.files import whole_file, write_whole
from descentflow.core.parquet_pages import check_pages
from descentflow.surveillance.rows.drop_report import DropReport
from descentflow.surveillance.unpacking import whole_input

SCHEMA_VERSION = 1
KEY = "descentflow"
"""Key of the Parquet metadata that holds the description."""
DESCRIPTION_TYPES: dict[str, tuple[type, ...]] = {
    "schema_version": (int,),
    "bottom_fl": (int, float),
    "top_fl": (dict,),
    "settings": (dict,),
    "typecodes": (list, str),
    "inputs": (list,),
    "report": (dict,),
}
"""Entries of a description -> the types that they may have; an absent one is not known."""
MEND = "pass the Parquet file or the folder that `descentflow prepare` wrote"


def described(text: str, path: str | Path) -> dict[str, Any]:
    """The description of a prepared table."""
    try:
        known = orjson.loads(text)  # which has no number that is not finite
    except ValueError:
        known = None
    if not isinstance(known, dict):
        raise DataError(f"{path}: a damaged description", expected="a JSON object in the metadata", mend=MEND)
    wrong = [name for name, kinds in DESCRIPTION_TYPES.items() if not isinstance(known.get(name), (*kinds, type(None)))]
    tops = known.get("top_fl") or {}
    if not wrong and not all(isinstance(top, int | float) for top in tops.values()):
        wrong = ["top_fl"]
    if not wrong and not _is_report(known.get("report") or {}):
        wrong = ["report"]
    if wrong:
        raise DataError(
            f"{path}: a damaged description ({wrong[0]} is {str(known[wrong[0]])[:60]})",
            expected="the description that `descentflow prepare` writes",
            mend=MEND,
        )
    return known


def _is_report(report: dict[str, Any]) -> bool:
    """True for a report of ``prepare``: counts of rows and flights by step, and notes of what changed."""
    try:
        return not report or all(isinstance(number, int) for number in DropReport.from_dict(report).notes.values())
    except (KeyError, TypeError, ValueError, ConfigError):
        return False


MANIFEST = "_descentflow.json"
"""Hive and Spark ignore names that begin with an underscore."""
CHUNK_ROWS = 250_000
"""Levels that are merged at a time, some 45 MB."""
FILE_ROWS = 2_000_000
"""Levels in a file of a store, to the next flight."""
ROW_GROUP = 32_768
"""Rows of a row group in the files of partitions, so that a range of flights is read without reading all of a file."""


@dataclass(frozen=True)
class Parts:
    """Levels of descents in files, or in one frame, with the flights that they hold.

    Attributes:
        sources: Lazy frames, each sorted by flight and falling level, no flight in two.
        flights: Columns `flight_id typecode level_fl rows`: highest level and number of levels; sorted by flight.
    """

    sources: Sequence[pl.LazyFrame]
    flights: pl.DataFrame

    @classmethod
    def of(cls, sources: Sequence[pl.LazyFrame]) -> "Parts":
        """Look up the flights of sources."""
        tables = [
            source.group_by("flight_id", "typecode").agg(pl.col("level_fl").max(), pl.len().alias("rows"))
            for source in sources
        ]
        return cls(sources, pl.concat(pl.collect_all(tables)).sort("flight_id"))

    def chunks(self, *typecode: str) -> Iterator[pl.DataFrame]:
        """Levels of all descents, or of one type's, by flight, some at a time."""
        of_type = pl.col("typecode").is_in(typecode) if typecode else pl.lit(True)
        flights = self.flights.filter(of_type)
        number = flights["rows"].cum_sum() // CHUNK_ROWS
        for some in flights.with_columns(number.alias("_chunk")).partition_by("_chunk", maintain_order=True):
            wanted = pl.col("flight_id").is_between(pl.lit(some["flight_id"][0]), pl.lit(some["flight_id"][-1]))
            levels = pl.concat(pl.collect_all([source.filter(wanted, of_type) for source in self.sources]))
            yield levels.sort("flight_id", maintain_order=True)

    @property
    def schema(self) -> pl.Schema:
        """Columns of all sources."""
        return self.sources[0].collect_schema()


def write_file(parts: Parts, metadata: dict[str, Any], path: Path) -> None:
    """Write one Parquet file with its description, chunk by chunk, whole or not at all."""
    with whole_file(path) as temporary:
        _write(parts.chunks(), parts.schema, temporary, {KEY: json.dumps(metadata)})


def write_store(parts: Parts, metadata: dict[str, Any], folder: Path) -> None:
    """Write a store into a folder that does not exist yet; it is whole once its manifest is there."""
    files = []
    for (typecode,), flights in parts.flights.group_by("typecode", maintain_order=True):
        name = folder / f"typecode={quote(str(typecode), safe='')}"
        name.mkdir(parents=True)
        chunks = (chunk.drop("typecode") for chunk in parts.chunks(str(typecode)))
        schema = pl.Schema({key: kind for key, kind in parts.schema.items() if key != "typecode"})
        for number in itertools.count():
            first = next(chunks, None)
            if first is None:
                break
            path = name / f"part-{number:05d}.parquet"
            several = itertools.chain([first], itertools.islice(chunks, FILE_ROWS // CHUNK_ROWS - 1))
            _write(several, schema, path, {})
            rows = pl.scan_parquet(path, hive_partitioning=False).select(pl.len()).collect().item()
            files.append({"path": path.relative_to(folder).as_posix(), "typecode": typecode, "rows": rows})
        files[-1]["flights_of_type"] = len(flights)
    about = {**metadata, "columns": parts.schema.names(), "files": files}
    write_whole(folder / MANIFEST, json.dumps(about, indent=1))


def read_manifest(folder: Path) -> dict[str, Any]:
    """Description of a store."""
    path = folder / MANIFEST
    try:
        return described(path.read_text(encoding="utf-8"), path)
    except (OSError, UnicodeDecodeError) as error:
        raise DataError(f"{folder} without a readable {MANIFEST}", expected="a prepared store", mend=MEND) from error


def read_store(folder: Path) -> tuple[pl.DataFrame, dict[str, Any]]:
    """All levels of a store, by flight, and its description."""
    metadata = read_manifest(folder)
    frames = []
    try:
        for file in metadata["files"]:
            path = folder / file["path"]
            with whole_input(path, "a store as it was written", MEND):
                check_pages(path)
                frame = pl.read_parquet(path, hive_partitioning=False)
            if len(frame) != file["rows"]:
                raise DataError(f"{path}: {len(frame)} rows", expected=f"{file['rows']} rows", mend=MEND)
            frames.append(frame.with_columns(pl.lit(file["typecode"]).alias("typecode")).select(metadata["columns"]))
        whole = pl.concat(frames)
    except (pl.exceptions.PolarsError, OSError) as error:
        reason = str(error).splitlines()[0]
        raise DataError(f"{folder}: {reason}", expected="a store as it was written", mend=MEND) from error
    except (KeyError, TypeError, ValueError) as error:
        raise DataError(f"{folder / MANIFEST}: damaged ({error!r})", expected="its list of files", mend=MEND) from error
    described_only = {key: value for key, value in metadata.items() if key not in ("files", "columns")}
    return whole.sort("flight_id", maintain_order=True), described_only


def _write(chunks: Iterator[pl.DataFrame], schema: pl.Schema, path: Path, metadata: dict[str, str]) -> None:
    """Write chunks to one file: at once if there are few, else one after the other."""
    few = list(itertools.islice(chunks, 2))
    if len(few) < 2:
        pl.concat([schema.to_frame(), *few]).write_parquet(path, metadata=metadata)
        return

    def batches(columns: list[str] | None, *_: object) -> Iterator[pl.DataFrame]:
        for chunk in itertools.chain(few, chunks):
            yield chunk if columns is None else chunk.select(columns)

    register_io_source(batches, schema=schema).sink_parquet(path, metadata=metadata, row_group_size=CHUNK_ROWS)
