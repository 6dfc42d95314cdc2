"""Random numbers by counter, the same in any batch, precision and on any device; and seeds for one of many things."""

from hashlib import blake2b
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

NUMBERS_PER_BLOCK = 4
"""Numbers that Philox makes at each step of its counter."""
SEEDS = 1 << 64
"""Different seeds."""


class DrawNumbers(NamedTuple):
    """Draws of a seed that a batch holds: ``first``, ``first + 1`` and so on.

    A negative seed is the one 2^64 above it, as for torch's generators.
    """

    seed: int = 0
    first: int = 0

    def uniform(self, count: int, stream: int) -> Tensor:
        """A uniform number in [0, 1) for each of the next ``count`` draws: (count,) float64 on the CPU."""
        bits = np.random.Philox(key=np.array([self.seed % SEEDS, stream], dtype=np.uint64))
        bits.advance(self.first // NUMBERS_PER_BLOCK)
        skipped = self.first % NUMBERS_PER_BLOCK
        return torch.from_numpy(np.random.Generator(bits).random(skipped + count)[skipped:].copy())


FIRST_DRAWS = DrawNumbers()
"""The first draws of seed zero: the default for the draws of a batch."""


def seed_for_index(seed: int, *place: int) -> int:
    """A seed for one of many things that are numbered (an epoch, a batch), independent of those of the others."""
    state = np.random.SeedSequence([seed % SEEDS, *place]).generate_state(1, np.uint64)
    return int(state[0]) >> 1


def seed_for_name(seed: int, name: str) -> int:
    """The seed of one of many that are drawn for, a flight for instance, each with draws of its own."""
    return int.from_bytes(blake2b(f"{seed} {name}".encode(), digest_size=7).digest())
