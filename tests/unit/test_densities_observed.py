"""Fitting and scoring by what was observed: against closed forms, other implementations and direct optimisation."""

import math

import pytest
import torch
import toys
from torch import Tensor
from torch.distributions import MultivariateNormal
from toys import Opaque, normal

from descentflow.densities.em import fit_mixture
from descentflow.densities.em_steps import Steps
from descentflow.densities.importance import estimate
from descentflow.densities.mixture import GaussianMixtureDensity
from descentflow.densities.mixture_parameters import Mixture, log_observed, posteriors
from descentflow.densities.one_gaussian import drawn_weights, one_gaussian
from descentflow.representation.evidence import WeightEvidence
from descentflow.training.models import Gaussian, GaussianMixture, LatentModel, MaskedAffineFlow

D, K, C = 3, 2, 2


def truth(seed: int = 0, *, context: bool = False) -> Mixture:
    """Two correlated components, with slopes and gate if asked for."""
    factor = torch.eye(D, dtype=torch.float64) + 0.3 * normal(K, D, D, seed=seed).tril()
    line = (normal(K, D, C, seed=seed + 2), normal(K, C, seed=seed + 3)) if context else ()
    return Mixture(torch.tensor([0.3, 0.7]).double(), 2 * normal(K, D, seed=seed + 1), factor, *line)


def gappy(weights: Tensor, seed: int = 0, noise: float = 0.1) -> tuple[WeightEvidence, Tensor, Tensor]:
    """Weights of which each flight shows some coordinates, with noise: evidence, what was seen, and the mask."""
    patterns = torch.tensor([[1, 1, 1], [1, 1, 0], [1, 0, 0], [0, 1, 1]], dtype=torch.float64)
    group = torch.randint(len(patterns), (len(weights),), generator=torch.Generator().manual_seed(seed))
    mask = patterns[group]
    seen = mask * (weights + noise * normal(*weights.shape, seed=seed + 50))
    return (
        WeightEvidence.of_information(torch.diag_embed(patterns / noise**2), seen / noise**2, group),
        seen,
        mask.bool(),
    )


def drawn(mixture: Mixture, n: int, seed: int = 0) -> Tensor:
    component = torch.multinomial(mixture.probs, n, replacement=True, generator=torch.Generator().manual_seed(seed))
    white = normal(n, D, seed=seed + 7)
    return mixture.locs[component] + (mixture.scale_trils[component] @ white[:, :, None])[:, :, 0]


def log_marginal(mixture: Mixture, seen: Tensor, mask: Tensor, noise: float = 0.1) -> Tensor:
    """The density of the coordinates seen, flight by flight: the marginal of each Gaussian, written out."""
    log_densities = []
    for row, shown in zip(seen, mask, strict=True):
        parts = []
        for prob, loc, factor in zip(mixture.probs, mixture.locs, mixture.scale_trils, strict=True):
            covariance = factor @ factor.T + noise**2 * torch.eye(D, dtype=torch.float64)
            normal_of = MultivariateNormal(loc[shown], covariance[shown][:, shown])
            parts.append(prob.log() + normal_of.log_prob(row[shown]))
        log_densities.append(torch.stack(parts).logsumexp(0))
    return torch.stack(log_densities)


def test_the_likelihood_is_the_marginal_of_the_coordinates_seen() -> None:
    """Up to a constant of each flight, which two mixtures share."""
    evidence, seen, mask = gappy(drawn(truth(), 60))
    first, second = truth(), truth(5)
    difference = log_observed(first, evidence) - log_observed(second, evidence)
    expected = log_marginal(first, seen, mask) - log_marginal(second, seen, mask)
    torch.testing.assert_close(difference, expected, rtol=1e-9, atol=1e-9)


def test_the_posterior_is_the_conditional_of_the_joint_gaussian() -> None:
    mixture = truth()
    evidence, seen, mask = gappy(drawn(mixture, 20))
    posterior = posteriors(mixture, evidence)
    for i in range(20):
        shown = mask[i]
        for k in range(K):
            covariance = mixture.scale_trils[k] @ mixture.scale_trils[k].T
            marginal = covariance[shown][:, shown] + 0.01 * torch.eye(int(shown.sum()), dtype=torch.float64)
            gain = covariance[:, shown] @ torch.linalg.inv(marginal)
            expected = mixture.locs[k] + gain @ (seen[i][shown] - mixture.locs[k][shown])
            torch.testing.assert_close(posterior.means[i, k], expected, rtol=1e-9, atol=1e-9)
            torch.testing.assert_close(
                posterior.covariances[evidence.group[i], k], covariance - gain @ covariance[shown], rtol=1e-9, atol=1e-9
            )


def test_scores_are_log_densities_where_weights_are_seen_precisely_and_zero_where_nothing_is() -> None:
    mixture, weights = truth(), drawn(truth(), 30)
    group = torch.zeros(30, dtype=torch.long)
    precise = WeightEvidence(weights, group, 1e10 * torch.eye(D, dtype=torch.float64)[None])
    # A precision of 1e10 blurs by 1e-5 standard deviations.
    torch.testing.assert_close(
        log_observed(mixture, precise), log_observed(mixture, WeightEvidence.of_weights(weights)), rtol=0, atol=1e-4
    )
    nothing = WeightEvidence(weights, group, torch.zeros(1, D, D, dtype=torch.float64))
    assert float(log_observed(mixture, nothing).abs().max()) < 1e-12


@pytest.mark.parametrize("context", [False, True])
def test_gradients_are_those_of_finite_differences(context: bool) -> None:
    evidence, _, _ = gappy(drawn(truth(), 6))
    given = normal(6, C, seed=9) if context else None
    mixture = truth(3, context=context)
    lines = [mixture.slopes, mixture.gate] if context else []
    leaves = [t.clone().requires_grad_() for t in (mixture.probs, mixture.locs, mixture.scale_trils.tril(), *lines)]

    def loss(*parameters: Tensor) -> Tensor:
        probs, locs, factors, *rest = parameters
        return log_observed(Mixture(probs, locs, factors.tril(), *rest), evidence, given)

    assert torch.autograd.gradcheck(loss, leaves)


def test_the_single_gaussian_is_the_one_that_direct_optimisation_finds() -> None:
    """L-BFGS on the likelihood written out coordinate by coordinate, from the standard normal."""
    evidence, seen, mask = gappy(drawn(truth(), 150))
    gaussian = one_gaussian(evidence, jitter=0.0)
    loc, factor = torch.zeros(D).double().requires_grad_(), torch.eye(D).double().requires_grad_()
    optimizer = torch.optim.LBFGS([loc, factor], max_iter=300, line_search_fn="strong_wolfe", tolerance_grad=1e-9)

    def closure() -> Tensor:
        optimizer.zero_grad()
        loss = -log_marginal(Mixture(torch.ones(1).double(), loc[None], factor.tril()[None]), seen, mask).mean()
        loss.backward()
        return loss

    optimizer.step(closure)
    # EM ends when a step gains 1e-9 nats; parameters are known to the root of that.
    torch.testing.assert_close(gaussian.locs[0], loc.detach(), rtol=0, atol=1e-3)
    covariance = factor.detach().tril() @ factor.detach().tril().T
    torch.testing.assert_close(gaussian.scale_trils[0] @ gaussian.scale_trils[0].T, covariance, rtol=0, atol=3e-3)
    ours = float(log_marginal(gaussian, seen, mask).mean())
    assert ours == pytest.approx(-float(closure().detach()), abs=1e-6)


def test_some_of_many_flights_find_the_start_and_all_of_them_the_end(monkeypatch: pytest.MonkeyPatch) -> None:
    """With as few as 300 of 2,000 flights to begin with, the optimum is that of all flights."""
    context = normal(2000, C, seed=4)
    for given in (None, context):
        weights = drawn(truth(), 2000)
        steps = Steps(weights, given)
        whole, likelihood = fit_mixture(steps, K, seed=0, n_restarts=3)
        with monkeypatch.context() as fewer:
            fewer.setattr("descentflow.densities.em.STARTING_FLIGHTS", 300)
            of_fewer, again = fit_mixture(steps, K, seed=0, n_restarts=3)
        assert again == pytest.approx(likelihood, abs=2e-4)
        torch.testing.assert_close(of_fewer.locs.sort(0).values, whole.locs.sort(0).values, rtol=0, atol=0.05)


def test_spread_that_gaps_hide_is_recovered() -> None:
    """Half of 4,000 flights lack a coordinate: their expected weights are too narrow there, the fit is not."""
    mixture = truth()
    weights = drawn(mixture, 4000)
    evidence, _, _ = gappy(weights, noise=0.3)
    gaussian = one_gaussian(evidence)
    fitted, _ = fit_mixture(drawn_weights(gaussian, evidence, seed=0), K, seed=0)
    spread = _deviation(fitted)
    # Deviation of 2,000 normals: 1.6 %; three of that, and as much for two components that share it.
    assert float((spread / weights.std(0) - 1).abs().max()) < 0.06
    filled = posteriors(gaussian, evidence).means[:, 0].std(0)
    assert float((filled / weights.std(0)).min()) < 0.9


def _deviation(mixture: Mixture) -> Tensor:
    mean = mixture.probs @ mixture.locs
    second = (mixture.probs[:, None] * ((mixture.scale_trils.square()).sum(2) + mixture.locs.square())).sum(0)
    return (second - mean.square()).sqrt()


def opaque_truth() -> Opaque:
    hidden = GaussianMixtureDensity(D, K)
    hidden.mixture = truth()
    hidden.attach(toys.representation_of(D))
    return Opaque(hidden)


def test_importance_sampling_meets_the_closed_form() -> None:
    evidence, _, _ = gappy(drawn(truth(), 40))
    opaque = opaque_truth()
    with torch.no_grad():
        none = torch.zeros(len(evidence), 0)
        estimated = opaque.estimate_observed(evidence, none, opaque.wide_gaussian(none), 4000)
    expected = log_observed(truth(), evidence)
    # The error of each estimate is 1 / sqrt(effective draws); five of them, for 40 flights: once in 40,000.
    error = 5 * (1 / (estimated.effective * 4000) - 1 / 4000).clamp(min=0).sqrt() + 1e-9
    assert bool(((estimated.log_prob - expected).abs() < error).all())
    assert float(estimated.effective.min()) > 0.05


def test_the_bound_that_flows_are_trained_by_is_below_the_likelihood_and_rises_with_draws() -> None:
    evidence, _, _ = gappy(drawn(truth(), 400))
    opaque, exact = opaque_truth(), float(log_observed(truth(), evidence).mean())
    bounds, none = [], torch.zeros(len(evidence), 0)
    for draws in (1, 8, 64):
        with torch.no_grad():
            estimated = estimate(opaque.log_prob, opaque.wide_gaussian(none), evidence, draws, none, seed=1)
        bounds.append(float(estimated.log_prob.mean()))
    assert bounds[0] < bounds[1] < bounds[2] < exact + 0.02


@pytest.mark.parametrize(
    ("model", "epochs"),
    [
        (Gaussian(), 1),
        (GaussianMixture(2, n_restarts=2), 10),
        (GaussianMixture(2, n_restarts=2, training="svi"), 20),
        (MaskedAffineFlow(learning_rate=0.01), 25),
    ],
    ids=["gaussian", "em", "svi", "flow"],
)
def test_every_model_recovers_the_spread_from_gappy_flights(model: LatentModel, epochs: int) -> None:
    mixture = truth()
    weights = drawn(mixture, 1500)
    train, held_out = gappy(weights, noise=0.3)[0], gappy(drawn(mixture, 400, seed=3), seed=3, noise=0.3)[0]
    torch.manual_seed(0)
    fitted = toys.fit(model, toys.WeightsModule(train, held_out, batch_size=128), epochs)
    spread = fitted.sample(20_000, seed=0).std(0)
    # Deviation of 750 normals is known to 2.6 %; flows add as much. Filled gaps lose more than 10 %.
    assert float((spread / weights.std(0) - 1).abs().max()) < 0.08
    with torch.no_grad():
        score, best = (float(x.mean()) for x in (fitted.log_observed(held_out), log_observed(mixture, held_out)))
    assert best - 0.25 < score < best + 0.05
    assert math.isfinite(score)
