"""The inference of the diagnosis against closed forms, and on toy flights whose causes are known."""

from dataclasses import replace

import numpy as np
import polars as pl
import pytest
import torch
from example_sides import example_sides
from scipy import stats

from descentflow.aircraft_types.registry import aircraft
from descentflow.core.linear_gaussian import Precisions, posterior, shrunk
from descentflow.diagnosis.correction.effects_in_flights import AddedEffects, corrected_entries
from descentflow.diagnosis.diagnosis_steps import diagnose_compared
from descentflow.diagnosis.gap._what_is_left import curves, remaining_of, standard_errors
from descentflow.diagnosis.inference._candidates import FlightsEffect, MeanEffect
from descentflow.diagnosis.inference._naming import Named, name_effects, nuisances
from descentflow.diagnosis.inference._sets import Search, SetFit, SetFits
from descentflow.diagnosis.inference.explain import changed_surely, detection_limits, explain
from descentflow.diagnosis.inference.flight_mixture import (
    FlightWindows,
    LearntLaw,
    fit_mixture,
    flight_windows,
)
from descentflow.diagnosis.inference.moments import (
    Moments,
    left_open_by_coefficients,
    moments,
    sums_by_aircraft_and_day,
    sums_over,
)
from descentflow.diagnosis.inference.signatures import Signatures, linearised
from descentflow.diagnosis.inference.verdict import verdict_of
from descentflow.diagnosis.sides._vectors import Entry
from descentflow.diagnosis.sides.assumptions import Assumptions
from descentflow.diagnosis.sides.diagnosis_settings import Settings
from descentflow.diagnosis.sides.simulator import Simulator
from descentflow.diagnosis.sides.two_sides import Compared
from descentflow.effects import EFFECTS, Effect
from descentflow.effects._example_flights import example_flights
from descentflow.surveillance.cleaning.thresholds import Cleaning

NONE = np.zeros(0)
LAW = LearntLaw(EFFECTS["speed_brake"], None, torch.zeros(8), None)  # type: ignore[arg-type]


def toy(difference: np.ndarray, sd: float = 0.1) -> Moments:
    """A difference of rates with independent errors."""
    p = len(difference)
    altitude = np.arange(p) * 600.0
    kernel = np.exp(-0.5 * ((altitude[:, None] - altitude) / 1800.0) ** 2)
    names = np.array(["rate"] * p)
    return Moments(difference, sd**2 * np.eye(p), np.zeros((1, p)), np.full(p, 0.002), names, kernel)


def column(name: str, shape: np.ndarray, prior_sd: float = 1.0) -> FlightsEffect:
    """A cause of a fixed shape and no misfit, whose size is expected to be one."""
    p = len(shape)
    return FlightsEffect(name, LAW, shape[:, None], 0.0, np.zeros((p, p)), np.array([prior_sd]))


def test_evidence_and_posterior_are_those_of_a_joint_normal_law() -> None:
    rng = np.random.default_rng(0)
    p, k = 7, 3
    root, jacobian = rng.normal(size=(p, p)), rng.normal(size=(p, k))
    noise, mean, spread = root @ root.T + np.eye(p), rng.normal(size=k), rng.uniform(0.5, 2.0, k)
    x = rng.normal(size=p)
    found = posterior(x, noise, jacobian, mean, spread)
    marginal = noise + (jacobian * spread**2) @ jacobian.T
    assert found.log_evidence == pytest.approx(stats.multivariate_normal(jacobian @ mean, marginal).logpdf(x))
    gain = (jacobian * spread**2).T @ np.linalg.inv(marginal)
    np.testing.assert_allclose(found.mean, mean + gain @ (x - jacobian @ mean))
    np.testing.assert_allclose(found.covariance, np.diag(spread**2) - gain @ jacobian * spread**2, atol=1e-12)


def test_evidence_without_sizes_is_a_normal_density() -> None:
    found = posterior(np.array([1.0, 2.0]), 4.0 * np.eye(2), np.zeros((2, 0)), NONE, NONE)
    assert found.log_evidence == pytest.approx(stats.norm(0, 2).logpdf([1.0, 2.0]).sum())


def test_errors_of_a_mean_are_by_whole_aircraft() -> None:
    # Flights of one aircraft are alike: 20 aircraft of five flights know the mean as 20 flights do.
    rng = np.random.default_rng(1)
    found = []
    for _ in range(400):
        own = np.repeat(rng.normal(size=(20, 1)), 5, axis=0)
        rows = sums_over(own - own.mean(0), np.repeat(np.arange(20), 5))
        found.append((rows.T @ rows).item())
    assert np.mean(found) == pytest.approx(1 / 20, rel=0.05)  # the mean of 400 is known to 1.6 %


@pytest.mark.parametrize("days", [4, 20])
def test_errors_of_a_mean_are_by_days_where_the_flights_of_a_day_are_alike(days: int) -> None:
    rng, inside = np.random.default_rng(4), 0
    day, one = np.repeat(np.arange(days), 10), np.array(["tas"])
    for _ in range(1000):
        seen = rng.normal(size=(days, 1))[day] + 0.3 * rng.normal(size=(len(day), 1))
        rows = sums_by_aircraft_and_day(seen - seen.mean(0), np.arange(len(day)), day, one, np.eye(1))
        inside += float(abs(seen.mean())) < 1.96 * np.sqrt((rows**2).sum())
    # Student's interval holds 95 %; the standard error of 1,000 is 0.7 %, and the ratio is never below one.
    assert 930 <= inside <= 975


def test_flights_of_one_day_are_known_by_their_aircraft() -> None:
    own = np.random.default_rng(5).normal(size=(30, 1))
    rows = sums_by_aircraft_and_day(own - own.mean(0), np.arange(30), np.zeros(30), np.array(["tas"]), np.eye(1))
    assert (rows**2).sum() == pytest.approx(own.var(ddof=1) / 30)


LIKELY = {name: EFFECTS[name] for name in ("temperature", "wind_gradient", "airspeed_bias", "drag_polar")}


@pytest.mark.parametrize("catalogue", [LIKELY, pytest.param(EFFECTS, marks=pytest.mark.slow)], ids=["likely", "all"])
def test_layers_of_air_that_a_simulator_lacks_are_no_cause(catalogue: dict[str, Effect]) -> None:
    sides = example_sides()
    layers = torch.zeros(len(sides.entries), dtype=torch.float64)
    layers[sides.columns("tas")] = 0.004 * torch.sin(torch.linspace(0, 6, 11, dtype=torch.float64))
    found = explain(replace(sides, y=sides.y + torch.where(sides.real[:, None], layers, 0.0)), catalogue)
    assert verdict_of(found) == "none"
    assert "tas" in found.best.unknown
    # Layers of 10 K have a cause, and so has the like of the rate; neither is a known one.
    found = explain(replace(sides, y=sides.y + torch.where(sides.real[:, None], 5.0 * layers, 0.0)), catalogue)
    assert verdict_of(found) == "unknown"
    at_rate = layers.roll(int(sides.columns("rate")[0] - sides.columns("tas")[0])) * 25.0
    found = explain(replace(sides, y=sides.y + torch.where(sides.real[:, None], at_rate, 0.0)), catalogue)
    assert verdict_of(found) == "unknown"


@pytest.mark.parametrize(("ratio", "listed"), [(1.2, ["noise_rate"]), (0.3, [])])
def test_missing_noise_is_listed_beside_a_cause_that_raises_some(ratio: float, listed: list[str]) -> None:
    sides = example_sides().only(torch.tensor([0]))
    noisy = torch.where(sides.real[:, None], sides.y + ratio, sides.y)
    of_noise = replace(sides, entries=(Entry("noise_rate", -1),), y=noisy)
    assert [lack.quantity for lack in nuisances(of_noise, raised=True)] == listed


def test_sizes_settle_where_the_misfit_grows_with_them() -> None:
    shape = np.ones(11)
    cause = FlightsEffect("e", LAW, shape[:, None], 0.0, 0.02 * np.ones((11, 11)), np.array([0.3]))
    fits = SetFits(toy(3.0 * shape), [cause], Assumptions())
    found = fits.fit(("e",), rounds=12)
    again = fits.fit(("e",), first=found.sizes)
    assert again.sizes["e"][0] == pytest.approx(found.sizes["e"][0], rel=0.01)


def test_sizes_that_are_put_into_flights_make_the_means_whatever_shapes_expect() -> None:
    """Only the sizes of a law are put into flights: what goes with the share alone has a factor of one."""
    sized, of_share = -0.1 * np.ones(11), -np.linspace(0.0, 0.3, 11)
    parts = np.stack([sized, of_share], 1)
    cause = FlightsEffect("e", LAW, parts, 0.0, 0.1 * np.eye(11), np.array([0.1, 0.2]))
    known = toy(2.5 * sized + of_share, sd=0.001)
    found = SetFits(known, [cause], Assumptions()).fit(("e",), is_exact=True)
    assert found.sizes["e"] == pytest.approx([2.5, 1.0], rel=0.001)  # drawn to one by (0.001 / 0.1)^2 / 11


def test_shrinking_keeps_variances_and_makes_few_rows_invertible() -> None:
    rows = np.random.default_rng(2).normal(size=(10, 40))
    found = shrunk(rows)
    np.testing.assert_allclose(found.diagonal(), (rows.T @ rows).diagonal())
    assert np.linalg.cond(found) < 1e4
    assert np.linalg.matrix_rank(rows.T @ rows) == 10


def test_means_of_simulator_without_any_spread_are_known_to_their_rounding() -> None:
    sides = example_sides()
    y = torch.where(sides.real[:, None], sides.y, sides.y[~sides.real].mean(0))
    found = moments(replace(sides, y=y))
    real = moments(replace(sides, y=torch.where(sides.real[:, None], sides.y, 0.0)))
    assert np.isfinite(np.linalg.cholesky(found.covariance)).all()
    np.testing.assert_allclose(found.covariance, real.covariance, rtol=1e-6)


@pytest.mark.parametrize("sizes", [(1.0, 0.0), (1.0, 1.0), (0.0, 0.0)])
def test_sets_of_toy_causes_have_the_weights_of_their_closed_form(sizes: tuple[float, float]) -> None:
    level, slope = np.ones(11), np.linspace(-1, 1, 11)
    known = toy(sizes[0] * level + sizes[1] * slope)
    causes = [column("level", level), column("slope", slope)]
    fits = SetFits(known, causes, Assumptions())
    odds = np.log(1 / 14)
    for names in [(), ("level",), ("slope",), ("level", "slope")]:
        shapes = np.array([level if name == "level" else slope for name in names]).reshape(len(names), 11)
        law = stats.multivariate_normal(shapes.sum(0), known.covariance + shapes.T @ shapes)
        assert fits.fit(names).log_weight == pytest.approx(law.logpdf(known.difference) + odds * len(names))
    best = Search(known, causes, Assumptions()).sets()[0]
    assert set(best.names) == {name for name, size in zip(("level", "slope"), sizes, strict=True) if size}


def test_intervals_of_sizes_hold_the_truth_as_often_as_they_say() -> None:
    rng = np.random.default_rng(3)
    shape, inside = np.linspace(0.5, 1.5, 11), 0
    for _ in range(400):
        size = rng.normal(1.0, 1.0)
        fits = SetFits(toy(size * shape + 0.1 * rng.normal(size=11)), [column("e", shape)], Assumptions())
        fit = fits.fit(("e",))
        if fit.sizes["e"][0] > 0:  # sizes are not below zero
            inside += abs(fit.sizes["e"][0] - size) < 1.645 * fit.errors["e"][0]
        else:
            inside += size < 1.645 * fit.errors["e"][0]
    # Of 400, 90 % are 360 with a standard deviation of 6: a right interval fails once in 3,000.
    assert 340 <= inside <= 380


def test_what_no_cause_explains_is_unknown() -> None:
    bump = np.exp(-0.5 * ((np.arange(11) - 5) / 1.5) ** 2)
    search = Search(toy(0.2 * bump, 0.005), [column("level", np.ones(11))], Assumptions())
    named = name_effects(search.sets(), Assumptions())
    assert named.unknown > 0.99
    assert not named.groups


def test_causes_that_look_alike_are_one_group() -> None:
    shape = np.ones(11)
    causes = [column("first", shape), column("second", shape * 1.001)]
    named = name_effects(Search(toy(shape, 0.01), causes, Assumptions()).sets(), Assumptions())
    assert {name: set(group) for name, group in named.groups.items()} in ({"first": {"second"}}, {"second": {"first"}})


def test_members_of_a_scale_group_stand_together_unless_one_is_surely_the_cause() -> None:
    def one(name: str, weight: float) -> SetFit:
        return SetFit((name,), {}, {}, {}, weight, {}, np.eye(1))

    sets, alike = (
        [one("mass", 0.0), one("drag_polar", -4.0), one("idle_thrust", -9.0)],
        [EFFECTS["mass"].scale_group.members],
    )  # type: ignore[union-attr]
    assert name_effects(sets, Assumptions(), alike).groups == {"mass": ("drag_polar",)}


def test_linearised_candidates_are_their_own_where_they_are_linear() -> None:
    effect = column("e", np.linspace(0, 1, 5))
    found = linearised(effect.at(np.array([2.0])), np.array([-1.5]))
    np.testing.assert_allclose(found.shift, effect.at(np.array([0.5])).shift)


def test_precisions_of_partly_seen_flights_are_those_of_what_is_seen() -> None:
    rng = np.random.default_rng(4)
    root = rng.normal(size=(4, 4))
    covariance = root @ root.T + np.eye(4)
    seen = np.array([[True, True, False, True], [True] * 4])
    values = np.where(seen, rng.normal(size=(2, 4)), 0.0)
    found = Precisions(covariance, seen).log_density(values)
    for i in range(2):
        at = np.flatnonzero(seen[i])
        law = stats.multivariate_normal(np.zeros(len(at)), covariance[np.ix_(at, at)])
        assert found[i] - 0.5 * len(at) * np.log(2 * np.pi) == pytest.approx(law.logpdf(values[i, at]))


def brakes_in(
    n: int, share: float, drag: float, window_fl: tuple[float, float] = (210.0, 260.0)
) -> tuple[np.ndarray, FlightWindows, np.ndarray]:
    """Flights, of which a share has brakes out between two levels of its own."""
    state = example_flights(n)
    effect = EFFECTS["speed_brake"]
    seen = np.ones((n, 11), dtype=bool)
    windows = flight_windows(effect, state, np.arange(11), seen)  # type: ignore[arg-type]
    rng = np.random.default_rng(5)
    has = np.arange(n) < share * n
    window = effect.within(state, *map(torch.tensor, window_fl))["rate"].numpy()  # type: ignore[attr-defined]
    values = 0.02 * rng.normal(size=(n, 11)) + has[:, None] * drag * window * windows.shape
    return values - values.mean(0), windows, has


def test_a_mixture_finds_the_share_size_and_window_of_brakes() -> None:
    values, windows, has = brakes_in(300, 0.4, 0.5)
    seen = np.ones(values.shape, dtype=bool)
    spread = 4e-4 * np.eye(11)
    found = fit_mixture(values, seen, spread, [], [windows], 25)
    without = fit_mixture(values, seen, spread, [], [], 1)
    assert found.log_likelihood > without.log_likelihood + 500
    assert found.shares["speed_brake"] == pytest.approx(0.4, abs=0.02)
    law = found.laws["speed_brake"]
    _, mean, _ = windows.effect.size(law.theta)
    assert mean == pytest.approx(0.5, rel=0.1)
    assert np.mean((found.normal < 0.5) == has) > 0.98
    low, high = law.theta[1:3].tolist()
    assert (low, high) == (pytest.approx(210, abs=8), pytest.approx(260, abs=8))
    # Of all sizes 1.2 times: the mean over all flights of the drag added.
    assert float(law.at(1.2)[0]) == pytest.approx(1.2 * float(law.at(1.0)[0]), rel=1e-6)


def test_windows_between_the_steps_of_the_first_grid_are_found() -> None:
    """About a law of one window the grid is finer, so that no step of it decides where brakes run out."""
    values, windows, _ = brakes_in(300, 0.4, 0.5, window_fl=(214.0, 257.0))
    seen, spread = np.ones(values.shape, dtype=bool), 4e-4 * np.eye(11)
    first = fit_mixture(values, seen, spread, [], [windows], 8).laws["speed_brake"].theta
    about = flight_windows(windows.effect, windows.state, np.arange(11), seen, first)
    law = fit_mixture(values, seen, spread, [], [about], 25).laws["speed_brake"]
    assert law.effect.grid_fl < EFFECTS["speed_brake"].grid_fl  # type: ignore[attr-defined]
    assert law.theta[1:3].tolist() == [pytest.approx(214, abs=2), pytest.approx(257, abs=2)]


def test_a_mixture_finds_nothing_in_normal_flights() -> None:
    values, windows, _ = brakes_in(300, 0.0, 0.5)
    found = fit_mixture(values, np.ones(values.shape, dtype=bool), 4e-4 * np.eye(11), [], [windows], 25)
    assert found.shares["speed_brake"] < 0.02


def bare(sides: Compared) -> Compared:
    """The same with a simulator that has one trajectory for all flights."""
    mean = sides.y[~sides.real].mean(0)
    state = sides.state
    one = torch.where(sides.real[:, None], state.cas_mps, state.cas_mps[~sides.real].mean(0))
    return replace(sides, y=torch.where(sides.real[:, None], sides.y, mean), state=replace(state, cas_mps=one))


@pytest.mark.parametrize(
    ("name", "theta"), [("temperature", [10.0]), ("drag_polar", [0.15]), ("wind_gradient", [0.004])]
)
@pytest.mark.parametrize("is_bare", [False, True])
def test_a_single_cause_is_named_with_its_size(name: str, theta: list[float], is_bare: bool) -> None:
    sides = example_sides(EFFECTS[name], theta, n=200)
    found = explain(bare(sides) if is_bare else sides, EFFECTS)
    assert verdict_of(found) == "effect"
    (named, group), *more = found.named.groups.items()
    assert not more
    assert name in (named, *group)
    if named == name:
        size, error = found.best.sizes[name], found.best.errors[name]
        assert abs(size[0] - theta[0]) < 4 * error[0]


def test_no_cause_is_named_between_flights_of_one_population() -> None:
    called = 0
    for n, is_bare in ((60, False), (120, True)):
        sides = example_sides(n=n)
        called += verdict_of(explain(bare(sides) if is_bare else sides, EFFECTS)) != "none"
    assert called == 0


def asked(**other: object) -> Settings:
    return Settings(Simulator(aircraft("A320")), EFFECTS, [], 0, str, **other)  # type: ignore[arg-type]


@pytest.mark.parametrize(("name", "theta"), [("temperature", [10.0]), ("drag_polar", [0.15])])
def test_closure_is_measured_on_simulated_flights_that_have_the_cause(name: str, theta: list[float]) -> None:
    report = diagnose_compared(example_sides(EFFECTS[name], theta, n=200), asked(), "samples", {}, pl.DataFrame())
    assert report.verdict == "effect"
    closed = report.causes[0].closure.marginal
    assert closed.estimate is not None
    assert closed.estimate > 0.9
    # The page, gap.json and the corrected flights say the same: what is left of the gap is that share of it.
    left = (report.gap_after - report.floor) / (report.gap_before - report.floor)
    assert 1 - left == pytest.approx(closed.estimate)
    time = next(cost for cost in report.costs if cost.name == "time")
    assert time.after is not None
    assert abs(time.after.estimate) < 0.2 * abs(time.before.estimate)


def test_the_error_of_a_curve_counts_aircraft_and_not_flights() -> None:
    """Four flights of one aircraft that are alike say no more than one of them."""
    one = example_sides()
    index = torch.arange(len(one.y)).repeat_interleave(4)
    four = replace(
        one,
        y=one.y[index],
        real=one.real[index],
        airframe=one.airframe[index],
        day=one.day[index],
        state=one.state.rows(index),
    )
    errors = [curves(sides, sides.y, standard_errors(sides))["tas"].error for sides in (one, four)]
    assert errors[1] == pytest.approx(errors[0], rel=1e-9)


def test_the_largest_difference_left_is_one_beyond_chance() -> None:
    sides = example_sides()
    cas, rate = sides.columns("cas")[3], sides.columns("rate")[5]
    left = torch.zeros_like(sides.y)
    left[sides.real, cas], left[sides.real, rate] = 4.0, 0.01  # eight and five negligible shifts
    errors = [torch.ones(len(sides.entries)).double() * error for error in (3.0, 0.002)]
    assert [remaining_of(sides, left, error, 0.0, 0.0).largest.quantity for error in errors] == ["cas", "cas"]
    errors[0][rate] = 0.002
    assert remaining_of(sides, left, errors[0], 0.0, 0.0).largest.quantity == "rate"


def test_an_interval_that_holds_no_change_is_of_no_cause() -> None:
    """Idle thrust x 1.44 (0.87 to 2.01) is none; a bias that does not grow with Mach number is one by its constant."""
    sides = example_sides()
    signatures = Signatures(sides, moments(sides))
    idle, bias = (MeanEffect(EFFECTS[name], signatures) for name in ("idle_thrust", "airspeed_bias"))
    assert not idle.differs(np.array([0.44]), np.array([0.346]))
    assert idle.differs(np.array([0.68]), np.array([0.255]))
    assert bias.differs(np.array([-3.0, 0.01]), np.array([0.1, 0.08]))


class OfNoSureChange(FlightsEffect):
    """A cause whose interval holds no change, whatever its size."""

    def differs(self, sizes: np.ndarray, errors: np.ndarray) -> bool:
        return False


@pytest.mark.parametrize(
    ("sure", "other", "groups"),
    [(True, 0.4, {"second": ("first",)}), (False, 0.4, {}), (True, 0.3, {})],
    ids=["another is sure", "none is sure", "there may be no cause"],
)
def test_another_of_a_group_leads_where_the_first_may_be_no_change(
    sure: bool, other: float, groups: dict[str, object]
) -> None:
    first, second = (column(name, np.ones(11)) for name in ("first", "second"))
    unsure = [OfNoSureChange(**vars(one)) for one in (first, second)]
    fits = SetFits(toy(np.ones(11), 0.01), [unsure[0], second if sure else unsure[1]], Assumptions())
    named = Named(np.ones(1), {"first": 0.6, "second": other}, 0.0, 0.0, {"first": ("second",)})
    best, found = changed_surely(fits.fit(("first",)), named, fits.fit, fits)
    assert best.names == tuple(groups)
    assert found.groups == groups


@pytest.mark.parametrize(("name", "theta"), [("speed_schedule", [6.0, 0.006]), ("idle_thrust", [0.5])])
def test_a_signature_near_another_is_that_of_the_equation(name: str, theta: list[float]) -> None:
    sides, effect = example_sides(), EFFECTS[name]
    at = torch.tensor(theta, dtype=torch.float64)
    near = at + 0.24 * torch.tensor([parameter.scale for parameter in effect.parameters])
    kept, anew = (Signatures(sides, moments(sides)) for _ in range(2))
    kept.of(effect, at)
    found, true = kept.of(effect, near), anew.of(effect, near)
    assert np.abs(found.shift - true.shift).max() < 0.01 * np.abs(true.shift - anew.of(effect, 0 * at).shift).max()


def test_a_simulator_of_one_speed_leaves_its_rate_at_other_speeds_open() -> None:
    """By as much as the polar's own rate there changes with each part of the coefficients that is not known."""
    sides = example_sides()
    quantity = np.array([entry.quantity for entry in sides.entries])
    alike = replace(sides, state=sides.state.rows(torch.arange(80).repeat(2)))
    assert np.abs(left_open_by_coefficients(alike, quantity)).max() < 1e-12
    faster = torch.where(sides.real[:, None], 15.0, 0.0).double() + sides.state.cas_mps[torch.arange(80).repeat(2)]
    apart = replace(alike, state=replace(alike.state, cas_mps=faster))
    found = left_open_by_coefficients(apart, quantity)
    assert np.abs(found[quantity != "rate"]).max() == 0.0
    of_drag = found[quantity == "rate", np.argmax(np.abs(found).sum(0))]
    assert 0.003 < np.abs(of_drag).max() < 0.3  # of ln rate


@pytest.mark.parametrize(
    ("name", "theta"),
    [
        ("temperature", [10.0]),
        ("wind_gradient", [0.003]),
        ("drag_polar", [0.1]),
        ("speed_schedule", [10.0, 0.01]),
        ("airspeed_bias", [3.0, 2.0]),
        ("vertical_rate_lag", [8.0, 0.0]),
    ],
)
def test_effects_in_simulated_entries_are_their_signatures(name: str, theta: list[float]) -> None:
    """The correction puts into flights what the evidence takes an effect to shift, and nothing else."""
    sides, effect = example_sides(), EFFECTS[name]
    correction = AddedEffects(EFFECTS, {name: torch.tensor(theta)}, sides.state.mass_kg, Cleaning(), seed=0)
    moved = corrected_entries(sides, correction) - sides.y
    assert float(moved[sides.real].abs().max()) == 0.0
    shift = sides.vector(effect.shift(replace(sides.state, affected=False), torch.tensor(theta).double()))
    torch.testing.assert_close(moved[~sides.real], shift[~sides.real], atol=2e-3, rtol=0.02)


def test_limits_are_sizes_that_are_named_in_most_cases() -> None:
    limit = detection_limits(explain(example_sides(n=100), {"temperature": EFFECTS["temperature"]}))[0]
    assert limit.size is not None
    named = {
        factor: verdict_of(
            explain(
                example_sides(EFFECTS["temperature"], [factor * limit.size], n=100),
                {"temperature": EFFECTS["temperature"]},
            )
        )
        for factor in (0.2, 1.6)
    }
    assert named == {0.2: "none", 1.6: "effect"}
