"""Mixture components that are pairs of clusters: the M step, its EM, and the search for their numbers."""

from itertools import pairwise

import pytest
import torch
import toys
from torch import Tensor
from torch.distributions import Categorical, MixtureSameFamily, MultivariateNormal

from descentflow.densities.crossed_clusters import CrossedClusters
from descentflow.densities.crossed_search import select_crossed, split_starts
from descentflow.densities.em import steps_of
from descentflow.densities.gaussian_steps import GaussianSteps
from descentflow.densities.mixture import GaussianMixtureDensity
from descentflow.densities.mixture_parameters import n_parameters
from descentflow.representation.evidence import Evidence
from descentflow.training.models import GaussianMixture

DRAG, SPEED = 2, 1
PAIRS = CrossedClusters(2, 3, DRAG)


def normal(*shape: int, seed: int = 0) -> Tensor:
    return torch.randn(*shape, generator=torch.Generator().manual_seed(seed), dtype=torch.float64)


def truth(clusters: CrossedClusters = PAIRS, apart: float = 6.0) -> MixtureSameFamily:
    """A mixture whose components are pairs of clusters, with drag that follows speed."""
    k, d = clusters.n_components, DRAG + SPEED
    means = torch.zeros(k, d).double()
    means[:, DRAG:] = apart * torch.arange(clusters.n_speed).repeat_interleave(clusters.n_drag).double()[:, None]
    slopes = normal(clusters.n_drag, DRAG, SPEED, seed=2).repeat(clusters.n_speed, 1, 1)
    own = apart * normal(clusters.n_drag, DRAG, seed=4).repeat(clusters.n_speed, 1)
    means[:, :DRAG] = own + (slopes @ means[:, DRAG:, None])[..., 0]
    covariance = torch.eye(d).double().repeat(k, 1, 1)
    covariance[:, :DRAG, :DRAG] += slopes @ slopes.mT
    covariance[:, :DRAG, DRAG:], covariance[:, DRAG:, :DRAG] = slopes, slopes.mT
    shares = torch.linspace(1.0, 2.0, k).double()
    return MixtureSameFamily(Categorical(shares / shares.sum()), MultivariateNormal(means, covariance))


def drawn(n: int, seed: int, clusters: CrossedClusters = PAIRS) -> Tensor:
    with torch.random.fork_rng():
        torch.manual_seed(seed)
        return truth(clusters).sample((n,))


def moments(flights: Tensor, responsibilities: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    counts = responsibilities.sum(0)
    means = responsibilities.T @ flights / counts[:, None]
    off = flights - means[:, None]
    spread = torch.einsum("nk,kna,knb->kab", responsibilities, off, off) / counts[:, None, None]
    return counts, means, spread


def expected_log_likelihood(flights: Tensor, responsibilities: Tensor, parameters: dict[str, Tensor]) -> Tensor:
    """Of speed, and of drag given speed, as the module's equation has them: written without its code."""
    i = torch.arange(PAIRS.n_components) // PAIRS.n_drag
    j = torch.arange(PAIRS.n_components) % PAIRS.n_drag
    drag, speed = flights[:, None, :DRAG], flights[:, None, DRAG:]
    of_speed = MultivariateNormal(parameters["mu"][i], parameters["sigma"][i]).log_prob(speed)
    line = parameters["a"][j] + torch.einsum("kds,nks->nkd", parameters["b"][j], speed.expand(-1, len(i), -1))
    of_drag = MultivariateNormal(line, parameters["s"][j]).log_prob(drag)
    return (responsibilities * (of_speed + of_drag)).sum()


def test_the_m_step_is_where_the_likelihood_has_no_slope() -> None:
    flights = drawn(400, 0)
    responsibilities = normal(400, PAIRS.n_components, seed=1).softmax(1)
    means, covariances = PAIRS.tied(*moments(flights, responsibilities))
    pairs_mean = means.reshape(2, 3, -1)
    pairs_covariance = covariances.reshape(2, 3, DRAG + SPEED, DRAG + SPEED)
    across = pairs_covariance[0, :, :DRAG, DRAG:]
    b = across @ torch.linalg.inv(pairs_covariance[0, :, DRAG:, DRAG:])
    parameters = {
        "mu": pairs_mean[:, 0, DRAG:],
        "sigma": pairs_covariance[:, 0, DRAG:, DRAG:],
        "a": pairs_mean[0, :, :DRAG] - (b @ pairs_mean[0, :, DRAG:, None])[..., 0],
        "b": b,
        "s": pairs_covariance[0, :, :DRAG, :DRAG] - b @ across.mT,
    }
    parameters = {name: one.clone().requires_grad_() for name, one in parameters.items()}
    expected_log_likelihood(flights, responsibilities, parameters).backward()
    for name, one in parameters.items():
        # Sums of 400 flights' terms of order one: rounding and the 1e-9 on variances leave some 1e-6.
        assert one.grad is not None
        assert float(one.grad.abs().max()) < 1e-5, name


def test_one_cluster_of_each_is_one_gaussian() -> None:
    flights = drawn(300, 1)
    one = GaussianSteps(flights).crossed(CrossedClusters(1, 1, DRAG)).maximise(torch.ones(300, 1).double())
    torch.testing.assert_close(one.locs[0], flights.mean(0))
    covariance = one.scale_trils[0] @ one.scale_trils[0].T
    expected = torch.cov(flights.T, correction=0) + 1e-6 * torch.eye(3).double()
    torch.testing.assert_close(covariance, expected, rtol=1e-7, atol=1e-7)
    assert CrossedClusters(1, 1, DRAG).n_parameters(3) == n_parameters(1, 3)


def test_free_numbers_are_counted() -> None:
    # Speed: a mean and a variance, twice; drag: two means, two slopes and three covariances, thrice; five proportions.
    assert PAIRS.n_parameters(3) == 2 * 2 + 3 * 7 + 5


@pytest.mark.parametrize("gappy", [False, True])
def test_em_never_loses_likelihood(gappy: bool) -> None:
    flights = drawn(300, 2)
    known = torch.eye(3).double() * torch.tensor([4.0, 4.0, 4.0]).double()
    seen = torch.stack([known, torch.diag(torch.tensor([4.0, 0.0, 0.0]).double())])
    steps = steps_of(Evidence(flights, torch.arange(300) % 2, seen) if gappy else flights).crossed(PAIRS)
    mixture = steps.stand_in(0).maximise(normal(300, 6, seed=3).softmax(1))
    reached = []
    for _ in range(40):
        mixture, likelihood = steps.improve(mixture)
        reached.append(likelihood)
    # The variances that are added (1e-6) may cost as much.
    assert min(b - a for a, b in pairwise(reached)) > -1e-5
    assert reached[-1] > reached[0]


def test_the_planted_clusters_are_found_and_the_truth_is_told() -> None:
    train = drawn(1500, 10)
    bic = select_crossed(train, DRAG, seed=0, n_restarts=2, criterion="bic", prior_flights=5.0)
    assert (bic.clusters.n_speed, bic.clusters.n_drag) == (2, 3), "BIC is consistent"
    found = select_crossed(train, DRAG, seed=0, n_restarts=2, prior_flights=5.0)
    density = GaussianMixtureDensity(3, found.clusters.n_components)
    density.mixture = found.mixture
    held_out = drawn(4000, 11)
    # 30 parameters from 1,500 flights cost n_p / 2n = 0.01 nats on average.
    assert toys.mean_nll(density.log_prob, held_out) == pytest.approx(
        toys.mean_nll(truth().log_prob, held_out), abs=0.03
    )


def test_a_model_keeps_its_clusters() -> None:
    model = toys.fit(GaussianMixture(n_restarts=4), toys.WeightsModule(drawn(600, 12), drawn(100, 13)), 3)
    n_drag = model.representation.decoder.drag_basis.n_components
    clusters = model.density.clusters
    assert clusters is not None
    assert clusters.n_drag_weights == n_drag
    again = GaussianMixtureDensity(3, **model.density.settings())
    assert again.clusters == clusters
    again.mixture = model.density.mixture
    assert again.clusters == clusters, "of as many components"


def test_free_components_are_taken_where_pairs_are_not(monkeypatch: pytest.MonkeyPatch) -> None:
    weights = drawn(200, 14)
    for options in ({"crossed": False}, {"n_clusters": 2}, {"training": "svi", "n_restarts": 1}):
        model = toys.fit(GaussianMixture(**options), toys.WeightsModule(weights, weights[:50]), 1)
        assert model.density.clusters is None
    assert "clusters" not in model.density.settings()
    monkeypatch.setattr("descentflow.training.models.mixture_model.MOST_PAIRED", 199)
    many = toys.fit(GaussianMixture(), toys.WeightsModule(weights, weights[:50]), 1)
    assert many.density.clusters is None


def test_clusters_that_cannot_be_are_refused() -> None:
    for clusters in ({"n_speed": 2, "n_drag": 2}, {"n_speed": 0, "n_drag": 3}):
        with pytest.raises(ValueError, match="clusters of 3 mixture components"):
            GaussianMixtureDensity(3, 3, clusters={**clusters, "n_drag_weights": 2})
    with pytest.raises(ValueError, match="3 weights of drag among 3"):
        GaussianMixtureDensity(3, 4, clusters={"n_speed": 2, "n_drag": 2, "n_drag_weights": 3})
    seen = Evidence(drawn(50, 0), torch.zeros(50, dtype=torch.long), torch.eye(3).double()[None])
    with pytest.raises(ValueError, match="a context"):
        steps_of(seen, normal(50, 1)).crossed(PAIRS)


def test_starts_split_each_cluster_of_the_kind_that_grows() -> None:
    flights = drawn(600, 15)
    steps = GaussianSteps(flights)
    fewer = CrossedClusters(2, 2, DRAG)
    labels = 2 * (flights[:, 2] > 3).long() + (flights[:, 0] > flights[:, 0].mean()).long()
    mixture = steps.crossed(fewer).maximise(torch.nn.functional.one_hot(labels, 4).double())
    for more, expected in (
        (CrossedClusters(2, 3, DRAG), 2),
        (CrossedClusters(3, 2, DRAG), 2),
        (CrossedClusters(3, 3, DRAG), 0),
    ):
        starts = split_starts(steps.crossed(more), flights, fewer, mixture, more, 0)
        assert len(starts) == expected
        assert all(one.n_components == more.n_components for one in starts)
        assert all(bool(one.probs.sum().isclose(torch.ones(()).double())) for one in starts)
