"""Threads of torch and Polars, which a forked copy of a process lacks; imported before torch."""

import os
import re
import sys
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext, suppress
from pathlib import Path

from descentflow.core.errors import ConfigError

SPIN = "torch" in sys.modules and not os.environ.keys() & {"OMP_WAIT_POLICY", "OMP_NUM_THREADS"}
"""True if torch was loaded first with the default wait policy: its idle threads then spin and slow other work."""

# With other work running one descent took 53 ms instead of 8. Whoever sets it themselves keeps what they set.
os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")


def one_thread_by_default() -> None:
    """Let torch use one thread, unless OMP_NUM_THREADS is set.

    Arrays of a few hundred flights are too small to share: on two busy cores a training step took nine times longer.
    """
    import torch

    if "OMP_NUM_THREADS" not in os.environ:
        torch.set_num_threads(1)


@contextmanager
def one_thread() -> Iterator[None]:
    """Keep torch to one thread inside the block: with a few thousand numbers a second one costs ten times its gain."""
    import torch

    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(threads)


@contextmanager
def one_thread_where_they_spin() -> Iterator[None]:
    """Keep torch to one thread inside the block if its threads spin while they wait, see :data:`SPIN`.

    On two cores busy with other work a thousand descents took 1.7 s instead of 0.1 s, scores 75 s instead of 14 s.
    """
    with one_thread() if SPIN else nullcontext():
        yield


class _Copy:
    """Forked copy of a process: it lacks the threads of Polars if they had begun there, and keeps torch to one."""

    begun = lacks_threads = False

    @classmethod
    def before(cls) -> None:
        names = []
        for task in Path("/proc/self/task").glob("*/comm"):
            with suppress(OSError):  # a thread that has ended meanwhile
                names.append(task.read_text())
        cls.begun = any(re.match(r"polars-\d", name) for name in names) if names else "polars" in sys.modules

    @classmethod
    def after(cls) -> None:
        cls.lacks_threads |= cls.begun
        set_num_threads = getattr(sys.modules.get("torch"), "set_num_threads", None)
        if set_num_threads is not None:
            set_num_threads(1)


if hasattr(os, "register_at_fork"):
    os.register_at_fork(before=_Copy.before, after_in_child=_Copy.after)


def check_not_forked() -> None:
    """Refuse to work on tables in a forked copy: Polars would wait for threads that it has not, without an end.

    Raises:
        ConfigError: If this process was forked after Polars had begun its threads.
    """
    if _Copy.lacks_threads:
        raise ConfigError(
            "a table in a process that was forked after Polars had begun its threads, which would wait for ever",
            expected="a process begun afresh, or forked before anything was read",
            mend="take multiprocessing.get_context('spawn')",
        )
