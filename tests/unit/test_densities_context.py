"""Densities given a context: against closed forms and other implementations."""

from copy import deepcopy
from pathlib import Path

import numpy as np
import polars as pl
import pytest
import torch
import toys
from refusals import refuses
from sklearn.linear_model import LinearRegression
from torch import Tensor
from toys import normal

from descentflow.core.errors import ConfigError
from descentflow.densities.checkpoint import content_of, load_model
from descentflow.densities.em import fit_mixture
from descentflow.densities.em_steps import Steps
from descentflow.densities.mixture_parameters import Mixture, log_observed, n_parameters
from descentflow.generation.conditional._latent_density import posterior_of, prior_of
from descentflow.generation.rejection import sample_descents
from descentflow.representation.context import ContextEncoder
from descentflow.representation.evidence import WeightEvidence
from descentflow.representation.linear_curves import LinearCurves
from descentflow.training.models import Gaussian, GaussianMixture, LatentModel, MaskedAffineFlow

D, C = 3, 2


def table(n: int, seed: int = 0) -> pl.DataFrame:
    numbers = normal(n, C, seed=100 + seed).numpy()
    return pl.DataFrame({"a": numbers[:, 0], "b": numbers[:, 1]})


def linear(n: int, seed: int) -> tuple[Tensor, Tensor]:
    """Weights whose mean follows the context, with correlated noise."""
    context = normal(n, C, seed=seed)
    noise = normal(n, D, seed=seed + 1) @ torch.tensor([[1, 0.5, 0], [0, 0.7, 0.2], [0, 0, 0.4]], dtype=torch.float64)
    slope = torch.tensor([[1.0, 0.0], [-0.5, 1.5], [0.0, 0.3]], dtype=torch.float64)
    return 0.3 + context @ slope.T + noise, context


def two_regimes(n: int, seed: int) -> tuple[Tensor, Tensor]:
    """Two clusters whose means cross and whose shares depend on the context: no joint Gaussian."""
    context = normal(n, C, seed=seed)
    first = torch.sigmoid(2 * context[:, 0]) > torch.rand(n, generator=torch.Generator().manual_seed(seed))
    sign = torch.where(first, 1.0, -1.0)[:, None].double()
    centre = torch.tensor([2.0, 0.0, 0.0]).double() + context[:, 1:] * torch.tensor([0.0, 1.0, 0.5]).double()
    return sign * centre + 0.4 * normal(n, D, seed=seed + 1), context


class ContextModule(toys.WeightsModule):
    """Weights and context of known density."""

    def __init__(self, train: tuple[Tensor, Tensor], validation: tuple[Tensor, Tensor], batch_size: int = 512) -> None:
        super().__init__(train[0], validation[0], batch_size)
        self.known = {"train": train[1], "validation": validation[1]}
        self.representation.context = ContextEncoder.fit(table(50), ["a", "b"])

    def contexts(self, part: str) -> Tensor:
        return self.known[part]


KINDS = {
    "gaussian": (Gaussian, {}, 1),
    "mixture": (GaussianMixture, {"n_clusters": 2, "n_restarts": 2}, 20),
    "svi": (GaussianMixture, {"n_clusters": 2, "n_restarts": 2, "training": "svi"}, 20),
    "flow": (MaskedAffineFlow, {"n_flows": 3, "learning_rate": 0.01}, 25),
}
_trained: dict[str, LatentModel] = {}


def trained(name: str) -> LatentModel:
    if name not in _trained:
        kind, settings, epochs = KINDS[name]
        torch.manual_seed(0)
        module = ContextModule(two_regimes(1500, 0), two_regimes(1000, 5), batch_size=128)
        _trained[name] = toys.fit(kind(**settings), module, epochs)
    return _trained[name]


def test_gaussian_is_scikit_learns_linear_regression() -> None:
    weights, context = linear(800, 3)
    module = ContextModule((weights, context), linear(100, 7))
    density = toys.fit(Gaussian(jitter=0.0, ridge=0.0), module, 1).density
    theirs = LinearRegression().fit(context.numpy(), weights.numpy())
    np.testing.assert_allclose(density.slope.detach(), theirs.coef_, atol=1e-9)
    np.testing.assert_allclose(density.loc.detach(), theirs.intercept_, atol=1e-9)
    residual = weights.numpy() - theirs.predict(context.numpy())
    covariance = (density.scale_tril @ density.scale_tril.T).detach()
    np.testing.assert_allclose(covariance, residual.T @ residual / len(residual), atol=1e-9)


def test_em_of_regressions_never_loses_likelihood_and_finds_the_regimes() -> None:
    weights, context = two_regimes(1500, 0)
    steps = Steps(weights, context)
    mixture, best = fit_mixture(steps, 2, seed=0, n_restarts=2)
    responsibilities, likelihood = steps.expectation(mixture)
    updated = steps.maximise(responsibilities, mixture)
    # The ridge is a penalty, so the likelihood itself may give way by as much as that is worth.
    assert float(steps.expectation(updated)[1]) >= float(likelihood) - 1e-5
    single = fit_mixture(steps, 1, seed=0)[1]
    assert best > single + 0.5
    assert n_parameters(2, D, C) == 2 * (3 + 6 + 6) + 1 + 2
    gate = (mixture.gate[0] - mixture.gate[1]).abs()
    assert float(gate[0]) == pytest.approx(2.0, abs=0.4), "the planted gate"
    assert float(gate[1]) < 0.3


def test_conditional_mixture_is_the_numerically_integrated_conditional() -> None:
    """Bayes by a grid: the joint of gate, clusters and a box of weights, normalised by summing over the box."""
    model = trained("mixture")
    context = torch.tensor([[0.7, -0.4]], dtype=torch.float64)
    axis = torch.linspace(-7, 7, 57, dtype=torch.float64)
    grid = torch.cartesian_prod(axis, axis, axis)
    cell = float(axis[1] - axis[0]) ** 3
    found: Mixture = model.density.mixture
    with torch.no_grad():
        odds = (found.probs.log() + context[0] @ found.gate.T).exp()
        kernels = []
        for k in range(2):
            factor = found.scale_trils[k]
            white = torch.linalg.solve_triangular(
                factor, (grid - found.locs[k] - found.slopes[k] @ context[0]).T, upper=False
            )
            kernel = (-0.5 * white.square().sum(0)).exp()
            kernels.append(odds[k] * kernel / (kernel.sum() * cell))
        joint = torch.stack(kernels).sum(0)
        conditional = joint / (joint.sum() * cell)
        stated = model.log_prob(grid, context).exp()
    bulk = conditional > 1e-4
    torch.testing.assert_close(stated[bulk], conditional[bulk], rtol=1e-3, atol=1e-6)
    torch.testing.assert_close(
        log_observed(model.density.mixture_at(context), WeightEvidence.of_weights(grid[bulk])),
        stated[bulk].log(),
        rtol=1e-8,
        atol=1e-8,
    )


@pytest.mark.parametrize("name", KINDS)
def test_each_model_learns_what_the_context_says(name: str) -> None:
    model = trained(name)
    weights, context = two_regimes(2000, 9)
    with torch.no_grad():
        nll = -float(model.log_prob(weights, context).mean())
        shuffled = -float(model.log_prob(weights, context.roll(1, 0)).mean())
    # Truth: clusters of 0.4 in three dimensions (1.508 nats) and what the gate leaves open (0.44).
    assert nll < {"gaussian": 4.0, "flow": 2.9}.get(name, 2.0)
    assert shuffled > nll + 0.2


@pytest.mark.parametrize(("name", "seeds"), [("gaussian", 3), ("mixture", 3), ("flow", 1)])
def test_no_skill_is_invented_where_the_context_says_nothing(name: str, seeds: int) -> None:
    """Numbers that have nothing to do with the weights: held-out NLL as without them, but for what parameters cost."""
    kind, settings, epochs = KINDS[name]
    gains = []
    for seed in range(seeds):
        train, held_out = two_regimes(800, 40 + seed)[0], two_regimes(3000, 60 + seed)[0]
        noise, other = normal(800, C, seed=80 + seed), normal(3000, C, seed=90 + seed)
        shrunk = {**settings, "shrinkage": 300.0} if name == "flow" else settings
        torch.manual_seed(seed)
        blind = toys.fit(kind(**shrunk), toys.WeightsModule(train[:700], train[700:], 128), epochs)
        torch.manual_seed(seed)
        module = ContextModule((train[:700], noise[:700]), (train[700:], noise[700:]), 128)
        told = toys.fit(kind(**shrunk), module, epochs)
        with torch.no_grad():
            gain = told.log_prob(held_out, other).mean() - toys.mean_nll(blind.log_prob, held_out) * -1
        gains.append(float(gain))
    mean = sum(gains) / seeds
    # The price of C d slopes a cluster is C d k / 2n = 0.01 nats; a flow's fits differ by more from seed to seed.
    assert mean < 0.01 if name in ("gaussian", "mixture") else mean < 0.05
    assert mean > -0.03 if name in ("gaussian", "mixture") else mean > -0.2


@pytest.mark.parametrize("name", KINDS)
def test_samples_follow_the_context_and_repeat(name: str) -> None:
    model = trained(name)
    rows = torch.tensor([[1.5, 0.0], [-1.5, 0.0]], dtype=torch.float64).repeat(2000, 1)
    first = model.sample(4000, 1, rows)
    assert torch.equal(first, model.sample(4000, 1, rows))
    high, low = first[0::2, 0].mean(), first[1::2, 0].mean()
    # The share of the cluster at +2 is 95 % and 5 %: means of +1.8 and -1.8.
    assert float(high - low) == pytest.approx(3.6, abs=0.7)


def test_flow_log_density_is_the_jacobians() -> None:
    """Autograd through whitening and all flows, in float64, at one context for each flight."""
    density = deepcopy(trained("flow").density).double()
    weights, context = two_regimes(4, 11)
    for row, known in zip(weights, context, strict=True):

        def forward(x: Tensor, c: Tensor = known[None]) -> Tensor:
            z = density.flow.inverse((x[None] - density._locs(c)) / density.scale, c)
            return torch.linalg.solve_triangular(density.correlation_tril, z.T, upper=False)[:, 0]

        jacobian = torch.autograd.functional.jacobian(forward, row)
        base = -0.5 * forward(row).square().sum() - 0.5 * D * np.log(2 * np.pi)
        expected = base + torch.linalg.slogdet(jacobian).logabsdet
        assert float(density.log_prob(row[None], known[None]).detach()) == pytest.approx(
            float(expected.detach()), abs=1e-8
        )


@pytest.mark.parametrize("name", KINDS)
def test_a_checkpoint_keeps_the_context(name: str, tmp_path: Path) -> None:
    model = trained(name)
    torch.save(content_of(model.density), tmp_path / "m.ckpt")
    loaded = load_model(tmp_path / "m.ckpt")
    rows = loaded.representation.context.encode_one({"a": "0.5", "b": -1})
    assert torch.equal(loaded.sample(20, 1, rows), model.sample(20, 1, rows))


@pytest.mark.parametrize("name", ["mixture", "flow"])
def test_prediction_conditions_on_context_and_observation(name: str) -> None:
    """The prior of a prediction is the density given the flight's context; a flow's is weighted by it."""
    density = trained(name).density
    context = torch.tensor([[1.0, -0.5]], dtype=torch.float64)
    prior = prior_of(density, 0, context)
    weights = two_regimes(50, 21)[0]
    curves = LinearCurves(torch.zeros(2).double(), torch.zeros(2, D).double(), torch.ones(2).double(), D)
    posterior = posterior_of(prior, 4 * torch.eye(D).double(), torch.tensor([8.0, 0.0, 0.0]).double(), curves)
    stood_for = log_observed(prior.mixture, WeightEvidence.of_weights(weights))
    stood_for += torch.from_numpy(posterior.log_ratio(weights))
    torch.testing.assert_close(stood_for, density.log_prob(weights, context).double(), rtol=1e-9, atol=1e-9)
    drawn, effective = posterior.draw(2000, torch.Generator().manual_seed(0))
    assert effective > 200
    # Evidence of mean 2 and deviation 0.5 beside a cluster at 2 of deviation 0.4, which affine flows widen.
    assert float(drawn[:, 0].mean()) == pytest.approx(2.0, abs=0.1 if name == "mixture" else 0.25)


def test_misused_contexts_say_so() -> None:
    density = trained("gaussian").density
    refuses(ConfigError, "without a context", density.sample, 3, 0)
    refuses(ConfigError, r"context of shape \(3, 5\)", density.log_prob, normal(3, D), normal(3, 5))
    refuses(ConfigError, "without a context", density.mixture_at)
    plain = toys.fit(Gaussian(), toys.WeightsModule(normal(50, D), normal(50, D)), 1).density
    refuses(ConfigError, "knows no context", plain.sample, 3, 0, normal(3, C))


def test_sampling_keeps_each_sample_with_its_context() -> None:
    model = trained("gaussian")
    parts = model.representation
    rows = torch.tensor([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0]], dtype=torch.float64)
    entry = torch.tensor([100, 120, 140])
    made = [sample_descents(model, parts, 7, 3, context=rows, entry=entry) for _ in range(2)]
    assert torch.equal(made[0].weights, made[1].weights)
    assert made[0].report.accepted == 7
    entered = made[0].trajectories.mask.sum(1) - 1
    assert entered.tolist() == [100, 120, 140, 100, 120, 140, 100]
