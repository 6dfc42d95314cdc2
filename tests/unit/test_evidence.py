"""The inference of the diagnosis on example flights whose causes are known: verdicts, sizes, errors and limits."""

from dataclasses import replace

import numpy as np
import polars as pl
import pytest
import torch
from example_sides import example_sides

from descentflow.aircraft_types.registry import aircraft
from descentflow.diagnosis.correction.effects_in_flights import AddedEffects, corrected_entries
from descentflow.diagnosis.diagnosis_steps import diagnose_compared
from descentflow.diagnosis.gap._what_is_left import curves, remaining_of, standard_errors
from descentflow.diagnosis.inference.candidates import MeanEffect
from descentflow.diagnosis.inference.explain import detection_limits, explain
from descentflow.diagnosis.inference.moments import (
    left_open_by_coefficients,
    moments,
    sums_by_aircraft_and_day,
    sums_over,
)
from descentflow.diagnosis.inference.naming import nuisances
from descentflow.diagnosis.inference.signatures import Signatures
from descentflow.diagnosis.inference.verdict import verdict_of
from descentflow.diagnosis.sides.diagnosis_settings import Settings
from descentflow.diagnosis.sides.simulator import Simulator
from descentflow.diagnosis.sides.two_sides import Compared
from descentflow.diagnosis.sides.vectors import Entry
from descentflow.effects import EFFECTS, Effect
from descentflow.surveillance.cleaning.thresholds import Cleaning


def test_errors_of_a_mean_are_by_whole_aircraft() -> None:
    # Flights of one aircraft are alike: 20 aircraft of five flights know the mean as 20 flights do.
    rng = np.random.default_rng(1)
    variances = []
    for _ in range(400):
        own = np.repeat(rng.normal(size=(20, 1)), 5, axis=0)
        rows = sums_over(own - own.mean(0), np.repeat(np.arange(20), 5))
        variances.append((rows.T @ rows).item())
    assert np.mean(variances) == pytest.approx(1 / 20, rel=0.05)  # the mean of 400 is known to 1.6 %


@pytest.mark.parametrize("days", [4, 20])
def test_errors_of_a_mean_are_by_days_where_the_flights_of_a_day_are_alike(days: int) -> None:
    rng, inside = np.random.default_rng(4), 0
    day, quantities = np.repeat(np.arange(days), 10), np.array(["tas"])
    for _ in range(1000):
        seen = rng.normal(size=(days, 1))[day] + 0.3 * rng.normal(size=(len(day), 1))
        rows = sums_by_aircraft_and_day(seen - seen.mean(0), np.arange(len(day)), day, quantities, np.eye(1))
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
    explained = explain(replace(sides, y=sides.y + torch.where(sides.real[:, None], layers, 0.0)), catalogue)
    assert verdict_of(explained) == "none"
    assert "tas" in explained.best.unknown
    # Layers of 10 K have a cause, and so has the like of the rate; neither is a known one.
    explained = explain(replace(sides, y=sides.y + torch.where(sides.real[:, None], 5.0 * layers, 0.0)), catalogue)
    assert verdict_of(explained) == "unknown"
    at_rate = layers.roll(int(sides.columns("rate")[0] - sides.columns("tas")[0])) * 25.0
    explained = explain(replace(sides, y=sides.y + torch.where(sides.real[:, None], at_rate, 0.0)), catalogue)
    assert verdict_of(explained) == "unknown"


@pytest.mark.parametrize(("ratio", "listed"), [(1.2, ["noise_rate"]), (0.3, [])])
def test_missing_noise_is_listed_beside_a_cause_that_raises_some(ratio: float, listed: list[str]) -> None:
    sides = example_sides().only(torch.tensor([0]))
    noisy = torch.where(sides.real[:, None], sides.y + ratio, sides.y)
    of_noise = replace(sides, entries=(Entry("noise_rate", -1),), y=noisy)
    assert [lack.quantity for lack in nuisances(of_noise, raised=True)] == listed


def test_means_of_simulator_without_any_spread_are_known_to_their_rounding() -> None:
    sides = example_sides()
    y = torch.where(sides.real[:, None], sides.y, sides.y[~sides.real].mean(0))
    known = moments(replace(sides, y=y))
    real = moments(replace(sides, y=torch.where(sides.real[:, None], sides.y, 0.0)))
    assert np.isfinite(np.linalg.cholesky(known.covariance)).all()
    np.testing.assert_allclose(known.covariance, real.covariance, rtol=1e-6)


def bare(sides: Compared) -> Compared:
    """The same with a simulator that has one trajectory for all flights."""
    mean = sides.y[~sides.real].mean(0)
    state = sides.state
    cas_mps = torch.where(sides.real[:, None], state.cas_mps, state.cas_mps[~sides.real].mean(0))
    return replace(sides, y=torch.where(sides.real[:, None], sides.y, mean), state=replace(state, cas_mps=cas_mps))


@pytest.mark.parametrize(
    ("name", "theta"), [("temperature", [10.0]), ("drag_polar", [0.15]), ("wind_gradient", [0.004])]
)
@pytest.mark.parametrize("is_bare", [False, True])
def test_a_single_cause_is_named_with_its_size(name: str, theta: list[float], is_bare: bool) -> None:
    sides = example_sides(EFFECTS[name], theta, n=200)
    explained = explain(bare(sides) if is_bare else sides, EFFECTS)
    assert verdict_of(explained) == "effect"
    (named, group), *more = explained.named.groups.items()
    assert not more
    assert name in (named, *group)
    if named == name:
        size, error = explained.best.sizes[name], explained.best.errors[name]
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
    single = example_sides()
    index = torch.arange(len(single.y)).repeat_interleave(4)
    columns = {name: getattr(single, name)[index] for name in ("y", "real", "airframe", "day")}
    four = replace(single, **columns, state=single.state.rows(index))
    errors = [curves(sides, sides.y, standard_errors(sides))["tas"].error for sides in (single, four)]
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


@pytest.mark.parametrize(("name", "theta"), [("speed_schedule", [6.0, 0.006]), ("idle_thrust", [0.5])])
def test_a_signature_near_another_is_that_of_the_equation(name: str, theta: list[float]) -> None:
    sides, effect = example_sides(), EFFECTS[name]
    at = torch.tensor(theta, dtype=torch.float64)
    near = at + 0.24 * torch.tensor([parameter.scale for parameter in effect.parameters])
    kept, anew = (Signatures(sides, moments(sides)) for _ in range(2))
    kept.of(effect, at)
    extended, true = kept.of(effect, near), anew.of(effect, near)
    assert np.abs(extended.shift - true.shift).max() < 0.01 * np.abs(true.shift - anew.of(effect, 0 * at).shift).max()


def test_a_simulator_of_one_speed_leaves_its_rate_at_other_speeds_open() -> None:
    """By as much as the polar's own rate there changes with each part of the coefficients that is not known."""
    sides = example_sides()
    quantity = np.array([entry.quantity for entry in sides.entries])
    alike = replace(sides, state=sides.state.rows(torch.arange(80).repeat(2)))
    assert np.abs(left_open_by_coefficients(alike, quantity)).max() < 1e-12
    faster = torch.where(sides.real[:, None], 15.0, 0.0).double() + sides.state.cas_mps[torch.arange(80).repeat(2)]
    apart = replace(alike, state=replace(alike.state, cas_mps=faster))
    left_open = left_open_by_coefficients(apart, quantity)
    assert np.abs(left_open[quantity != "rate"]).max() == 0.0
    of_drag = left_open[quantity == "rate", np.argmax(np.abs(left_open).sum(0))]
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
    for factor, verdict in ((0.2, "none"), (1.6, "effect")):
        sides = example_sides(EFFECTS["temperature"], [factor * limit.size], n=100)
        assert verdict_of(explain(sides, {"temperature": EFFECTS["temperature"]})) == verdict
