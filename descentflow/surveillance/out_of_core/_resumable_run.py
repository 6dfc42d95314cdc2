"""Rows of any amount to a file or a store of descents: in bounded memory, and resumed where a killed run stopped."""

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import polars as pl

from descentflow.core.errors import ConfigError, DataError
from descentflow.core.files import OF_THE_DISK, check_output, check_separate, system_number
from descentflow.core.workers import Engine
from descentflow.surveillance._intake import clean_held, take_in
from descentflow.surveillance._request import PreparationRequest, description
from descentflow.surveillance.cleaning.drop_report_checks import nothing_left
from descentflow.surveillance.descents import store
from descentflow.surveillance.descents.prepared_descents import Descents, read_descents
from descentflow.surveillance.out_of_core._groups import read_groups
from descentflow.surveillance.out_of_core._job import fingerprint, job_folder, remove_work, work_folder
from descentflow.surveillance.out_of_core._partitions import Cleaned, clean_partitions
from descentflow.surveillance.out_of_core.spill import Bucket, Memory
from descentflow.surveillance.rows.drop_report import some_flights

TABLE_ENDINGS = (".csv", ".tsv", ".txt", ".json", ".jsonl", ".feather", ".arrow", ".ipc", ".pq", ".xlsx", ".html")
OTHER_ENDINGS = frozenset((*TABLE_ENDINGS, ".yaml", ".gz", ".zip", ".tar", ".pickle", ".pkl", ".h5", ".nc"))
"""Names of other formats, which nobody gives a folder."""
Progress = Callable[[str], None]


def prepare_to(out: Path, request: PreparationRequest, memory: Memory, engine: Engine, progress: Progress) -> Descents:
    """Prepare rows to a file (a name that ends in .parquet) or a store by type (any other name).

    Rows that do not fit in memory are distributed over partitions of whole aircraft on disk, in a folder next to the
    output. A run that was killed leaves there what is done, and the same call resumes from it. The descents do not
    depend on memory, engine, partitions or interruptions.

    Args:
        out: File or folder.
        request: What is to be prepared.
        memory: Bound on this process, and on each worker.
        engine: Where partitions are cleaned.
        progress: Progress callback.

    Returns:
        The descents; their table is read when it is first used.

    Raises:
        DataError: If the rows cannot be used, or no descent is left.
        ConfigError: If the output cannot be written, is an input, or belongs to another run.

    Example:
        >>> from descentflow.core.workers import Engine
        >>> request, memory = PreparationRequest(["rows.parquet"]), Memory(2_000_000_000)
        >>> prepare_to(Path("prepared.parquet"), request, memory, Engine(), lambda stage: None).flights
        {'A320': 120}
    """
    _check_ending(out)
    check_separate([out], [Path(source) for source in request.rows if not isinstance(source, pl.DataFrame)])
    # An output inside a folder of inputs, and what an earlier run left next to it, are no inputs.
    own = (out.resolve(), work_folder(out).resolve())
    files = [path for path in request.files() if not any(path.resolve().is_relative_to(file) for file in own)]
    progress("hashing inputs")
    facts = request.facts(files)
    is_store = out.suffix != ".parquet"
    if is_store and (before := _finished(out, facts)):
        if request.shown:
            raise ConfigError(
                f"{out} is finished, and flights are shown while they are cleaned",
                expected="a store that is not there yet",
                mend="choose another --out",
            )
        remove_work(out)
        progress("found finished")
        return before
    if not (is_store and out.is_dir()):
        check_output(out)
    try:
        with job_folder(out, facts) as folder:
            progress("reading rows")
            # Rows given in memory are there already: nothing is saved by putting them on disk.
            held: list[pl.DataFrame] = []
            buckets: list[Bucket] = []
            if request.tables:
                intake = take_in([*request.tables, *files], request, held.append)
            else:
                intake, held, buckets = read_groups(request, files, folder, memory, engine, progress)
            if buckets and not intake.report.steps[-1].rows_left:
                raise nothing_left(intake.report, request.cleaning)
            if buckets:
                cleaned = clean_partitions(request, intake, buckets, folder, memory, engine, progress)
            else:
                one = clean_held(held, intake, request, engine.workers, progress)
                cleaned = Cleaned([one.levels.lazy()], intake.report, one.dropped_rows, [one.level_flight])
            return _written(out, cleaned, request, facts, folder, progress)
    except Exception as error:
        if not isinstance(error, OSError) and system_number(error) not in OF_THE_DISK:
            raise
        raise DataError(
            f"{out}: {error}", expected="room and permission to write", mend="free or choose a disk"
        ) from error


def _finished(out: Path, facts: dict[str, Any]) -> Descents | None:
    """The descents of a store that an earlier run has finished with the same inputs and settings, if there is one.

    Raises:
        ConfigError: If the folder is something else, or a store of other inputs or settings.
    """
    if not out.exists() or (out.is_dir() and not any(out.iterdir())):
        return None
    if not out.is_dir() or not (out / store.MANIFEST).is_file():
        raise ConfigError(
            f"output {out} exists and is no prepared store",
            expected="a name of its own for the store's folder, or a file that ends in .parquet",
            mend="choose another --out",
        )
    manifest = store.read_manifest(out)
    if manifest.get("fingerprint") != fingerprint(facts):
        raise ConfigError(
            f"{out} is a store of other inputs or settings",
            expected="those of its manifest, or a folder of its own",
            mend="delete it, or choose another --out",
        )
    flights = {file["typecode"]: file["flights_of_type"] for file in manifest["files"] if "flights_of_type" in file}
    described = {key: value for key, value in manifest.items() if key not in ("files", "columns")}
    return Descents(lambda: read_descents(out).frame, described, flights=flights)


def _check_ending(out: Path) -> None:
    """Refuse a name that asks for another format: a folder of Parquet files would get it."""
    if not out.name:
        raise ConfigError(f"output {out}", expected="the name of a file or a folder", mend="add a name to it")
    if out.suffix.lower() in OTHER_ENDINGS and not out.is_dir():
        raise ConfigError(
            f"output {out}, while descents are written as Parquet",
            expected="a name that ends in .parquet, or that of a folder for a store of Parquet files by type",
            mend=f"choose {out.with_suffix('.parquet').name}, which other libraries read",
        )


def _written(
    out: Path, cleaned: Cleaned, request: PreparationRequest, facts: dict[str, Any], folder: Path, progress: Progress
) -> Descents:
    parts = store.Parts.of(cleaned.levels)
    if parts.flights.is_empty():
        raise nothing_left(cleaned.report, request.cleaning)
    metadata = description(facts, cleaned.report, parts.flights)
    progress("writing descents")
    if out.suffix == ".parquet":
        store.write_file(parts, metadata, out)
    else:
        made = folder / "store"
        shutil.rmtree(made, ignore_errors=True)
        store.write_store(parts, {**metadata, "fingerprint": fingerprint(facts)}, made)
        made.replace(out)
    flights = dict(parts.flights["typecode"].value_counts().sort("typecode").iter_rows())
    shown = some_flights(pl.concat(cleaned.dropped_rows), request.shown) if cleaned.dropped_rows else None
    level = pl.concat(cleaned.level_flight)
    return Descents(lambda: read_descents(out).frame, metadata, flights=flights, dropped_rows=shown, level_flight=level)
