"""The rest of a descent from its first part: posteriors against closed forms, occupancy, and coverage."""

from dataclasses import replace

import polars as pl
import pytest
import torch
import toys
from torch import Tensor
from torch.distributions import MultivariateNormal

from descentflow.core.errors import ConfigError, DataError, SamplingError
from descentflow.densities.density import Density
from descentflow.densities.gaussian import GaussianDensity
from descentflow.densities.mixture_parameters import Mixture
from descentflow.densities.residual_law import ResidualLaw
from descentflow.generation.prediction.interval_spread import AS_DRAWN, MOST, TimeSpread, holding_spread, misses
from descentflow.generation.prediction.posterior import Prior, log_density, posterior_of, prior_of
from descentflow.generation.prediction.predictor import DescentPredictor
from descentflow.generation.prediction.summary import (
    actual_times,
    coverage,
    level_occupancy,
    occupancy_table,
    time_intervals,
)
from descentflow.representation.decoder.trajectories import Trajectories
from descentflow.representation.drag_scale import Observed
from descentflow.representation.linear_curves import KEPT_NOISE, LinearCurves, linear_curves


def normal(*shape: int, seed: int = 0) -> Tensor:
    return torch.randn(shape, generator=torch.Generator().manual_seed(seed), dtype=torch.float64)


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


def law_of_two(known: bool) -> ResidualLaw:
    plain = ResidualLaw.standard(2, 2, 3)
    return replace(plain, offset=normal(2, 2, seed=4), slope=normal(2, 3, seed=5)) if known else plain


@pytest.mark.parametrize("known", [False, True])
def test_each_component_and_its_probability_are_those_of_the_joint_gaussian(known: bool) -> None:
    """Condition the joint of (u, observed) by blocks, component by component: another route to the same posterior."""
    curves, mixture, law = linear(), two_components(), law_of_two(known)
    mask = torch.tensor([True, False, True, True, False, False])
    seen = torch.cat([mask, mask])
    drag, cas = normal(6, seed=2), normal(6, seed=3)
    prior = Prior(mixture, None, residual_law=law if known else None)
    found = posterior_of(prior, *seen_of(curves, drag, cas, mask))
    rows, observed = curves.loadings[seen], torch.cat([drag, cas])[seen]
    log_probs = []
    for k in range(2):
        mean = torch.cat([mixture.locs[k], law.offset[k] + law.slope @ mixture.locs[k]])
        own = mixture.scale_trils[k] @ mixture.scale_trils[k].T
        across = law.slope @ own
        rest = across @ law.slope.T + torch.diag(law.spread[k] ** 2)
        covariance = torch.cat([torch.cat([own, across.T], 1), torch.cat([across, rest], 1)])
        marginal = rows @ covariance @ rows.T + noise_left(curves)[seen][:, seen]
        gain = covariance @ rows.T @ torch.linalg.inv(marginal)
        expected = mean + gain @ (observed - curves.offset[seen] - rows @ mean)
        torch.testing.assert_close(found.means[k], expected, rtol=1e-9, atol=1e-9)
        precision = found.precision_trils[k] @ found.precision_trils[k].T
        torch.testing.assert_close(torch.linalg.inv(precision), covariance - gain @ rows @ covariance)
        whole = MultivariateNormal(curves.offset[seen] + rows @ mean, marginal)
        log_probs.append(mixture.probs[k].log() + whole.log_prob(observed))
    torch.testing.assert_close(found.log_probs, torch.stack(log_probs).log_softmax(0))


def test_draws_have_the_posteriors_moments() -> None:
    curves, mixture = linear(), two_components()
    mask = torch.ones(6, dtype=torch.bool)
    found = posterior_of(Prior(mixture, None), *seen_of(curves, normal(6, seed=2), normal(6, seed=3), mask))
    drawn, effective = found.draw(40_000, torch.Generator().manual_seed(0))
    probs = found.log_probs.exp()
    mean = probs @ found.means
    spread = found.precision_trils.cholesky_inverse() + (found.means - mean)[:, :, None] * (found.means - mean)[:, None]
    covariance = (probs[:, None, None] * spread).sum(0)
    assert effective == 40_000
    # Five standard errors of 15 independent-looking numbers: fails once in 100,000.
    error = 5 * covariance.diagonal().sqrt() / 200
    assert bool(((drawn.mean(0) - mean).abs() < error).all())
    torch.testing.assert_close(torch.cov(drawn.T), covariance, rtol=0.05, atol=0.05 * float(covariance.abs().max()))


class Opaque(Density):
    """A Gaussian that does not say so."""

    def __init__(self, dimension: int) -> None:
        super().__init__(dimension)
        self.hidden = GaussianDensity(dimension)

    def log_prob(self, weights: Tensor) -> Tensor:
        return self.hidden.log_prob(weights)

    def draw(self, n: int, generator: torch.Generator) -> Tensor:
        return self.hidden.draw(n, generator)


def test_importance_resampling_meets_the_closed_form() -> None:
    opaque, curves = Opaque(3), linear()
    evidence = seen_of(curves, normal(6, seed=2), normal(6, seed=3), torch.arange(6) < 4)
    exact = posterior_of(prior_of(opaque.hidden), *evidence)
    weighted = posterior_of(prior_of(opaque), *evidence)
    assert weighted.prior.exact is opaque
    drawn, effective = weighted.draw(4000, torch.Generator().manual_seed(0))
    assert effective > 4000
    deviation = exact.precision_trils[0].cholesky_inverse().diagonal().sqrt()
    # Resampled draws repeat: eight standard errors of 4,000.
    assert bool(((drawn.mean(0) - exact.means[0]).abs() < 8 * deviation / 4000**0.5).all())


def test_a_density_that_excludes_the_flight_says_so() -> None:
    opaque, curves = Opaque(3), linear()
    far = seen_of(curves, 1e3 + normal(6), 1e3 + normal(6), torch.ones(6, dtype=torch.bool))
    posterior = posterior_of(prior_of(opaque), *far)
    with pytest.raises(SamplingError, match="effective"):
        posterior.draw(100, torch.Generator().manual_seed(0))


def test_log_density_of_a_mixture_is_torchs() -> None:
    mixture = two_components()
    truth = torch.distributions.MixtureSameFamily(
        torch.distributions.Categorical(mixture.probs), MultivariateNormal(mixture.locs, scale_tril=mixture.scale_trils)
    )
    weights = normal(20, 3)
    torch.testing.assert_close(log_density(mixture, weights), truth.log_prob(weights))


def test_linear_curves_are_the_decoders() -> None:
    decoder = toys.representation(200).decoder
    curves, weights = linear_curves(decoder), normal(4, decoder.dimension)
    u = torch.cat([weights, torch.zeros(4, curves.n_residual, dtype=torch.float64)], 1)
    for found, expected in zip(curves.profiles(u), decoder.profiles(weights), strict=True):
        torch.testing.assert_close(found, expected)


def test_the_papers_iteration_cannot_predict() -> None:
    with pytest.raises(ConfigError, match="ppca"):
        linear_curves(toys.representation_of(4).decoder)


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


def test_intervals_cover_what_came() -> None:
    """Held-out toy flights from FL290: of 100, the 90 % interval of the time to FL150 holds 80 or more."""
    predictor = DescentPredictor(trained()).calibrated(toys.flights(60, seed=2), 290)
    real = toys.flights(150, seed=1)
    chosen = [i for i in range(150) if int(real.entry_level[i]) > 160][:100]
    predictions = [predictor.predict(real.subset([i]), 290, 200, seed=i) for i in chosen]
    intervals = time_intervals(predictions)
    covered = coverage(intervals, actual_times(predictions, real)).filter(level_fl=150)
    assert covered["flights"].item() == len(chosen)
    # A right interval holds fewer than 80 of 100 once in a thousand.
    assert covered["covered"].item() >= 0.8
    widths = intervals.select(pl.col("q95_s") - pl.col("q05_s")).to_series()
    highest = float(real.levels_fl[real.entry_level[chosen[0]]])
    prior = DescentPredictor(trained()).predict(real.subset([chosen[0]]), highest - 4, 200).trajectories.time_s[:, 0]
    assert widths.mean() < 2 * float(prior.std()) * 1.645, "what was seen narrows the interval"


@pytest.mark.parametrize("n_seen", [1, 3])
def test_few_levels_say_what_they_can(n_seen: int) -> None:
    """Of 100 held-out toy flights whose highest levels alone are seen, the interval to FL150 holds 80 or more."""
    predictor, real = DescentPredictor(trained()).calibrated(toys.flights(60, seed=2), 330), toys.flights(150, seed=1)
    chosen = [i for i in range(150) if int(real.entry_level[i]) > 160][:100]
    levels = [real.levels_fl[real.mask[i]][-n_seen] for i in chosen]
    predictions = [predictor.predict(real.subset([i]), float(fl), 200) for i, fl in zip(chosen, levels, strict=True)]
    covered = [coverage(time_intervals([one]), actual_times([one], real)).filter(level_fl=150) for one in predictions]
    held = pl.concat(covered)["covered"].sum()
    # A right interval holds fewer than 80 of 100 once in a thousand.
    assert held >= 0.8 * len(chosen)


def test_predictions_repeat_and_refuse_what_they_cannot_use() -> None:
    predictor, real = DescentPredictor(trained()), toys.flights(3, seed=1, gappy=False)
    first, again = (predictor.predict(real.subset([0]), 300, 50, seed=4) for _ in range(2))
    assert torch.equal(first.trajectories.time_s, again.trajectories.time_s)
    with pytest.raises(DataError, match="no level at and above FL420"):
        predictor.predict(real.subset([0]), 420)
    with pytest.raises(DataError, match="one flight"):
        predictor.predict(real, 300)
    with pytest.raises(DataError, match="at least ten"):
        predictor.calibrated(real, 300)


def test_few_continuations_are_counted_and_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    predictor, real = DescentPredictor(trained()), toys.flights(1, seed=1, gappy=False)
    fly = predictor._fly

    def only_some_descend(drawn: Tensor, entry: int) -> Trajectories:
        flown = fly(drawn, entry)
        rate = flown.rate_mps.clone()
        rate[descending:, 0] = 1.0
        return replace(flown, rate_mps=rate)

    monkeypatch.setattr(predictor, "_fly", only_some_descend)
    descending = 49
    with pytest.raises(SamplingError, match=r"49 of 500 continuations.*50 at least"):
        predictor.predict(real, 300, 500)
    descending = 50
    assert time_intervals([predictor.predict(real, 300, 60)])["continuations"].unique().to_list() == [50]


def hand_made() -> Trajectories:
    """Two descents on four levels: one from the top, a level every 10 s, one from the level below, every 20 s."""
    time_s = torch.tensor([[30.0, 20.0, 10.0, 0.0], [40.0, 20.0, 0.0, -20.0]], dtype=torch.float64)
    levels = torch.tensor([150.0, 151, 152, 153], dtype=torch.float64)
    return Trajectories(levels, torch.tensor([3, 2]), time_s, *(torch.zeros_like(time_s) for _ in range(5)))


def test_occupancy_of_two_descents_by_hand() -> None:
    shares = level_occupancy(hand_made(), torch.tensor([0.0, 15.0, 25.0, 35.0, 41.0]))
    expected = [[0, 0, 0.5, 0.5], [0, 0, 1, 0], [0, 1, 0, 0], [0, 0.5, 0, 0], [0, 0, 0, 0]]
    torch.testing.assert_close(shares, torch.tensor(expected, dtype=torch.float64))


def test_occupancy_table_sums_to_the_share_still_descending() -> None:
    predictor, real = DescentPredictor(trained()), toys.flights(1, seed=1, gappy=False)
    table = occupancy_table([predictor.predict(real, 300, 50)], 20.0)
    sums = table.group_by("time_s").agg(pl.col("probability").sum()).sort("time_s")["probability"]
    assert sums[0] == pytest.approx(1.0)
    assert sums.round(12).is_sorted(descending=True)


def test_draws_of_a_density_that_knows_too_much_are_spread_until_intervals_hold() -> None:
    """The density of the toy flights with a quarter of its deviations: its 90 % intervals hold too few."""
    density = trained()
    with torch.no_grad():
        density.scale_tril.mul_(0.25)
    sure = DescentPredictor(density)
    calibrated = sure.calibrated(toys.flights(120, seed=2), 290)
    assert float(calibrated.spread.factor[-1]) > 1.2
    real = toys.flights(220, seed=1)
    chosen = [i for i in range(220) if int(real.entry_level[i]) > 160][:120]

    def held(predictor: DescentPredictor) -> float:
        ahead = [predictor.predict(real.subset([i]), 290, 200, seed=i) for i in chosen]
        return float(coverage(time_intervals(ahead), actual_times(ahead, real)).filter(level_fl=150)["covered"].item())

    assert held(sure) < 0.78 < 0.82 < held(calibrated) < 0.98


def test_the_spread_of_times_is_the_one_with_which_intervals_hold() -> None:
    """Draws and truth of known distributions: factors are ratios of their quantiles, on skewed sides too."""
    drawn = normal(2_000, 1).exp().expand(-1, 2)  # ends at exp(+-1.645)
    truth = (torch.tensor([0.8, 0.5]) * normal(3_000, 2, seed=1)).exp()
    spread = holding_spread(torch.tensor([1, 8]), [misses(drawn, one) for one in truth])
    middle, low, high = (torch.quantile(drawn, q, dim=0) for q in (0.5, 0.05, 0.95))
    found = spread.factor
    held = ((truth - middle) <= found * (high - middle)) & ((middle - truth) <= found * (middle - low))
    assert bool(((held.double().mean(0) - 0.9).abs() < 0.005).all())
    assert float(found[1]) < float(found[0]) < 1
    assert holding_spread(torch.tensor([1, 8]), [torch.full((2,), 99.0)]).factor.tolist() == [MOST, MOST]
    assert holding_spread(torch.tensor([1]), []) is AS_DRAWN


def test_few_flights_have_one_factor_for_all_depths() -> None:
    some = [torch.tensor([0.1 * k, 0.2 * k, torch.nan]) for k in range(20)]
    few, many = (holding_spread(torch.tensor([1, 2, 4]), some * repeats).factor for repeats in (1, 3))
    assert few.unique().numel() == 1
    assert float(many[1]) > float(many[0])
    assert float(many[2]) == 1.0  # no flight is there


def test_times_are_moved_about_their_median_and_rates_go_with_them() -> None:
    predictor, real = DescentPredictor(trained()), toys.flights(1, seed=1, gappy=False)
    before = predictor.predict(real, 300, 100).trajectories
    spread = TimeSpread(torch.tensor([1.0, 150.0]).double(), torch.tensor([3.0, 1.5]).double())
    after = spread.applied(before)
    last = int(before.entry[0])
    for one in (0, last // 2, last - 1):
        factor = spread.at(torch.tensor([float(last - one)]).double())
        middle = before.time_s[:, one].quantile(0.5)
        expected = middle + factor * (before.time_s[:, one] - middle)
        torch.testing.assert_close(after.time_s[:, one], expected, rtol=1e-9, atol=1e-9)
    assert bool((after.time_s[:, : last + 1].diff(dim=1) < 0).all())
    assert bool((after.time_s[:, last] == 0).all())
    # The trapezoid rule gives back the times; rates are means of two legs, whose changes are small.
    step_m = (before.levels_fl[1] - before.levels_fl[0]) * 30.48
    legs = 0.5 * step_m * (1 / after.rate_mps[:, :last] + 1 / after.rate_mps[:, 1 : last + 1])
    torch.testing.assert_close(-legs.sum(1), after.time_s[:, 0], rtol=2e-3, atol=0.0)
    torch.testing.assert_close(after.cas_mps, before.cas_mps, rtol=0, atol=0)


def test_moved_times_never_turn_back() -> None:
    predictor, real = DescentPredictor(trained()), toys.flights(1, seed=1, gappy=False)
    wild = TimeSpread(torch.tensor([1.0, 2.0, 3.0]).double(), torch.tensor([99.0, 0.5, 99.0]).double())
    after = wild.applied(predictor.predict(real, 300, 100).trajectories)
    last = int(after.entry[0])
    assert bool((after.time_s[:, : last + 1].diff(dim=1) < 0).all())
    assert bool((after.rate_mps[:, : last + 1] < 0).all())
