"""Execution of tasks in this process or on a Dask cluster, by the same code."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from functools import partial
from typing import Any, TypeVar

import polars as pl

from descentflow.core.errors import ConfigError, DataError
from descentflow.core.tabular import optional_library
from descentflow.core.version import __version__

Task = TypeVar("Task")
STARTS = 3
"""Times that Dask's workers on this machine are started before that is given up."""


class Engine(ABC):
    """Runs a function on tasks.

    Example:
        >>> engine: Engine = LocalEngine(workers=2)
        >>> engine.workers
        2
    """

    workers: int

    @abstractmethod
    def run(self, function: Callable[[Task, Any], object], tasks: Sequence[Task], common: object) -> Iterator[None]:
        """Yield once per finished task; the first error ends the run."""


def each_of(
    pool: Executor, function: Callable[[Task, Any], object], tasks: Sequence[Task], common: object
) -> Iterator[None]:
    """Yield as tasks finish; tasks that have not begun are cancelled when one fails or the caller stops.

    Example:
        >>> [None for _ in each_of(ThreadPoolExecutor(2), lambda task, common: None, [1, 2], None)]
        [None, None]
    """
    with pool:
        waiting = [pool.submit(function, task, common) for task in tasks]
        try:
            for done in as_completed(waiting):
                done.result()
                yield
        finally:
            pool.shutdown(cancel_futures=True)


def killed() -> DataError:
    """The error of a run whose worker was killed.

    Example:
        >>> print(killed())
        a worker was killed, which the system does where memory runs out; expected ...
    """
    return DataError(
        "a worker was killed, which the system does where memory runs out",
        expected="workers that run to their end",
        mend="start it again, which goes on with what is not done yet; with fewer --workers if it happens again",
    )


@dataclass
class LocalEngine(Engine):
    """Threads of this process: Polars and NumPy let others run while they compute.

    Example:
        >>> done = []
        >>> for _ in LocalEngine(workers=2).run(lambda task, common: done.append(task * common), [1, 2, 3], 10):
        ...     pass
        >>> sorted(done)
        [10, 20, 30]
    """

    workers: int

    def run(self, function: Callable[[Task, Any], object], tasks: Sequence[Task], common: object) -> Iterator[None]:
        """See :class:`Engine`."""
        yield from each_of(ThreadPoolExecutor(self.workers), function, tasks, common)


@dataclass
class DaskEngine(Engine):
    """Workers of a Dask cluster: the one at an address, or processes on this machine.

    All must see the same files under the same names, and have this version of descentflow. A task whose worker dies
    is run again by another.

    Example:
        >>> DaskEngine(scheduler="tcp://host:8786").scheduler  # it connects when it runs
        'tcp://host:8786'
    """

    workers: int = 2
    scheduler: str | None = None

    def run(self, function: Callable[[Task, Any], object], tasks: Sequence[Task], common: object) -> Iterator[None]:
        """See :class:`Engine`."""
        distributed: Any = optional_library("distributed", "dask")
        try:
            cluster = self.scheduler or self._begun(distributed)
            client = distributed.Client(cluster, timeout=30)
        except (OSError, ValueError, TypeError) as error:
            raise ConfigError(
                f"no Dask scheduler at {self.scheduler} ({error})",
                expected="an address such as tcp://host:8786",
                mend="start one with `dask scheduler`, or leave --scheduler out for local workers",
            ) from error
        try:
            _check_versions(client)
            # Data that is scattered is lost with the worker that dies before another one has it.
            work = partial(_called, function, common)
            futures = client.map(work, tasks, pure=False, key=function.__name__)
            for future in distributed.as_completed(futures):
                # Results are not fetched: nothing needs them, and their worker may be dead by now.
                if future.status != "finished":
                    future.result()
                yield
        except distributed.KilledWorker as error:
            raise killed() from error
        finally:
            client.close()
            if not isinstance(cluster, str):
                cluster.close()

    def _begun(self, distributed: Any) -> Any:
        """Workers on this machine; where one is killed while it starts, all are started again."""
        for _ in range(STARTS):
            try:
                return distributed.LocalCluster(
                    n_workers=self.workers, threads_per_worker=1, memory_limit=0, dashboard_address="127.0.0.1:0"
                )
            except RuntimeError as error:
                failed = f"{error.__cause__ or error}"
        raise DataError(
            f"Dask's workers did not start, {STARTS} times ({failed})",
            expected=f"memory and processes for {self.workers} workers",
            mend="start it again, with fewer --workers, or without --engine dask",
        )


def _called(function: Callable[[Task, Any], object], common: object, task: Task) -> None:
    function(task, common)


def _check_versions(client: Any) -> None:
    """Refuse workers with other versions."""
    client.wait_for_workers(1, timeout=60)
    found = set(client.run(version).values())
    if found != {version()}:
        raise DataError(
            f"workers with {', '.join(sorted(found))}",
            expected=f"{version()} everywhere",
            mend="install the same versions on all workers",
        )


def version() -> str:
    """Versions that all workers must share.

    Example:
        >>> version().startswith("descentflow ")
        True
    """
    return f"descentflow {__version__}, Polars {pl.__version__}"
