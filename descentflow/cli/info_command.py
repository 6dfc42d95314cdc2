"""`descentflow info`: what a checkpoint holds."""

import argparse
from pathlib import Path


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.description = (
        "Say what a checkpoint holds: aircraft, grid of levels, flights, context with the ranges of its values, "
        "cleaning, what decided which epoch was the best, and the version that wrote it."
    )
    parser.add_argument("checkpoint", type=Path, help="checkpoint that `descentflow fit` wrote (.ckpt)")


def run(args: argparse.Namespace) -> None:
    """Read and print."""
    from descentflow.densities.checkpoint_summary import checkpoint_summary

    print(checkpoint_summary(args.checkpoint))
