"""Number of torch's threads, and how they wait: imported before torch, which is imported where it is asked."""

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext

SPIN = "torch" in sys.modules and not os.environ.keys() & {"OMP_WAIT_POLICY", "OMP_NUM_THREADS"}
"""True if torch was loaded first with the default wait policy: its idle threads then spin and slow other work."""

# Beside other work one descent took 53 ms instead of 8. Whoever sets it themselves keeps what they set.
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
