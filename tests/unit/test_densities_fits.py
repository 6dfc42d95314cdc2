"""Latent models recover known densities, sample what they say, and repeat."""

import math
from functools import cache

import pytest
import torch
import toys
from sklearn.mixture import GaussianMixture as SklearnMixture
from torch import Tensor
from torch.distributions import Categorical, MixtureSameFamily, MultivariateNormal
from toys import normal

from descentflow.densities.component_search import max_components
from descentflow.densities.em import fit_mixture
from descentflow.training.models import Gaussian, GaussianMixture, LatentModel, MaskedAffineFlow

DIMENSION = 5


def generator(seed: int) -> torch.Generator:
    return torch.Generator().manual_seed(seed)


def mixture_truth() -> MixtureSameFamily:
    """Three well-separated, correlated clusters."""
    factor = 0.15 * normal(3, DIMENSION, DIMENSION, seed=1) + 0.5 * torch.eye(DIMENSION, dtype=torch.float64)
    clusters = MultivariateNormal(2 * normal(3, DIMENSION, seed=2), factor @ factor.mT)
    return MixtureSameFamily(Categorical(torch.tensor([0.5, 0.3, 0.2], dtype=torch.float64)), clusters)


def draw(truth: torch.distributions.Distribution, n: int, seed: int) -> Tensor:
    with torch.random.fork_rng():
        torch.manual_seed(seed)
        return truth.sample((n,))


def data(truth: torch.distributions.Distribution, n: int = 1500) -> toys.WeightsModule:
    return toys.WeightsModule(draw(truth, n, 10), draw(truth, 4000, 11))


def test_gaussian_is_the_sample_covariance_whatever_the_batches() -> None:
    train = normal(700, DIMENSION) @ normal(DIMENSION, DIMENSION, seed=1)
    model = toys.fit(Gaussian(), toys.WeightsModule(train, train, batch_size=64), 1)
    covariance = model.density.scale_tril @ model.density.scale_tril.T
    expected = torch.cov(train.T, correction=0) + 1e-6 * torch.eye(DIMENSION, dtype=torch.float64)
    torch.testing.assert_close(covariance, expected, rtol=1e-9, atol=1e-9)


@cache
def fitted(training: str) -> tuple[LatentModel, toys.WeightsModule]:
    """A mixture of as many components as BIC finds, and what it was fitted to."""
    module = data(mixture_truth())
    module.batch_size = 50
    return toys.fit(GaussianMixture(training=training), module, 60), module


@pytest.mark.parametrize("training", ["em", "svi"])
def test_mixture_recovers_a_mixture(training: str) -> None:
    truth, (model, module) = mixture_truth(), fitted(training)
    assert len(model.density.mixture.probs) == 3, "BIC finds the planted number of components"
    held_out = module.parts["validation"]
    assert toys.mean_nll(model.log_prob, held_out) == pytest.approx(toys.mean_nll(truth.log_prob, held_out), abs=0.05)


def test_em_and_svi_agree() -> None:
    both = (fitted("em"), fitted("svi"))
    nll = [toys.mean_nll(model.log_prob, module.parts["train"]) for model, module in both]
    # EM is at a maximum; Adam's last steps leave SVI within a hundredth of a nat.
    assert nll[1] == pytest.approx(nll[0], abs=0.01)


def test_mixture_likelihood_is_at_least_scikit_learns_best_of_three() -> None:
    train = draw(mixture_truth(), 1500, 4) + 0.5 * normal(1500, DIMENSION, seed=9) ** 2
    _, likelihood = fit_mixture(train, 6, seed=0)
    theirs = max(SklearnMixture(6, random_state=seed, max_iter=500).fit(train).score(train) for seed in range(3))
    assert likelihood >= theirs - 1e-3


def test_a_looser_tolerance_ends_em_earlier() -> None:
    """Two components that overlap, for EM is slow there."""
    train = torch.cat([normal(400, 2), normal(400, 2, seed=1) + 1.5])
    module, nll = toys.WeightsModule(train, train), {}
    for tolerance in (1e-2, 1e-10):
        model = toys.fit(GaussianMixture(2, tolerance=tolerance, prior_flights=0.0), module, 50)
        assert model.trainer.current_epoch == 1
        nll[tolerance] = toys.mean_nll(model.log_prob, train)
    # Of the loose fit the next step gains a hundredth of a nat at most; far more steps than one are left out.
    assert 1e-4 < nll[1e-2] - nll[1e-10] < 0.1


def test_pyro_log_density_equals_torch_mixture() -> None:
    """The enumerated Pyro trace against torch's own mixture."""
    model = GaussianMixture(3)
    model.attach(toys.representation_of(DIMENSION))
    truth = mixture_truth()
    component = truth.component_distribution
    model.density.program.probs = truth.mixture_distribution.probs
    model.density.program.locs = component.loc
    model.density.program.scale_trils = component.scale_tril
    weights = normal(50, DIMENSION)
    torch.testing.assert_close(model.log_prob(weights), truth.log_prob(weights), rtol=1e-9, atol=1e-9)


def test_two_mixtures_do_not_share_parameters() -> None:
    first, second = GaussianMixture(2), GaussianMixture(2)
    for model in (first, second):
        model.attach(toys.representation_of(DIMENSION))
    first.density.program.locs = torch.ones(2, DIMENSION, dtype=torch.float64)
    first.sample(3, seed=0)
    second.sample(3, seed=0)
    assert float(second.density.program.locs.detach().abs().max()) == 0


@pytest.mark.parametrize(
    ("n_train", "dimension", "most"), [(32808, 15, 16), (22978, 12, 16), (8656, 5, 27), (4836, 8, 7), (205, 5, 1)]
)
def test_cap_on_components_is_the_papers(n_train: int, dimension: int, most: int) -> None:
    assert max_components(n_train, dimension) == most


def banana(n: int, seed: int) -> Tensor:
    x = normal(n, DIMENSION, seed=seed)
    x[:, 1] = 0.3 * x[:, 1] + x[:, 0] ** 2 - 1
    x[:, 2] = x[:, 2] * (0.3 + 0.5 * x[:, 0].abs())
    return x


def test_flow_beats_one_gaussian_on_a_bent_density() -> None:
    module = toys.WeightsModule(banana(3000, 0), banana(3000, 1), batch_size=256)
    flow = toys.fit(MaskedAffineFlow(learning_rate=5e-3), module, 30)
    gaussian = toys.fit(Gaussian(), module, 1)
    held_out = module.parts["validation"]
    # The true density is 1.6 nats better than the best Gaussian; the flow must find at least one of them.
    margin = toys.mean_nll(gaussian.log_prob, held_out) - toys.mean_nll(flow.log_prob, held_out)
    assert margin > 1.0


def trained(name: str) -> LatentModel:
    train = banana(600, 0)
    module = toys.WeightsModule(train, train[:100])
    models = {"gaussian": (Gaussian(), 1), "mixture": (GaussianMixture(3), 5), "flow": (MaskedAffineFlow(), 5)}
    model, epochs = models[name]
    return toys.fit(model, module, epochs)


@pytest.mark.parametrize("name", ["gaussian", "mixture", "flow"])
def test_samples_follow_the_log_density(name: str) -> None:
    """Importance weights of samples against a broad normal integrate the density to one (error of the mean known)."""
    model = trained(name)
    proposal = MultivariateNormal(torch.zeros(DIMENSION).double(), 9 * torch.eye(DIMENSION, dtype=torch.float64))
    samples = model.sample(20_000, seed=3)
    with torch.no_grad():
        ratio = (proposal.log_prob(samples) - model.log_prob(samples)).exp()
    # E[q/p] over p is the mass of q where p is positive: 1. Heavy ratios are cut to the bulk of q.
    inside = samples.norm(dim=1) < 3.0
    mass = float((proposal.sample((200_000,)).norm(dim=1) < 3.0).double().mean())
    estimate = (ratio * inside).double()
    error = float(estimate.std()) / math.sqrt(len(estimate))
    # Five standard errors: fails once in two million if the sampler is right and the ratio's variance finite.
    assert abs(float(estimate.mean()) - mass) < 5 * error + 0.01
