"""Tasks in processes of this machine, as the package runs them in threads or on a Dask cluster."""

import os
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import BrokenExecutor, ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context, parent_process
from multiprocessing.connection import wait
from typing import Any

from descentflow.core.workers import Engine, Task, each_of, killed


@dataclass
class ProcessEngine(Engine):
    """Processes of this machine, begun afresh; with one worker this process itself, one task after another.

    For work that draws, trains or prints, which threads of one process cannot do at the same time.

    Example:
        >>> done = []
        >>> for _ in ProcessEngine(workers=1).run(lambda task, common: done.append(task), ["a", "b"], None):
        ...     pass
        >>> done
        ['a', 'b']
    """

    workers: int

    def run(self, function: Callable[[Task, Any], object], tasks: Sequence[Task], common: object) -> Iterator[None]:
        """See :class:`Engine`; the function and the tasks must be importable by a new process."""
        if self.workers == 1 or len(tasks) <= 1:
            for task in tasks:
                function(task, common)
                yield
            return
        pool = ProcessPoolExecutor(
            min(self.workers, len(tasks)), mp_context=get_context("spawn"), initializer=end_with_parent
        )
        try:
            yield from each_of(pool, function, tasks, common)
        except BrokenExecutor as error:
            raise killed() from error


def end_with_parent() -> None:
    """Let this process end when the one that began it is killed; it would go on, and wait for work for ever.

    Example:
        >>> pool = ProcessPoolExecutor(2, initializer=end_with_parent)
    """

    def watch() -> None:
        parent = parent_process()
        if parent is not None:
            wait([parent.sentinel])
            os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
