"""Profiles on their grid, in their parts: what trains, what validates, what tests."""

from typing import Literal

import torch
from lightning.pytorch.utilities import rank_zero_info

from descentflow.representation.profiles import Profiles
from descentflow.representation.representation import Split

Part = Literal["train", "validation", "test"]
REACHED_BY = 0.25
"""The grid ends at the highest level that this share of the training flights reach (paper, appendix A)."""


def top_level(train: Profiles) -> int:
    """Highest flight level that at least a quarter of the training flights reach (paper, appendix A)."""
    entries = train.levels_fl[train.entry_level].sort(descending=True).values
    needed = -(-len(entries) * int(REACHED_BY * 100) // 100)
    return int(entries[needed - 1])


def rest_is_test(flight_ids: tuple[str, ...], split: Split) -> Split:
    """The parts of a checkpoint's split that are among these flights; every flight it never saw is a test flight."""
    train, validation = set(split.train), set(split.validation)
    return Split(
        tuple(f for f in flight_ids if f in train),
        tuple(f for f in flight_ids if f in validation),
        tuple(f for f in flight_ids if f not in train and f not in validation),
    )


def with_levels(profiles: Profiles) -> Profiles:
    """Without the flights that have no two levels on the grid; says how many those were."""
    enough = profiles.mask.sum(1) >= 2
    if not bool(enough.all()):
        rank_zero_info(f"left out {int((~enough).sum())} flight(s) with fewer than two levels on the grid")
    return profiles.subset(torch.nonzero(enough)[:, 0])


def parts_of(profiles: Profiles, split: Split) -> dict[Part, Profiles]:
    """Profiles of each part; a split may name flights that are not among them."""
    position = {flight: i for i, flight in enumerate(profiles.flight_ids)}
    return {
        "train": profiles.subset([position[f] for f in split.train if f in position]),
        "validation": profiles.subset([position[f] for f in split.validation if f in position]),
        "test": profiles.subset([position[f] for f in split.test if f in position]),
    }
