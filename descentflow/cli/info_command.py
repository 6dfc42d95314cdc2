"""`descentflow info`: what a checkpoint holds."""

from pathlib import Path


def run(checkpoint: Path) -> None:
    """Say what a checkpoint holds.

    That is aircraft, grid of levels, flights, context with the ranges of its values, cleaning, what decided which epoch
    was the best, and the version that wrote it.

    Args:
        checkpoint: checkpoint that `descentflow fit` wrote (.ckpt)
    """
    from descentflow.densities.checkpoint import checkpoint_summary

    print(checkpoint_summary(checkpoint))
