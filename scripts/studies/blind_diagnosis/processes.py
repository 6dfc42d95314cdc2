"""Work of a study spread over processes, each replaced before long, and how long it takes."""

import logging
import multiprocessing
import time
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from typing import Any

from studies.process_engine import end_with_parent

TASKS_PER_PROCESS = 25
"""After which processes are replaced by fresh ones: what a diagnosis leaves in memory does not add up."""


def pace(begun: float, done: int, total: int) -> str:
    """Time that each took, and that the rest will take.

    Args:
        begun: By the monotonic clock.
        done: How many are done.
        total: Of how many.

    Example:
        >>> pace(time.monotonic() - 60.0, done=6, total=12)
        '10.0 s each, 1 min to go'
    """
    each = (time.monotonic() - begun) / done
    return f"{each:.1f} s each, {each * (total - done) / 60:.0f} min to go"


def spread(work: Sequence[tuple[Any, ...]], processes: int, count: Callable[[int], None]) -> None:
    """Call functions with their arguments, in this process or in several, and count those that are done.

    Args:
        work: A function and its arguments each, which can be pickled.
        processes: How many work at once.
        count: Called with how many are done.

    Raises:
        Exception: What the first function to fail raised; the rest are not begun.

    Example:
        >>> spread([(print, "one"), (print, "two")], 1, lambda done: print(done, "done"))
        one
        1 done
        two
        2 done
    """
    if processes == 1:
        for done, (function, *arguments) in enumerate(work, start=1):
            function(*arguments)
            count(done)
        return
    # Spawned, for a forked process inherits torch's threads in whatever state they are. A pool for each share of the
    # work: one that replaces its own processes (max_tasks_per_child) stops for ever if all end at once (Python 3.11).
    context, share, done = multiprocessing.get_context("spawn"), processes * TASKS_PER_PROCESS, 0
    for begin in range(0, len(work), share):
        with ProcessPoolExecutor(processes, mp_context=context, initializer=_alone) as pool:
            futures = [pool.submit(function, *arguments) for function, *arguments in work[begin : begin + share]]
            for future in _finished(futures):
                future.result()
                done += 1
                count(done)


def _finished(futures: list[Future[Any]]) -> Iterable[Future[Any]]:
    """Futures as they finish; the first error cancels the rest."""
    try:
        yield from as_completed(futures)
    except BaseException:
        for future in futures:
            future.cancel()
        raise


def _alone() -> None:
    """A worker keeps to one thread, prints nothing, and ends with the study that it works for."""
    import torch

    end_with_parent()
    torch.set_num_threads(1)
    logging.getLogger("lightning.pytorch").setLevel(logging.ERROR)
