"""Number of torch's threads in commands that work flight by flight or batch by batch."""

import os
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext

import torch

from descentflow.core import waiting_threads


def one_thread_unless_told() -> None:
    """Let torch use one thread, unless OMP_NUM_THREADS is set.

    Arrays of a few hundred flights are too small to share: on two busy cores a training step took nine times longer.

    Example:
        >>> one_thread_unless_told()
        >>> torch.get_num_threads() == 1 or "OMP_NUM_THREADS" in os.environ
        True
    """
    if "OMP_NUM_THREADS" not in os.environ:
        torch.set_num_threads(1)


@contextmanager
def one_thread() -> Iterator[None]:
    """Keep torch to one thread inside the block: on a few thousand numbers a second one costs ten times what it saves.

    Example:
        >>> with one_thread():
        ...     torch.get_num_threads()
        1
    """
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(threads)


@contextmanager
def one_thread_where_they_spin() -> Iterator[None]:
    """Keep torch to one thread inside the block if its threads spin while they wait, see :mod:`.waiting_threads`.

    On two cores busy with other work a thousand descents took 1.7 s instead of 0.1 s, scores 75 s instead of 14 s.

    Example:
        >>> @one_thread_where_they_spin()
        ... def threads():
        ...     return torch.get_num_threads()
        >>> threads() in (1, torch.get_num_threads())
        True
    """
    with one_thread() if waiting_threads.SPIN else nullcontext():
        yield
