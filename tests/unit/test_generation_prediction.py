"""The rest of a descent from its first part: posteriors against closed forms, and coverage."""

from copy import copy
from dataclasses import replace

import numpy as np
import pytest
import torch
import toys
from refusals import refuses
from torch import Tensor
from torch.distributions import MultivariateNormal
from toys import Opaque, normal

from descentflow.core.errors import ConfigError, DataError, SamplingError
from descentflow.densities.gaussian import GaussianDensity
from descentflow.densities.mixture_parameters import Mixture
from descentflow.generation.conditional._latent_density import Prior, posterior_of, prior_of
from descentflow.generation.prediction.predictor import DescentPredictor, observed_at
from descentflow.generation.prediction.summary import (
    actual_times,
    coverage,
    time_intervals,
)
from descentflow.generation.prediction.time_calibration import TimeCalibration
from descentflow.representation.decoder.trajectories import Trajectories
from descentflow.representation.drag_scale import Observed
from descentflow.representation.encode_flights import EncodedFlights
from descentflow.representation.linear_curves import KEPT_NOISE, LinearCurves, linear_curves
from descentflow.representation.profiles import Profiles
from descentflow.representation.residuals import ResidualLine


def linear(n_weights: int = 3, n_residual: int = 2, n_levels: int = 6) -> LinearCurves:
    noise = 0.2 + 0.1 * torch.arange(2 * n_levels, dtype=torch.float64)
    return LinearCurves(normal(2 * n_levels), normal(2 * n_levels, n_weights + n_residual, seed=1), noise, n_weights)


def seen_of(curves: LinearCurves, drag: Tensor, cas: Tensor, mask: Tensor) -> tuple[Tensor, Tensor]:
    """Precision and shift of one flight."""
    found = curves.information(Observed((drag[None], cas[None]), mask[None]))
    return found.precisions[0], found.shift[0]


def noise_left(curves: LinearCurves) -> Tensor:
    """Covariance of the noise about the weights of the whole profile: what its projection takes is in the weights."""
    kept, noise = curves.loadings[:, : curves.n_weights], torch.diag(curves.noise_variance)
    return noise - (1 - KEPT_NOISE) * kept @ torch.linalg.inv(kept.T @ torch.linalg.inv(noise) @ kept) @ kept.T


def two_components() -> Mixture:
    factors = torch.stack([torch.eye(3, dtype=torch.float64), 0.5 * torch.eye(3, dtype=torch.float64)])
    factors[0, 1, 0] = 0.4
    return Mixture(torch.tensor([0.3, 0.7], dtype=torch.float64), torch.stack([normal(3), -normal(3)]), factors)


def residual_line(known: bool) -> ResidualLine:
    plain = ResidualLine.standard(2, 3)
    return ResidualLine(normal(2, seed=4), normal(2, 3, seed=5), 0.5 + plain.spread) if known else plain


@pytest.mark.parametrize("known", [False, True])
def test_each_component_and_its_probability_are_those_of_the_joint_gaussian(known: bool) -> None:
    """Condition the joint of (u, observed) by blocks, component by component: another route to the same posterior."""
    curves, mixture, line = linear(), two_components(), residual_line(known)
    mask = torch.tensor([True, False, True, True, False, False])
    seen = torch.cat([mask, mask])
    drag, cas = normal(6, seed=2), normal(6, seed=3)
    prior = Prior(mixture, None, residual=line if known else None)
    found = posterior_of(prior, *seen_of(curves, drag, cas, mask), curves)
    means, roots = torch.from_numpy(found.means), torch.from_numpy(found.roots)
    rows, observed = curves.loadings[seen], torch.cat([drag, cas])[seen]
    log_probs = []
    for k in range(2):
        mean = torch.cat([mixture.locs[k], line.offset + line.slope @ mixture.locs[k]])
        own = mixture.scale_trils[k] @ mixture.scale_trils[k].T
        across = line.slope @ own
        rest = across @ line.slope.T + torch.diag(line.spread**2)
        covariance = torch.cat([torch.cat([own, across.T], 1), torch.cat([across, rest], 1)])
        marginal = rows @ covariance @ rows.T + noise_left(curves)[seen][:, seen]
        gain = covariance @ rows.T @ torch.linalg.inv(marginal)
        expected = mean + gain @ (observed - curves.offset[seen] - rows @ mean)
        torch.testing.assert_close(means[k], expected, rtol=1e-9, atol=1e-9)
        torch.testing.assert_close(roots[k] @ roots[k].T, covariance - gain @ rows @ covariance)
        whole = MultivariateNormal(curves.offset[seen] + rows @ mean, marginal)
        log_probs.append(mixture.probs[k].log() + whole.log_prob(observed))
    torch.testing.assert_close(torch.from_numpy(found.log_probs), torch.stack(log_probs).log_softmax(0))


def test_draws_have_the_posteriors_moments() -> None:
    curves, mixture = linear(), two_components()
    mask = torch.ones(6, dtype=torch.bool)
    found = posterior_of(Prior(mixture, None), *seen_of(curves, normal(6, seed=2), normal(6, seed=3), mask), curves)
    drawn, effective = found.draw(40_000, torch.Generator().manual_seed(0))
    probs, means, roots = (torch.from_numpy(v) for v in (np.exp(found.log_probs), found.means, found.roots))
    mean = probs @ means
    spread = roots @ roots.mT + (means - mean)[:, :, None] * (means - mean)[:, None]
    covariance = (probs[:, None, None] * spread).sum(0)
    assert effective == 40_000
    # Five standard errors of 15 independent-looking numbers: fails once in 100,000.
    error = 5 * covariance.diagonal().sqrt() / 200
    assert bool(((drawn.mean(0) - mean).abs() < error).all())
    torch.testing.assert_close(torch.cov(drawn.T), covariance, rtol=0.05, atol=0.05 * float(covariance.abs().max()))


def opaque_gaussian() -> Opaque:
    hidden = GaussianDensity(3)
    hidden.attach(toys.representation_of(3))
    return Opaque(hidden)


def test_importance_resampling_meets_the_closed_form() -> None:
    opaque, curves = opaque_gaussian(), linear()
    evidence = seen_of(curves, normal(6, seed=2), normal(6, seed=3), torch.arange(6) < 4)
    exact = posterior_of(prior_of(opaque.hidden), *evidence, curves)
    weighted = posterior_of(prior_of(opaque), *evidence, curves)
    assert weighted.prior.exact is opaque
    drawn, effective = weighted.draw(4000, torch.Generator().manual_seed(0))
    assert effective > 4000
    deviation = torch.from_numpy(exact.roots[0]).square().sum(1).sqrt()
    # Resampled draws repeat: eight standard errors of 4,000.
    assert bool(((drawn.mean(0) - torch.from_numpy(exact.means[0])).abs() < 8 * deviation / 4000**0.5).all())


def test_a_density_that_excludes_the_flight_says_so() -> None:
    opaque, curves = opaque_gaussian(), linear()
    far = seen_of(curves, 1e3 + normal(6), 1e3 + normal(6), torch.ones(6, dtype=torch.bool))
    posterior = posterior_of(prior_of(opaque), *far, curves)
    refuses(SamplingError, "effective", posterior.draw, 100, torch.Generator().manual_seed(0))


def test_the_papers_iteration_cannot_predict() -> None:
    refuses(ConfigError, "ppca", linear_curves, toys.representation_of(4).decoder)


def trained() -> GaussianDensity:
    """The Gaussian of toy flights' weights, as training would give it."""
    parts = toys.representation(600)
    weights = parts.decoder.encode(toys.flights(600))
    density = GaussianDensity(parts.decoder.dimension)
    with torch.no_grad():
        density.loc.copy_(weights.mean(0))
        density.scale_tril.copy_(torch.linalg.cholesky(torch.cov(weights.T)))
    density.attach(parts)
    return density


def encoded(n: int, seed: int) -> EncodedFlights:
    flights = toys.flights(n, seed=seed)
    return EncodedFlights(flights, toys.representation(600).decoder.encode(flights), torch.zeros(n, 0))


def held(predictor: DescentPredictor, flights: Profiles) -> tuple[float, float]:
    """Of 120 flights from FL290 the share whose time to FL150 lies in its interval, and the intervals' mean width."""
    chosen = [i for i in range(len(flights)) if int(flights.entry_level[i]) > 160 and bool(flights.mask[i, 140])][:120]
    ahead = [predictor.predict(flights.subset([i]), 290, 200, seed=i) for i in chosen]
    found = coverage(time_intervals(ahead), actual_times(ahead, flights)).filter(level_fl=150)
    assert found["flights"].item() == len(chosen) > 100
    return found["covered"].item(), found["width_s"].item()


@pytest.mark.parametrize("deviations", [0.25, pytest.param(1.0, marks=pytest.mark.slow), 4.0])
def test_intervals_hold_nine_in_ten_of_a_density_that_knows_too_much_or_too_little(deviations: float) -> None:
    """Of 120 held-out flights a right interval holds fewer than 81 % or more than 97 % once in a thousand."""
    density = trained()
    with torch.no_grad():
        density.scale_tril.mul_(deviations)
    drawn = DescentPredictor(density)
    real = toys.flights(220, seed=1)
    if deviations < 1:
        assert held(drawn, real)[0] < 0.8
    calibrated = drawn.calibrated(290, encoded(60, 2), encoded(60, 3))
    share, width = held(calibrated, real)
    assert 0.81 < share < 0.97
    assert width < 2 * float(held_control(calibrated, 140)), "what was seen narrows the interval"


def test_a_flight_of_the_fit_is_continued_by_the_others() -> None:
    """As by a Gaussian that was fitted without it; calibration does so with every flight of the fit."""
    fitted, weights = trained(), toys.representation(600).decoder.encode(toys.flights(600))
    some = torch.arange(0, 600, 20)

    def gaussian_of(chosen: Tensor) -> DescentPredictor:
        density, kept = GaussianDensity(fitted.dimension), weights[chosen]
        with torch.no_grad():
            density.loc.copy_(kept.mean(0))
            density.scale_tril.copy_(torch.linalg.cholesky(torch.cov(kept.T, correction=0)))
        density.attach(fitted.representation)
        return DescentPredictor(density)

    of_all = gaussian_of(some)
    train = EncodedFlights(toys.flights(600).subset(some), weights[some], torch.zeros(len(some), 0))
    whole = [i for i in range(len(some)) if bool(train.profiles.mask[i, :141].all())]
    expected, known = [], []
    for i in whole:
        flight = train.subset([i])
        expected.append(gaussian_of(some[some != some[i]]).predict(flight.profiles, 290, 100).trajectories)
        one = copy(of_all)
        one.latent = of_all.latent.without(flight.weights, len(some), flight.context)
        found = one.predict(flight.profiles, 290, 100).trajectories
        torch.testing.assert_close(found.time_s[:, :140], expected[-1].time_s[:, :140])
        known.append(
            (observed_at(flight.profiles, 140), flight.profiles.time_s[:, :140] - flight.profiles.time_s[:, 140, None])
        )
    observed, flown_s = (torch.cat(parts) for parts in zip(*known, strict=True))
    calibration = of_all.calibrated(290, train).calibration
    assert calibration is not None
    torch.testing.assert_close(
        calibration.factor, TimeCalibration.of_flights(expected, observed, flown_s.double()).factor
    )


def held_control(predictor: DescentPredictor, last: int) -> float:
    """Width of the intervals of least squares on CAS and rate to the lowest level."""
    assert predictor.control is not None
    assert len(predictor.control.half_s) == last
    return 2 * float(predictor.control.half_s[0])


def test_predictions_repeat_and_refuse_what_they_cannot_use() -> None:
    predictor, real = DescentPredictor(trained()), toys.flights(3, seed=1, gappy=False)
    first, again = (predictor.predict(real.subset([0]), 300, 50, seed=4) for _ in range(2))
    assert torch.equal(first.trajectories.time_s, again.trajectories.time_s)
    refuses(DataError, "no level at and above FL420", predictor.predict, real.subset([0]), 420)
    refuses(DataError, "one flight", predictor.predict, real, 300)
    with pytest.raises(DataError, match="at least ten"):
        predictor.calibrated(300, EncodedFlights(real, torch.zeros(3, 1), torch.zeros(3, 0)))


def test_few_continuations_are_counted_and_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    predictor, real = DescentPredictor(trained()), toys.flights(1, seed=1, gappy=False)
    decoder = predictor.representation.decoder
    fly = decoder.fly_scaled

    def only_some_descend(profiles: tuple[Tensor, ...], entry: Tensor) -> Trajectories:
        flown = fly(profiles, entry)
        rate = flown.rate_mps.clone()
        rate[descending:, 0] = 1.0
        return replace(flown, rate_mps=rate)

    monkeypatch.setattr(decoder, "fly_scaled", only_some_descend)
    descending = 49
    refuses(SamplingError, r"49 of 500 continuations.*50 at least", predictor.predict, real, 300, 500)
    descending = 50
    assert time_intervals([predictor.predict(real, 300, 60)])["continuations"].unique().to_list() == [50]


def fans(n: int, mean_s: Tensor, *, own_s: float) -> list[Trajectories]:
    """Continuations of n flights from the top of eleven levels: evenly spaced times, whose ends grow to ``own_s``."""
    depth = torch.arange(10.0, -1, -1).double()
    rank = torch.linspace(-1, 1, 201).double()[:, None]
    found = []
    for one in mean_s:
        time_s = depth * one / 10 + own_s * depth / 10 * rank / 0.9
        rest = torch.full_like(time_s, -10.0)
        entry = torch.full((201,), 10)
        found.append(Trajectories(150 + torch.arange(11.0).double(), entry, time_s, *(rest.clone() for _ in range(5))))
    return found


def test_what_reports_are_off_by_is_added_and_not_multiplied() -> None:
    """Times off by a normal of 2 s at all levels, of continuations that are 1 s apart at the bottom."""
    mean_s = 100 + 5 * normal(400)
    drawn = fans(400, mean_s, own_s=1.0)
    depth = torch.arange(10.0, -1, -1).double()
    flown_s = (depth * mean_s[:, None] / 10 + 2 * normal(400, 11, seed=1))[:, :10]
    found = TimeCalibration.of_flights(drawn, normal(400, 2, seed=2), flown_s)
    flown, noise_s = found.applied(drawn[0], torch.zeros(2))
    half = flown.time_s.quantile(0.95, dim=0) - flown.time_s.quantile(0.5, dim=0)
    whole = torch.hypot(half, noise_s)[:10]
    # A quantile of 400 normals is known to 6 %.
    torch.testing.assert_close(whole, torch.full((10,), 2 * 1.645).double(), rtol=0.2, atol=0)
    assert float(half.max()) < 2.0 < float(noise_s[:10].min())


def test_a_forecast_that_is_biased_by_rate_is_mended() -> None:
    """Medians that lack what the rate tells: after least squares their error is that of reports."""
    observed, mean_s = normal(300, 2, seed=2), torch.full((300,), 100.0).double()
    drawn = fans(300, mean_s, own_s=5.0)
    depth = torch.arange(10.0, -1, -1).double()[:10]
    flown_s = depth / 10 * (108 + 6 * observed[:, 1:]) + 0.5 * normal(300, 10, seed=1)
    found = TimeCalibration.of_flights(drawn[:200], observed[:200], flown_s[:200])
    moved = [found.applied(one, known)[0] for one, known in zip(drawn[200:], observed[200:], strict=True)]
    off = torch.stack([one.time_s[:, 0].quantile(0.5) for one in moved]) - flown_s[200:, 0]
    assert float(off.square().mean().sqrt()) < 0.65


@pytest.mark.parametrize("factor", [0.3, 1.5, 99.0])
def test_moved_times_never_turn_back_and_rates_go_with_them(factor: float) -> None:
    predictor, real = DescentPredictor(trained()), toys.flights(1, seed=1, gappy=False)
    before = predictor.predict(real, 300, 100).trajectories
    last = int(before.entry[0])
    ahead, as_drawn = torch.tensor([1.0, last]).double(), torch.tensor([0.0, 0.0, 0.0, 1.0]).double().expand(2, 4)
    found = TimeCalibration(ahead, as_drawn, torch.zeros(2).double(), torch.full((2,), factor).double(), last, 10)
    after, _ = found.applied(before, torch.zeros(2))
    assert bool((after.time_s[:, : last + 1].diff(dim=1) < 0).all())
    assert bool((after.rate_mps[:, : last + 1] < 0).all())
    assert bool((after.time_s[:, last] == 0).all())
    torch.testing.assert_close(after.cas_mps, before.cas_mps, rtol=0, atol=0)
    if factor < 2:
        # The trapezoid rule gives back the times; rates are means of two legs, whose changes are small.
        step_m = (before.levels_fl[1] - before.levels_fl[0]) * 30.48
        legs = 0.5 * step_m * (1 / after.rate_mps[:, :last] + 1 / after.rate_mps[:, 1 : last + 1])
        torch.testing.assert_close(-legs.sum(1), after.time_s[:, 0], rtol=2e-3, atol=0.0)


def test_a_flight_last_observed_far_from_the_calibrations_level_stays_as_drawn() -> None:
    predictor, real = DescentPredictor(trained()), toys.flights(1, seed=1, gappy=False)
    calibrated = predictor.calibrated(300, encoded(60, 2))
    for from_fl, alike in ((300, False), (304, False), (310, True)):
        one, other = (which.predict(real, from_fl, 60).trajectories.time_s for which in (predictor, calibrated))
        assert torch.equal(one, other) is alike
