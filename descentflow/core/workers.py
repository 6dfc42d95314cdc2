"""Parallel work by joblib: threads or processes of this machine, or a Dask cluster; results do not depend on which."""

import os
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import BrokenExecutor
from contextlib import ExitStack
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, Literal, TypeVar

import polars as pl
from joblib import Parallel, delayed, parallel_config

from descentflow.core.errors import ConfigError, DataError
from descentflow.core.tabular import optional_library
from descentflow.core.version import __version__

Task = TypeVar("Task")
MOST_WORKERS = 1024
"""More are a slip of the hand: the largest machines have fewer processors."""
STARTS = 3
"""Times that Dask's workers on this machine are started before that is given up."""


@dataclass
class Engine:
    """Runs a function on tasks.

    All workers of a cluster must see the same files under the same names, and have this version of descentflow. A task
    whose worker dies is run again by another.

    Attributes:
        workers: Tasks at a time; of a cluster, those that share its memory.
        backend: Of joblib.
        scheduler: Of Dask: a `Client`, the address of a scheduler or its file; workers of this machine if absent.
        options: Of joblib's backend.

    Example:
        >>> done = []
        >>> for _ in Engine(workers=2).run(lambda task, common: done.append(task * common), [1, 2, 3], 10):
        ...     pass
        >>> sorted(done)
        [10, 20, 30]
    """

    workers: int = 1
    backend: Literal["threading", "loky", "dask"] = "threading"
    scheduler: Any = None
    options: dict[str, Any] = field(default_factory=dict)

    @property
    def shares_memory(self) -> bool:
        """True for threads of this process."""
        return self.backend == "threading"

    def run(
        self,
        function: Callable[[Task, Any], object],
        tasks: Sequence[Task],
        common: object,
        progress: Callable[[str], None] = lambda _: None,
    ) -> Iterator[None]:
        """Yield once per finished task; the first error ends the run, and tasks that have not begun.

        Args:
            function: Called with each task and the arguments common to all; its results are not fetched.
            tasks: Each alone is what a worker does.
            common: Same for all tasks.
            progress: Called where workers of a cluster are waited for.

        Raises:
            ConfigError: If there is no such scheduler.
            DataError: If workers have other versions, or are killed.
        """
        call = partial(_called, function, common)
        with ExitStack() as stack:
            if self.backend == "dask":
                results = self._by_dask(call, tasks, progress, stack)
            else:
                parallel = Parallel(
                    self.workers,
                    backend=self.backend,
                    batch_size=1,
                    pre_dispatch="all",
                    return_as="generator_unordered",
                    **self.options,
                )
                results = results_of(parallel, (delayed(call)(task) for task in tasks))
            try:
                for _ in results:
                    yield
            except BrokenExecutor as error:
                raise DataError(
                    "a worker was killed, which the system does where memory runs out",
                    expected="workers that run to their end",
                    mend="start it again, which goes on with what is not done yet; with fewer --workers if it happens "
                    "again",
                ) from error

    def _by_dask(
        self, call: Callable[[Task], None], tasks: Sequence[Task], progress: Callable[[str], None], stack: ExitStack
    ) -> Iterator[None]:
        """Results from a cluster, once it has workers."""
        distributed: Any = optional_library("distributed", "dask")
        client = self._client(distributed, stack)
        if not client.nthreads():
            progress(f"waiting for workers of {client.scheduler.address}")
        client.wait_for_workers(1)
        _check_versions(client)
        futures = client.map(call, tasks, pure=False)
        stack.callback(client.cancel, futures)
        try:
            for done in distributed.as_completed(futures):
                yield done.result()
        except distributed.KilledWorker as error:
            raise BrokenExecutor(str(error)) from error

    def _client(self, distributed: Any, stack: ExitStack) -> Any:
        """The user's client, or one that is closed with the stack."""
        if isinstance(self.scheduler, distributed.Client):
            return self.scheduler
        place = self.scheduler or stack.enter_context(self._local_cluster(distributed))
        by_file = str(place).endswith(".json")
        try:
            if by_file and not Path(place).is_file():
                raise OSError("no such file")  # Dask would wait for it for ever
            client = distributed.Client(**{"scheduler_file" if by_file else "address": place}, timeout=30)
        except (OSError, ValueError, TypeError) as error:
            raise ConfigError(
                f"no Dask scheduler at {self.scheduler} ({error})",
                expected="an address such as tcp://host:8786, or the scheduler file that `dask scheduler` writes",
                mend="start one with `dask scheduler`, or leave --scheduler out for local workers",
            ) from error
        return stack.enter_context(client)

    def _local_cluster(self, distributed: Any) -> Any:
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


def results_of(parallel: Parallel, calls: Iterable[Any]) -> Iterator[Any]:
    """Results of joblib's generator, which would warn of those that a caller who stops does not take.

    Example:
        >>> parallel = Parallel(2, backend="threading", return_as="generator")
        >>> list(results_of(parallel, [delayed(abs)(-1), delayed(abs)(2)]))
        [1, 2]
    """
    results = parallel(calls)
    try:
        for result in results:  # noqa: UP028 - it would be closed, and warn, before the filter below
            yield result
    finally:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)
            results.close()


def engine_of(engine: Any = None, workers: int | None = None) -> Engine:
    """An engine as a user names it.

    Args:
        engine: Threads of this process if None or ``local``; ``dask`` for Dask's workers on this machine; the address
            of a Dask scheduler, the path of its file (``.json``), or a `distributed.Client`; or an engine.
        workers: Threads, or Dask's workers on this machine; as many as there are processors if absent.

    Raises:
        ConfigError: If it is none of these, or there are too many workers.

    Example:
        >>> engine_of("tcp://host:8786", 2)  # it connects when it runs
        Engine(workers=2, backend='dask', scheduler='tcp://host:8786', options={})
    """
    if isinstance(engine, Engine):
        return engine
    number = workers or os.cpu_count() or 1
    if number > MOST_WORKERS:
        raise ConfigError(f"{number:,} workers", expected=f"{MOST_WORKERS:,} at most", mend="leave the number out")
    if engine is None or (isinstance(engine, str) and engine == "local"):
        return Engine(number)
    if isinstance(engine, str | Path) or hasattr(engine, "wait_for_workers"):
        return Engine(number, "dask", None if engine == "dask" else engine)
    raise ConfigError(
        f"an engine of type {type(engine).__name__}",
        expected="local, dask, the address or the file of a Dask scheduler, or a distributed.Client",
        mend="leave it out for threads of this process",
    )


def _called(function: Callable[[Task, Any], object], common: object, task: Task) -> None:
    with parallel_config(backend="sequential"):  # within a worker of Dask, joblib would send parts to the others
        function(task, common)


def _check_versions(client: Any) -> None:
    """Refuse workers with other versions; one that dies meanwhile has none."""
    answers = client.run(version, on_error="return").values()
    versions = {str(answer) for answer in answers if not isinstance(answer, OSError)} | {version()}
    if versions != {version()}:
        raise DataError(
            f"workers with {', '.join(sorted(versions - {version()}))}",
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
