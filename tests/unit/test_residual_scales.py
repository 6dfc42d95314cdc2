"""Flights that stray at scales of their own: probabilities by SciPy, a known law found again, and draws of it."""

from itertools import pairwise

import pytest
import torch
from scipy.stats import binomtest, kstest, multivariate_normal, norm
from test_residual_law import GROUPS, LAW, MIXTURE, TRILS, D, R, normal, observed
from torch import Tensor

from descentflow.densities import learn_residual_law as learning
from descentflow.densities.learn_residual_law import learn_residual_law, learn_residual_scales
from descentflow.densities.mixture import GaussianMixtureDensity
from descentflow.densities.mixture_parameters import Mixture
from descentflow.densities.residual_law import ResidualLaw, given_component
from descentflow.densities.weight_draws import MixtureDraw
from descentflow.generation.prediction.posterior import posterior_of, prior_of

SCALES = torch.tensor([[0.5, 0.5, 0.8], [2.5, 2.5, 1.5]]).double()
SCALED = ResidualLaw(LAW.offset, LAW.slope, LAW.spread, SCALES, torch.tensor([0.75, 0.25]).double())


def density() -> GaussianMixtureDensity:
    found = GaussianMixtureDensity(D, 2)
    found.mixture = MIXTURE
    found.residual_law = SCALED
    return found


def drawn(n: int) -> tuple[Tensor, Tensor, Tensor]:
    """Components and scales (n,), and weights and residual numbers (n, D + R)."""
    generator = torch.Generator().manual_seed(1)
    component = torch.multinomial(MIXTURE.probs, n, replacement=True, generator=generator)
    scale = torch.multinomial(SCALED.scale_probs, n, replacement=True, generator=generator)
    weights = MIXTURE.locs[component] + (TRILS[component] @ normal(n, D, 1, seed=2))[..., 0]
    return component, scale, torch.cat([weights, SCALED.of(weights, normal(n, R, seed=3), component, scale)], 1)


def test_flights_are_as_probable_as_scipys_scale_mixture_says() -> None:
    """Of the levels that six flights show, up to what all components and scales share."""
    information, loadings, values = observed(drawn(6)[2])
    every, found, expected = torch.ones(6, dtype=torch.bool), [], []
    means = SCALED.joint_means(MIXTURE.locs)
    for k in range(2):
        for j in range(2):
            found.append(given_component(information, MIXTURE, SCALED, k, every, scale=j).log_density)
            root = torch.zeros(D + R, D + R).double()
            root[:D, :D], root[D:, :D] = TRILS[k], SCALED.slope @ TRILS[k]
            root[D:, D:] = torch.diag(SCALED.spread[k] * SCALES[j])
            for i in range(6):
                rows = loadings[: len(loadings) // (2 if int(information.group[i]) else 1)]
                covariance = rows @ root @ root.T @ rows.T + 0.09 * torch.eye(len(rows)).double()
                at = values[i, : len(rows)].numpy()
                expected.append(multivariate_normal.logpdf(at, (rows @ means[k]).numpy(), covariance.numpy()))
    by_scipy = torch.tensor(expected).reshape(4, 6)
    off = torch.stack(found) - by_scipy
    torch.testing.assert_close(off, off[:1].expand(4, -1), rtol=0, atol=1e-8)


def shares_of(u: Tensor) -> Tensor:
    """Probability of a component for each flight, by the weights."""
    normals = torch.distributions.MultivariateNormal(MIXTURE.locs, scale_tril=TRILS)
    return (normals.log_prob(u[:, None, :D]) + MIXTURE.probs.log()).softmax(1)


def learnt(n: int) -> ResidualLaw:
    _, _, u = drawn(n)
    return learn_residual_scales(observed(u)[0], GROUPS, MIXTURE, shares_of(u), LAW)


def test_known_scales_are_found_again(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of 3,000 flights. Three scales for two: variance and kurtosis of the law are asked for, not its parts."""
    monkeypatch.setattr(learning, "MOST_OF_SCALES", 3000)
    found = learnt(3000)
    scales = found.scales * found.spread[0] / LAW.spread[0]
    second, fourth = (found.scale_probs @ scales**power for power in (2, 4))
    second_true, fourth_true = (SCALED.scale_probs @ SCALES**power for power in (2, 4))
    torch.testing.assert_close(second, second_true, rtol=0.1, atol=0)  # three standard errors
    torch.testing.assert_close(fourth / second**2, fourth_true / second_true**2, rtol=0.2, atol=0)


def test_flights_of_one_scale_are_given_little_more() -> None:
    """500 flights of a law of one scale: the kurtosis of the law found is 3 to within 0.5."""
    component = torch.multinomial(MIXTURE.probs, 500, True, generator=torch.Generator().manual_seed(4))
    weights = MIXTURE.locs[component] + (TRILS[component] @ normal(500, D, 1, seed=5))[..., 0]
    u = torch.cat([weights, LAW.of(weights, normal(500, R, seed=6), component)], 1)
    found = learn_residual_scales(observed(u)[0], GROUPS, MIXTURE, shares_of(u), LAW)
    kurtosis = 3 * (found.scale_probs @ found.scales**4) / (found.scale_probs @ found.scales**2) ** 2
    torch.testing.assert_close(kurtosis, torch.full((R,), 3.0).double(), rtol=0, atol=0.5)


def test_no_step_makes_flights_less_probable() -> None:
    """The prior of five flights is part of what EM raises: 0.01 nats a flight of 500 at most."""
    _, _, u = drawn(500)
    information, _, _ = observed(u)
    shares, law, values = shares_of(u), learnt(500), []
    start = ResidualLaw(LAW.offset, LAW.slope, LAW.spread, law.scales**0.2, torch.ones(3).double() / 3)
    for _ in range(12):
        value, start = learning._scale_step(information, GROUPS, MIXTURE, shares, start, None)
        values.append(value)
    assert all(later > before - 0.01 for before, later in pairwise(values))
    assert values[-1] > values[0] + 0.05


def test_a_profile_of_which_nothing_is_left_out_has_no_scales() -> None:
    """Of few flights the components of drag may be all that there are: the residual numbers are of the speed alone."""
    _, _, u = drawn(300)
    information = observed(u)[0]
    found, same = (
        learn_residual_scales(information, groups, MIXTURE, shares_of(u), LAW)
        for groups in (torch.ones(3).long(), 0 * GROUPS)
    )
    assert bool(found.scales.isfinite().all())
    assert torch.equal(found.scales, same.scales)


def test_residual_numbers_have_unit_variance_with_their_scales() -> None:
    _, _, u = drawn(2000)
    law = learn_residual_law(observed(u)[0], GROUPS, MIXTURE, shares_of(u))
    component = torch.multinomial(MIXTURE.probs, 40_000, True, generator=torch.Generator().manual_seed(7))
    weights = MIXTURE.locs[component] + (TRILS[component] @ normal(40_000, D, 1, seed=8))[..., 0]
    scales = law.drawn_scales(torch.rand(40_000, generator=torch.Generator().manual_seed(9), dtype=torch.float64))
    varied = law.of(weights, normal(40_000, R, seed=10), component, scales).var(0)
    assert [float(varied[:2].mean()), float(varied[2])] == pytest.approx([1, 1], abs=0.05)


def test_each_flight_draws_one_scale() -> None:
    """Kolmogorov-Smirnov of the mixture's law, binomial test of the wide scale; p < 1e-4 fails one right in 10,000."""
    found = density()
    component = torch.zeros(4000, dtype=torch.long)
    weights = normal(4000, D)
    white = normal(4000, R, seed=1)
    off = (
        found.residual(weights, white, 3, components=component) - LAW.offset[0] - weights @ LAW.slope.T
    ) / LAW.spread[0]
    for number in range(R):
        narrow, wide = SCALES[:, number].tolist()
        law = lambda x, a=narrow, b=wide: 0.75 * norm.cdf(x / a) + 0.25 * norm.cdf(x / b)  # noqa: E731
        assert kstest(off[:, number].numpy(), law).pvalue > 1e-4 / R
    times = off / white
    assert torch.allclose(times[:, 0], times[:, 1]), "numbers of a profile go together"
    assert binomtest(int((times[:, 0] > 1).sum()), 4000, 0.25).pvalue > 1e-4
    assert torch.equal(times[:, 0] > 1, times[:, 2] > 1), "as do the profiles"


def test_components_by_scale_are_the_same_law() -> None:
    mixture, law = SCALED.by_scale(MIXTURE)
    assert mixture.n_components == len(law.offset) == 4
    torch.testing.assert_close(mixture.probs, torch.tensor([0.45, 0.15, 0.3, 0.1]).double())
    told = {}
    for name, one, its in (("as it is", MIXTURE, SCALED), ("by scale", mixture, law)):
        rows = range(one.n_components)
        told[name] = sum(
            probability * one.probs[k] * norm.pdf(1.0, its.offset[k, 0], its.spread[k, 0] * scale)
            for k in rows
            for probability, scale in zip(its.scale_probs, its.scales[:, 0], strict=True)
        )
    assert float(told["as it is"]) == pytest.approx(float(told["by scale"]), rel=1e-12)
    assert SCALED.by_scale(MIXTURE)[1].by_scale(mixture)[0] is mixture


def test_what_a_flight_shows_says_at_which_scale_it_strays() -> None:
    """A flight far off its components is of the wide scale; one that is not, of the narrow one."""
    prior = prior_of(density())
    exact = 1e4 * torch.eye(D + R).double()
    weights = MIXTURE.locs[0]
    for times, expected in ((0.3, 0), (2.5, 1)):
        u = torch.cat([weights, LAW.offset[0] + weights @ LAW.slope.T + times * LAW.spread[0]])
        posterior = posterior_of(prior, exact, exact @ u)
        assert int(posterior.log_probs.reshape(2, 2)[0].argmax()) == expected


def test_an_exported_draw_is_of_the_same_law() -> None:
    """Kolmogorov-Smirnov of one number of the exported draw against draws of the density; p < 1e-4."""
    n = 5000
    draw, uniform = MixtureDraw(MIXTURE, None, SCALED), torch.rand(n, generator=torch.Generator().manual_seed(2))
    entry, noise = torch.zeros(n, dtype=torch.long), normal(n, D, seed=4)
    weights = draw(noise, entry, uniform)
    exported = draw.residual(weights, normal(n, R, seed=5), entry, uniform)
    _, _, u = drawn(n)
    for number in range(R):
        assert kstest(exported[:, number].numpy(), u[:, D + number].numpy()).pvalue > 1e-4 / R


def test_a_mixture_that_follows_a_context_keeps_its_lines() -> None:
    line = Mixture(MIXTURE.probs, MIXTURE.locs, TRILS, normal(2, D, 1), normal(2, 1, seed=1))
    both, _ = SCALED.by_scale(line)
    at = torch.tensor([0.7]).double()
    torch.testing.assert_close(both.at(at).locs, line.at(at).locs.repeat_interleave(2, 0))
    torch.testing.assert_close(both.at(at).probs.reshape(2, 2).sum(1), line.at(at).probs)
