"""Distances against scipy, level by level, where flights miss levels."""

import numpy as np
import pytest
import torch
from scipy import stats
from torch import Tensor

from descentflow.core.errors import DataError
from descentflow.evaluation.metrics.noise_floor import Distances, level_distances

# Both sum at most 500 terms of order 1 to 100 in double precision.
TOLERANCE = 1e-12


def draw(n: int, seed: int, spread: float = 1.0, *, n_levels: int = 9, ties: bool = False) -> tuple[Tensor, Tensor]:
    generator = torch.Generator().manual_seed(seed)
    values = spread * torch.randn(n, n_levels, generator=generator, dtype=torch.float64)
    return (values.mul(3).round() if ties else values), torch.rand(n, n_levels, generator=generator) < 0.7


def ks_statistic(one: np.ndarray, two: np.ndarray) -> float:
    with np.errstate(divide="ignore"):  # the p-value of one or two values, which nobody asks for
        return float(stats.ks_2samp(one, two, method="asymp").statistic)


def paper(found: Distances) -> list[Tensor]:
    return [found[name] for name in ("ks", "wasserstein", "mae")]


def assert_as_scipy(found: Distances, first: tuple[Tensor, Tensor], second: tuple[Tensor, Tensor]) -> None:
    for level in range(first[0].shape[1]):
        one, two = (values[mask[:, level], level].double().numpy() for values, mask in (first, second))
        assert int(found["fewest"][level]) == min(len(one), len(two))
        if min(len(one), len(two)) == 0:
            assert all(bool(d[level].isnan()) for d in paper(found))
            continue
        expected = (
            ks_statistic(one, two),
            stats.wasserstein_distance(one, two),
            abs(one.mean() - two.mean()),
        )
        np.testing.assert_allclose([float(d[level]) for d in paper(found)], expected, rtol=TOLERANCE, atol=TOLERANCE)


@pytest.mark.parametrize("ties", [False, True])
@pytest.mark.parametrize(("n", "m"), [(300, 173), (20, 500), (1, 1), (2, 1)])
def test_as_scipy(n: int, m: int, ties: bool) -> None:
    first, second = draw(n, 0, ties=ties), draw(m, 1, 1.3, ties=ties)
    assert_as_scipy(level_distances(*first, *second), first, second)


@pytest.mark.parametrize("bad", [torch.nan, torch.inf])
def test_an_observed_value_must_be_finite(bad: float) -> None:
    first, second = draw(5, 0), draw(5, 1)
    first[0][0, 0], first[1][0, 0] = bad, True
    with pytest.raises(DataError, match="not finite"):
        level_distances(*first, *second)
