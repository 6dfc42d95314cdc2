"""Mixtures that grow by splitting: as probable as scikit-learn's, splits of the largest first, and where they end."""

import numpy as np
import pytest
import torch
from sklearn.mixture import GaussianMixture as Peer
from torch import Tensor

from descentflow.densities import grown_mixtures
from descentflow.densities.em import steps_of
from descentflow.densities.grown_mixtures import grow_mixture, split_all
from descentflow.representation.evidence import Evidence

D = 4


def normal(*shape: int, seed: int = 0) -> Tensor:
    return torch.randn(shape, generator=torch.Generator().manual_seed(seed), dtype=torch.float64)


def clusters(n: int, k: int, seed: int) -> Tensor:
    """Flights of k overlapping clusters of unlike shapes and shares."""
    generator = torch.Generator().manual_seed(seed)
    shape = torch.randn(k, D, D, generator=generator, dtype=torch.float64) / 2
    centres = 2.5 * torch.randn(k, D, generator=generator, dtype=torch.float64)
    of = torch.multinomial(torch.arange(1.0, k + 1), n, replacement=True, generator=generator)
    return centres[of] + (shape[of] @ normal(n, D, 1, seed=seed + 1))[..., 0]


@pytest.mark.parametrize("seed", range(4))
def test_eight_components_are_as_probable_as_the_best_that_scikit_learn_finds(seed: int) -> None:
    """Best of five of its starts, which differ by 0.2 to 1.6 nats; 1e-4 is where both end to iterate."""
    flights = clusters(3000, 8, seed)
    peers = [Peer(8, random_state=s, tol=1e-5, max_iter=500).fit(flights.numpy()) for s in range(5)]
    best = max(peer.score(flights.numpy()) for peer in peers)
    reached: dict[int, float] = {}

    def value(k: int, likelihood: float) -> float:
        reached[k] = likelihood
        return -likelihood

    grown, _ = grow_mixture(steps_of(flights), 8, value, seed=0)
    assert grown.n_components == 8
    assert reached[8] > best - 1e-4


def test_flights_that_show_less_grow_the_mixture_that_they_are_of() -> None:
    """Half of 4,000 flights show every second weight only: held-out complete ones lose 0.05 nats at most by it."""
    flights, others = clusters(4000, 4, 9), clusters(6000, 4, 9)[4000:]
    precisions = torch.stack([1e4 * torch.eye(D), 1e4 * torch.diag(torch.tensor([1.0, 0.0, 1.0, 0.0]))]).double()
    group = torch.arange(4000) % 2
    shift = torch.einsum("nij,nj->ni", precisions[group], flights)
    blurred = Evidence.of_information(precisions, shift, group)

    def by_aic(k: int, likelihood: float) -> float:
        return 2.0 * k * (1 + D + D * (D + 1) // 2) - 2 * 4000 * likelihood

    scored = steps_of(others)
    whole, less = (grow_mixture(steps_of(one), 8, by_aic, seed=0)[0] for one in (flights, blurred))
    assert float(scored.expectation(less)[1]) > float(scored.expectation(whole)[1]) - 0.05


def test_components_of_most_flights_are_split_and_small_ones_are_left() -> None:
    points = torch.cat([normal(300, D), normal(30, D, seed=1) + 50, normal(5, D, seed=2) - 50])
    steps = steps_of(points)
    labels = torch.tensor([0] * 300 + [1] * 30 + [2] * 5)
    mixture = steps.maximise(torch.nn.functional.one_hot(labels, 3).double())
    assert split_all(steps, mixture, 3, seed=0) is mixture
    one_more = split_all(steps, mixture, 4, seed=0)
    assert sorted((one_more.locs.mean(1) / 25).round().tolist()) == [-2, 0, 0, 2]
    every = split_all(steps, mixture, 9, seed=0)
    assert sorted((every.locs.mean(1) / 25).round().tolist()) == [-2, 0, 0, 2, 2], (
        "five flights are too few of four weights"
    )
    np.testing.assert_allclose(float(every.probs.sum()), 1)


def test_growth_ends_where_the_criterion_is_no_better(monkeypatch: pytest.MonkeyPatch) -> None:
    steps, shown = steps_of(normal(500, D)), []
    monkeypatch.setattr(grown_mixtures, "TOLERANCE", 1e-2)
    best, values = grow_mixture(steps, 16, lambda k, _: abs(k - 4.0), seed=0, progress=shown.append)
    assert best.n_components == 4
    assert list(values) == [1, 2, 4, 8]
    assert shown == [5] * 4
    best, values = grow_mixture(steps, 6, lambda k, _: -k, seed=0, progress=shown.append)
    assert (best.n_components, list(values)) == (6, [1, 2, 4, 6])
    assert shown[4:] == [4] * 4
    assert grow_mixture(steps, 1, lambda k, _: k, seed=0)[0].n_components == 1
