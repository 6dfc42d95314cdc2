"""The statistics of the floor: its size by the exact null distribution, and samples of the truth that meet it."""

from math import comb

import pytest
import torch

from descentflow.evaluation.metrics._distances import Values
from descentflow.evaluation.metrics.descent_set import DescentSet
from descentflow.evaluation.metrics.noise_floor import split_distances
from descentflow.evaluation.metrics.scores import score


def normal(n: int, n_levels: int, seed: int, share: float = 1.0) -> Values:
    generator = torch.Generator().manual_seed(seed)
    values = torch.randn(n, n_levels, generator=generator, dtype=torch.float64)
    return values, torch.rand(n, n_levels, generator=generator) < share


def expected_ks(h: int) -> float:
    """Mean KS distance between two samples of h from one continuous distribution (Gnedenko and Korolyuk, 1951)."""
    tail = [2 * sum((-1) ** (j - 1) * comb(2 * h, h - j * k) for j in range(1, h // k + 1)) for k in range(1, h + 1)]
    return sum(tail) / comb(2 * h, h) / h


@pytest.mark.parametrize("half", [5, 20])
def test_the_floor_has_the_size_that_chance_gives(half: int) -> None:
    """Six thousand levels as independent repetitions, for samples and flights of one distribution."""
    same, floor = split_distances(normal(3 * half, 6000, 1), normal(2 * half + 1, 6000, 2), seed=3, n_splits=1)
    for found in (same["ks"], floor["ks"]):
        error = float(found.std()) / found.numel() ** 0.5
        # Seeds are fixed; were they not, four standard errors in four means would fail once in 4,000 runs.
        assert float(found.mean()) == pytest.approx(expected_ks(half), abs=4 * error)


def descents(n: int, seed: int) -> DescentSet:
    """Smooth random descents with random entries and some holes."""
    generator = torch.Generator().manual_seed(seed)
    levels = torch.linspace(150, 350, 21, dtype=torch.float64)
    offset, slope, pace = torch.randn(3, n, 1, generator=generator, dtype=torch.float64)
    cas = 140 + 8 * offset + 4 * slope * torch.linspace(-1, 1, 21, dtype=torch.float64)
    rate = -10 + 1.5 * pace + 0.3 * slope
    time = (levels[-1] - levels) * 30.48 / -rate
    entry = torch.randint(10, 32, (n, 1), generator=generator)
    hole = torch.randint(0, 60, (n, 1), generator=generator)
    position = torch.arange(21)
    mask = (position <= entry) & ~((position >= hole) & (position < hole + 3))
    return DescentSet(levels, time, cas, rate.expand_as(cas), torch.zeros_like(cas), mask)


def test_all_rows_of_the_table_meet_their_floor_under_the_null() -> None:
    """A hundred pairs of gappy sets, every row, through the whole of ``score``."""
    gaps = []
    for seed in range(100):
        table = score(descents(150, 2 * seed), descents(90, 2 * seed + 1), 250.0, seed=seed, n_splits=3)
        gaps.append([row.equal_size - row.floor for row in table])
    found = torch.tensor(gaps, dtype=torch.float64)
    z = found.mean(0) / found.std(0) * len(found) ** 0.5
    # Seeds are fixed; were they not, 4.5 standard errors in 23 rows would fail once in 6,400 runs.
    assert z.shape == (23,)
    assert float(z.abs().max()) < 4.5
