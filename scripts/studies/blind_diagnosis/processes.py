"""Work of a study spread over processes, each replaced before long, and how long it takes."""

import logging
import time
from collections.abc import Callable, Sequence
from typing import Any

from joblib.externals.loky import get_reusable_executor

from studies import process_engine

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
    share, done = processes * TASKS_PER_PROCESS, 0
    for begin in range(0, len(work), share):
        for _ in process_engine.processes(processes).run(_called, work[begin : begin + share], None):
            done += 1
            count(done)
        if processes > 1:
            get_reusable_executor().shutdown()


def _called(work: tuple[Any, ...], _: None) -> None:
    logging.getLogger("lightning.pytorch").setLevel(logging.ERROR)
    function, *arguments = work
    function(*arguments)
