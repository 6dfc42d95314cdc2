"""Proper scores against sums over all pairs, scipy, and closed forms of the normal distribution."""

import numpy as np
import pytest
import torch
from torch import Tensor

from descentflow.evaluation.metrics import proper
from descentflow.evaluation.metrics.noise_floor import level_distances
from descentflow.evaluation.metrics.proper import energy_scores


def draw(n: int, seed: int, mean: float = 0.0, n_levels: int = 4) -> tuple[Tensor, Tensor]:
    generator = torch.Generator().manual_seed(seed)
    values = mean + torch.randn(n, n_levels, generator=generator, dtype=torch.float64)
    values[:, 0] = values[:, 0].round()  # ties
    return values, torch.rand(n, n_levels, generator=generator) < 0.8


def seen(values: tuple[Tensor, Tensor], level: int) -> list[float]:
    return values[0][values[1][:, level], level].tolist()


def mean_difference(one: list[float], two: list[float]) -> float:
    return sum(abs(x - y) for x in one for y in two) / (len(one) * len(two))


def within(one: list[float], *, fair: bool = True) -> float:
    return mean_difference(one, one) * (len(one) / (len(one) - 1) if fair else 1)


def test_crps_is_the_double_loop() -> None:
    samples, real = draw(30, 0), draw(20, 1)
    found = level_distances(*samples, *real)["crps"]
    for level in range(4):
        one, two = seen(samples, level), seen(real, level)
        expected = mean_difference(one, two) - within(one) / 2
        assert float(found[level]) == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("pairs", [1, 50, 1 << 22])
def test_energy_score_is_the_double_loop(pairs: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(proper, "_PAIRS", pairs)
    samples, real = draw(30, 0)[0], draw(20, 1)[0]
    across = np.mean([[float((x - y).norm()) for y in real] for x in samples])
    among = sum(float((x - y).norm()) for x in samples for y in samples) / (30 * 29)
    everywhere = [torch.ones_like(values, dtype=torch.bool) for values in (samples, real)]
    # The root mean square over four levels is half of the Euclidean norm.
    found = energy_scores((samples, everywhere[0]), (real, everywhere[1]))
    assert 2 * float(found.mean()) == pytest.approx(across - among / 2, abs=1e-12)


def test_too_few_values_have_no_score() -> None:
    one, two = torch.zeros(1, 1), torch.zeros(2, 1)
    assert bool(level_distances(one, one == 0, two, two == 0)["crps"].isnan())
    assert bool(level_distances(two, two == 0, one, one == 1)["crps"].isnan())
    assert bool(energy_scores((one, one == 0), (two, two == 0)).isnan().all())
    assert len(energy_scores((two, two == 0), (two[:0], two[:0] == 0))) == 0
