"""Distances and proper scores against scipy, sums over all pairs and closed forms, where flights miss levels."""

import numpy as np
import pytest
import torch
from scipy import stats
from torch import Tensor

from descentflow.core.errors import DataError
from descentflow.evaluation.metrics import proper
from descentflow.evaluation.metrics.noise_floor import Distances, level_distances
from descentflow.evaluation.metrics.proper import energy_scores

# Both sum at most 500 terms of order 1 to 100 in double precision.
TOLERANCE = 1e-12


def draw(n: int, seed: int, spread: float = 1.0, *, n_levels: int = 9, ties: bool = False) -> tuple[Tensor, Tensor]:
    generator = torch.Generator().manual_seed(seed)
    values = spread * torch.randn(n, n_levels, generator=generator, dtype=torch.float64)
    return (values.mul(3).round() if ties else values), torch.rand(n, n_levels, generator=generator) < 0.7


def ks_statistic(first: np.ndarray, two: np.ndarray) -> float:
    with np.errstate(divide="ignore"):  # the p-value of one or two values, which nobody asks for
        return float(stats.ks_2samp(first, two, method="asymp").statistic)


def paper(distances: Distances) -> list[Tensor]:
    return [distances[name] for name in ("ks", "wasserstein", "mae")]


def assert_as_scipy(distances: Distances, first: tuple[Tensor, Tensor], second: tuple[Tensor, Tensor]) -> None:
    for level in range(first[0].shape[1]):
        one, two = (values[mask[:, level], level].double().numpy() for values, mask in (first, second))
        assert int(distances["fewest"][level]) == min(len(one), len(two))
        if min(len(one), len(two)) == 0:
            assert all(bool(d[level].isnan()) for d in paper(distances))
            continue
        expected = (ks_statistic(one, two), stats.wasserstein_distance(one, two), abs(one.mean() - two.mean()))
        np.testing.assert_allclose(
            [float(d[level]) for d in paper(distances)], expected, rtol=TOLERANCE, atol=TOLERANCE
        )


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


def drawn(n: int, seed: int, mean: float = 0.0, n_levels: int = 4) -> tuple[Tensor, Tensor]:
    generator = torch.Generator().manual_seed(seed)
    values = mean + torch.randn(n, n_levels, generator=generator, dtype=torch.float64)
    values[:, 0] = values[:, 0].round()  # ties
    return values, torch.rand(n, n_levels, generator=generator) < 0.8


def seen(values: tuple[Tensor, Tensor], level: int) -> list[float]:
    return values[0][values[1][:, level], level].tolist()


def mean_difference(first: list[float], two: list[float]) -> float:
    return sum(abs(x - y) for x in first for y in two) / (len(first) * len(two))


def within(values: list[float], *, fair: bool = True) -> float:
    return mean_difference(values, values) * (len(values) / (len(values) - 1) if fair else 1)


def test_crps_is_the_double_loop() -> None:
    samples, real = drawn(30, 0), drawn(20, 1)
    distances = level_distances(*samples, *real)["crps"]
    for level in range(4):
        first, two = seen(samples, level), seen(real, level)
        expected = mean_difference(first, two) - within(first) / 2
        assert float(distances[level]) == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("pairs", [1, 50, 1 << 22])
def test_energy_score_is_the_double_loop(pairs: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(proper, "_PAIRS", pairs)
    samples, real = drawn(30, 0)[0], drawn(20, 1)[0]
    across = np.mean([[float((x - y).norm()) for y in real] for x in samples])
    among = sum(float((x - y).norm()) for x in samples for y in samples) / (30 * 29)
    everywhere = [torch.ones_like(values, dtype=torch.bool) for values in (samples, real)]
    # The root mean square over four levels is half of the Euclidean norm.
    scores = energy_scores((samples, everywhere[0]), (real, everywhere[1]))
    assert 2 * float(scores.mean()) == pytest.approx(across - among / 2, abs=1e-12)


def test_too_few_values_have_no_score() -> None:
    first, two = torch.zeros(1, 1), torch.zeros(2, 1)
    assert bool(level_distances(first, first == 0, two, two == 0)["crps"].isnan())
    assert bool(level_distances(two, two == 0, first, first == 1)["crps"].isnan())
    assert bool(energy_scores((first, first == 0), (two, two == 0)).isnan().all())
    assert len(energy_scores((two, two == 0), (two[:0], two[:0] == 0))) == 0
