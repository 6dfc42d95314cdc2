"""Ratios to the noise floor in closed form, and the floor by the exact null distribution."""

from dataclasses import replace
from math import comb, erf, exp, pi

import numpy as np
import pytest
import torch
from scipy.stats import ks_2samp, wasserstein_distance
from torch import Tensor

from descentflow.core.units import KT_MPS
from descentflow.evaluation.metrics.descent_set import DescentSet
from descentflow.evaluation.metrics.distances import Values
from descentflow.evaluation.metrics.noise_floor import SIZE, Distances, matched_size, split_distances, splits
from descentflow.evaluation.metrics.scores import score

SHIFT = 0.4
"""Of the samples' mean, in standard deviations of the flights."""
REPEATS = 4000
"""Levels, each an independent repetition."""
HELD_OUT = (50, 120, 400)


def normal(n: int, seed: int, mean: float = 0.0) -> Values:
    generator = torch.Generator().manual_seed(seed)
    values = mean + torch.randn(n, REPEATS, generator=generator, dtype=torch.float64)
    return values, values < 99


def distances(n_real: int, size: int) -> tuple[Distances, Distances]:
    return split_distances(normal(500, n_real, SHIFT), normal(n_real, 1000 + n_real), seed=1, n_splits=1, size=size)


def mean_of_folded_normal(mean: float, deviation: float) -> float:
    """``E|X|`` of a normal X (Leone, Nelson and Nottingham, 1961)."""
    z = mean / deviation
    return deviation * (2 / pi) ** 0.5 * exp(-(z**2) / 2) + mean * erf(z / 2**0.5)


@pytest.mark.parametrize("n_real", HELD_OUT)
def test_the_ratio_of_a_shifted_generator_is_that_of_its_closed_form(n_real: int) -> None:
    """Means of h normals differ by a normal of variance 2 / h, about the shift or about zero."""
    h = 25
    same, floor = distances(n_real, h)
    deviation = (2 / h) ** 0.5
    for distance, shift in ((same["mae"], SHIFT), (floor["mae"], 0.0)):
        error = float(distance.std()) / REPEATS**0.5
        # Seeds are fixed; were they not, four standard errors in six means would fail once in 2,600 runs.
        assert float(distance.mean()) == pytest.approx(mean_of_folded_normal(shift, deviation), abs=4 * error)


def test_distances_of_all_splits_at_once_are_scipys_one_by_one() -> None:
    generator = torch.Generator().manual_seed(0)
    # Rounded, so that values meet; a third is not observed.
    samples, real = ((30 * torch.randn(n, 4, generator=generator)).round() for n in (90, 60))
    sets = (samples, torch.ones_like(samples) > 0), (real, torch.rand(60, 4, generator=generator) > 0.3)
    same, floor = split_distances(*sets, seed=5, n_splits=7, size=20)
    for split, (drawn, first, second) in enumerate(zip(*splits(*sets, seed=5, n_splits=7, size=20), strict=True)):
        for level in range(4):
            target, other = (_seen(sets[1], index, level) for index in (first, second))
            stand_in = _seen(sets[0], drawn, level)[: len(other)]
            for found, one in ((same, stand_in), (floor, other[: len(stand_in)])):
                ks = ks_2samp(one, target, method="asymp").statistic
                # Both are sums and differences of numbers of this size, in double precision.
                assert float(found["ks"][split, level]) == pytest.approx(ks, abs=1e-12)
                expected = wasserstein_distance(one, target)
                assert float(found["wasserstein"][split, level]) == pytest.approx(expected, rel=1e-12)


def _seen(values: Values, index: Tensor, level: int) -> np.ndarray:
    return values[0][index, level][values[1][index, level]].numpy()


def test_types_with_few_flights_are_compared_at_the_largest_size_that_both_sides_allow() -> None:
    for n_real, expected in ((2 * SIZE + 1, SIZE), (2 * SIZE - 1, SIZE - 1), (7, 3)):
        assert matched_size(normal(300, 1), normal(n_real, 2)) == expected
    assert matched_size(normal(20, 1), normal(500, 2)) == 20


def descents(n: int, seed: int, cas_kt: float = 0.0) -> DescentSet:
    """Descents of a constant CAS of 250 kt and a spread of 10 kt, over a grid that a third does not span."""
    generator = torch.Generator().manual_seed(seed)
    levels = torch.arange(200, 211, dtype=torch.float64)
    cas = (250 + cas_kt + 10 * torch.randn(n, 1, generator=generator).double()).expand(n, 11) * KT_MPS
    pace = -10 - torch.rand(n, 1, generator=generator).double()
    time = (levels[-1] - levels) * 30.48 / -pace
    mask = torch.ones(n, 11, dtype=torch.bool)
    mask[: n // 3, -1] = False
    return DescentSet(levels, time, cas, pace.expand(n, 11), torch.zeros(n, 11).double(), mask)


def test_the_table_has_ratio_excess_and_the_flights_on_each_side() -> None:
    table = score(descents(900, 1, cas_kt=5.0), descents(450, 2), 205.0, n_splits=40)
    row = table.get("cas_below_transition", "wasserstein")
    assert row.n_each == SIZE
    assert row.over_floor == row.equal_size / row.floor
    spread = float(descents(450, 2).cas_mps[:, 0].std()) / KT_MPS
    assert row.excess == pytest.approx((row.equal_size**2 - row.floor**2) ** 0.5 / spread, rel=1e-9)
    # Half a spread was planted. Means of 450 flights and 900 samples are known to 0.06 spreads: four of these.
    assert row.excess == pytest.approx(0.5, abs=0.23)
    assert table.get("time_to_bottom_of_descent", "ks").n_each == 150
    assert "flights on each side: 150 in time_to_bottom_of_descent; 200 in" in " ".join(str(table).split())


def test_excess_of_a_proper_score_is_a_difference() -> None:
    samples = descents(900, 1)
    table = score(replace(samples, cas_mps=samples.cas_mps + 10 * KT_MPS), descents(450, 2), 205.0, n_splits=20)
    for quantity, statistic in (("cas_below_transition", "crps"), ("cas_profile", "energy")):
        row = table.get(quantity, statistic)
        spread = float(descents(450, 2).cas_mps[:, 0].std()) / KT_MPS
        # The level that a third do not show has a spread that differs a little.
        assert row.excess == pytest.approx((row.equal_size - row.floor) / spread, rel=0.01)
        # What E|X - y| gains by a shift of one spread, in closed form; the means are known to 0.06 spreads.
        gain = mean_of_folded_normal(1.0, 2**0.5) - mean_of_folded_normal(0.0, 2**0.5)
        assert row.excess == pytest.approx(gain, abs=0.15)


def nulls(n: int, n_levels: int, seed: int, share: float = 1.0) -> Values:
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
    same, floor = split_distances(nulls(3 * half, 6000, 1), nulls(2 * half + 1, 6000, 2), seed=3, n_splits=1)
    for distance in (same["ks"], floor["ks"]):
        error = float(distance.std()) / distance.numel() ** 0.5
        # Seeds are fixed; were they not, four standard errors in four means would fail once in 4,000 runs.
        assert float(distance.mean()) == pytest.approx(expected_ks(half), abs=4 * error)


def gappy_descents(n: int, seed: int) -> DescentSet:
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
        table = score(gappy_descents(150, 2 * seed), gappy_descents(90, 2 * seed + 1), 250.0, seed=seed, n_splits=3)
        gaps.append([row.equal_size - row.floor for row in table])
    beyond_floor = torch.tensor(gaps, dtype=torch.float64)
    z = beyond_floor.mean(0) / beyond_floor.std(0) * len(beyond_floor) ** 0.5
    # Seeds are fixed; were they not, 4.5 standard errors in 23 rows would fail once in 6,400 runs.
    assert z.shape == (23,)
    assert float(z.abs().max()) < 4.5
