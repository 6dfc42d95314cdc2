"""Where partitions are worked on: threads of this process, or the workers of a Dask cluster; the code is the same."""

import json
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any, TypeVar

import polars as pl

from descentflow import __version__
from descentflow.errors import ConfigError, DataError
from descentflow.files import whole_file
from descentflow.surveillance.cleaning import Work, clean
from descentflow.surveillance.descents import KEY
from descentflow.surveillance.store import ROW_GROUP

Task = TypeVar("Task")


@dataclass(frozen=True)
class Partition:
    """Rows of some aircraft in files, and the file that their descents go to."""

    files: tuple[Path, ...]
    target: Path

    @property
    def fates(self) -> Path:
        """File of the flights that are shown, where some are wanted."""
        return self.target.parent.parent / "fates" / self.target.name


def clean_partition(partition: Partition, work: Work) -> None:
    """Clean the rows of some aircraft into a file that appears whole; nothing if it is there already.

    The file's metadata hold the report and the rows of each type.
    """
    if partition.target.exists():
        return
    rows = pl.concat([pl.read_ipc(path) for path in partition.files], how="diagonal")
    outcome = clean(rows, work)
    if outcome.fates is not None:
        partition.fates.parent.mkdir(exist_ok=True)
        with whole_file(partition.fates) as temporary:
            outcome.fates.write_parquet(temporary)
    described = json.dumps({"report": outcome.report.as_dict(), "present": outcome.present})
    with whole_file(partition.target) as temporary:
        outcome.levels.write_parquet(temporary, metadata={KEY: described}, compression="lz4", row_group_size=ROW_GROUP)


class Engine(ABC):
    """Runs a function on tasks."""

    workers: int

    @abstractmethod
    def run(self, function: Callable[[Task, Any], object], tasks: Sequence[Task], common: object) -> Iterator[None]:
        """Yield as often as a task is done; the first error ends it."""


@dataclass
class LocalEngine(Engine):
    """Threads of this process: Polars and NumPy let others run while they compute."""

    workers: int

    def run(self, function: Callable[[Task, Any], object], tasks: Sequence[Task], common: object) -> Iterator[None]:
        """See :class:`Engine`."""
        with ThreadPoolExecutor(max_workers=self.workers) as pool:
            waiting = [pool.submit(function, task, common) for task in tasks]
            try:
                for done in as_completed(waiting):
                    done.result()
                    yield
            finally:
                pool.shutdown(cancel_futures=True)


@dataclass
class DaskEngine(Engine):
    """Workers of a Dask cluster: the one at an address, or processes on this machine.

    All must see the same files under the same names, and have this version of descentflow. A task whose worker dies
    is run again by another.
    """

    workers: int = 2
    scheduler: str | None = None

    def run(self, function: Callable[[Task, Any], object], tasks: Sequence[Task], common: object) -> Iterator[None]:
        """See :class:`Engine`."""
        try:
            distributed: Any = import_module("distributed")
        except ImportError as error:
            raise ConfigError(
                "--engine dask, but dask.distributed is not installed",
                expected="the extra `dask`",
                mend="pip install 'descentflow[dask]'",
            ) from error
        try:
            cluster = self.scheduler or distributed.LocalCluster(
                n_workers=self.workers, threads_per_worker=1, memory_limit=0, dashboard_address=None
            )
            client = distributed.Client(cluster, timeout=30)
        except (OSError, ValueError, TypeError) as error:
            raise ConfigError(
                f"no Dask scheduler at {self.scheduler} ({error})",
                expected="an address such as tcp://host:8786",
                mend="start one with `dask scheduler`, or leave --scheduler out for local workers",
            ) from error
        try:
            _check_versions(client)
            shared = client.scatter(common, broadcast=True, hash=False)
            futures = client.map(function, tasks, [shared] * len(tasks), pure=False, key=function.__name__)
            for future in distributed.as_completed(futures):
                # What tasks return is of no use, and might be asked of a worker that is dead by now.
                if future.status != "finished":
                    future.result()
                yield
        finally:
            client.close()
            if not isinstance(cluster, str):
                cluster.close()


def _check_versions(client: Any) -> None:
    """Refuse workers that would clean by other rules."""
    client.wait_for_workers(1, timeout=60)
    found = set(client.run(version).values())
    if found != {version()}:
        raise DataError(
            f"workers with {', '.join(sorted(found))}",
            expected=f"{version()} everywhere",
            mend="install the same versions on all workers",
        )


def version() -> str:
    """What decides on how rows are spread and cleaned."""
    return f"descentflow {__version__}, Polars {pl.__version__}"
