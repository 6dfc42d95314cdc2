"""How many threads torch may use in commands that work flight by flight or batch by batch."""

import os

import torch


def one_thread_unless_told() -> None:
    """Let torch use one thread, unless OMP_NUM_THREADS says otherwise.

    Arrays of a few hundred flights are too small to share: on two busy cores a training step took nine times longer.

    Example:
        >>> one_thread_unless_told()
        >>> torch.get_num_threads() == 1 or "OMP_NUM_THREADS" in os.environ
        True
    """
    if "OMP_NUM_THREADS" not in os.environ:
        torch.set_num_threads(1)
