"""Costs of a gap against closed forms, and their intervals against repeated draws."""

import math
from dataclasses import replace

import pytest
import torch
from example_sides import example_sides
from torch import Tensor

from descentflow.core.units import FPM_MPS, KT_MPS, NM_M
from descentflow.diagnosis.findings.costs_found import Cost
from descentflow.diagnosis.gap.costs import costs_of, profile_of
from descentflow.diagnosis.sides.two_sides import Compared
from descentflow.diagnosis.sides.vectors import Entry
from descentflow.effects import EFFECTS
from descentflow.physics.airspeed import cas_to_mach, mach_to_tas_mps

LOW_M, HIGH_M = 15_000 * 0.3048, 37_000 * 0.3048


def flying(rate_mps: Tensor, tas_mps: float = 200.0, tailwind_mps: float = 0.0) -> Compared:
    """Flights of both sides at rates (n, 1) or (n, K), with one TAS and one tailwind in every band."""
    sides = example_sides()
    wind = tuple(Entry("wind", band) for band in range(11))
    state = sides.state
    standard = mach_to_tas_mps(cas_to_mach(state.cas_mps, state.altitude_m), state.altitude_m)
    columns = {
        "rate": rate_mps.log() - state.own_log_rate,
        "tas": math.log(tas_mps) - standard.log(),
        "cas": state.cas_mps / KT_MPS,
        "wind": torch.zeros_like(state.cas_mps),
    }
    entries = (*sides.entries, *wind)
    y = torch.stack([columns[e.quantity][:, e.band] for e in entries], 1)
    state = replace(state, tailwind_mps=torch.full_like(state.cas_mps, tailwind_mps))
    return replace(sides, entries=entries, y=y, state=state, scale=torch.ones(44).double())


def by_name(costs: list[Cost], part: int = 0) -> dict[str, Cost]:
    """Costs of the whole range (0) or of a third."""
    ranges = list(dict.fromkeys((c.low_fl, c.high_fl) for c in costs))
    return {c.name: c for c in costs if (c.low_fl, c.high_fl) == ranges[part]}


def two_rates(simulator: float, flights: float) -> Tensor:
    return torch.tensor([simulator] * 80 + [flights] * 80).double()[:, None]


def test_constant_rates_and_speeds_have_a_closed_form() -> None:
    costs = costs_of(flying(two_rates(12.0, 10.0), tas_mps=200.0, tailwind_mps=15.0), None, seed=0)
    whole = by_name(costs)
    height = HIGH_M - LOW_M
    assert (whole["time"].low_fl, whole["time"].high_fl) == (150.0, 370.0)
    # All flights are alike, so intervals have no width; 1e-9 is the rounding of a sum of eleven bands.
    exact = {
        "time": (height / 12, height / 10),
        "air_distance": (200 * height / 12 / NM_M, 200 * height / 10 / NM_M),
        "ground_distance": tuple((math.sqrt(200**2 - r**2) + 15) * height / r / NM_M for r in (12, 10)),
        "rate": (12 / FPM_MPS, 10 / FPM_MPS),
        "tas": (200 / KT_MPS, 200 / KT_MPS),
    }
    for name, (simulator, flights) in exact.items():
        cost = whole[name]
        assert (cost.simulator, cost.flights) == pytest.approx((simulator, flights), rel=1e-9)
        assert cost.before.estimate == pytest.approx(flights - simulator, rel=1e-9, abs=1e-9)
        assert cost.before.low == pytest.approx(cost.before.high, rel=1e-9, abs=1e-9)
        assert cost.after is None


def test_thirds_add_up_to_the_whole() -> None:
    costs = costs_of(flying(two_rates(12.0, 10.0)), None, seed=0)
    assert sum(by_name(costs, part)["time"].before.estimate for part in (1, 2, 3)) == pytest.approx(
        by_name(costs)["time"].before.estimate
    )
    assert [by_name(costs, part)["time"].low_fl for part in (1, 2, 3)] == [150.0, 230.0, 290.0]


def test_the_mean_rate_is_height_over_mean_time() -> None:
    rate = two_rates(12.0, 12.0)
    rate[120:] = torch.tensor([[8.0], [24.0]]).repeat(20, 1)  # of equal height, half at a third of the rate
    costs = by_name(costs_of(flying(rate), None, seed=0))
    assert costs["rate"].flights == pytest.approx(2 / (1 / 8 + 1 / 24) / FPM_MPS)
    assert costs["time"].flights == pytest.approx(costs["time"].simulator)
    assert costs["rate"].before.estimate == pytest.approx(0.0, abs=1e-9)


def test_a_rate_that_grows_with_altitude_has_a_logarithm_for_its_time() -> None:
    a, b = 2.0, 1e-3
    altitude = example_sides().state.altitude_m
    rate = (a + b * altitude).expand(160, -1)
    exact = math.log((a + b * HIGH_M) / (a + b * LOW_M)) / b
    # The midpoint rule is off by at most width^2 / 24 times the height and the largest second derivative.
    width = (HIGH_M - LOW_M) / 11
    bound = width**2 / 24 * (HIGH_M - LOW_M) * 2 * b**2 / (a + b * LOW_M) ** 3
    costs = by_name(costs_of(flying(rate), None, seed=0))["time"].flights
    assert 0 < abs(costs - exact) <= bound


def test_what_a_cause_makes_is_gone_after_it() -> None:
    sides = example_sides(EFFECTS["temperature"], [10.0], n=200)
    shift = sides.vector(EFFECTS["temperature"].shift(sides.state, torch.tensor([10.0]).double()))
    shift = torch.where(sides.real[:, None], shift, 0.0)
    plain = by_name(costs_of(example_sides(n=200), None, seed=0))
    warm = by_name(costs_of(sides, sides.y - shift, seed=0))
    for name in ("time", "air_distance", "rate", "tas"):
        assert warm[name].after is not None
        assert warm[name].after.estimate == pytest.approx(plain[name].before.estimate, abs=1e-9)
    # Two to three per cent of the time for ten kelvin (energy equation at constant Mach number and CAS).
    ratio = (warm["time"].before.estimate - plain["time"].before.estimate) / plain["time"].flights
    assert ratio == pytest.approx(0.023, abs=0.004)
    assert warm["time"].before.excludes_zero


def test_slower_flights_cost_time_by_their_speed() -> None:
    """Taking a change of CAS off changes TAS, and the rate with it by the polar."""
    sides = example_sides(EFFECTS["speed_schedule"], [20.0, 0.0], n=40)
    shift = torch.zeros_like(sides.y)
    shift[:, sides.columns("cas")] = 20.0
    shift = torch.where(sides.real[:, None], shift, 0.0)
    costs = by_name(costs_of(sides, sides.y - shift, seed=0))
    assert costs["cas"].before.estimate - costs["cas"].after.estimate == pytest.approx(20.0)
    assert costs["tas"].after is None if "tas" not in costs else costs["tas"].after.estimate < costs["tas"].flights
    # Twenty knots less: a longer descent, by the polar.
    assert costs["time"].after.estimate > costs["time"].before.estimate


def test_at_equal_speed_only_what_the_polar_does_not_say_counts() -> None:
    """Flights of one aircraft at other speeds take another time, and none at equal speed."""
    sides = example_sides(n=40)
    state = sides.state
    faster = torch.where(sides.real[:, None], 15.0 * KT_MPS, 0.0).double()
    state = replace(state, cas_mps=state.cas_mps[:1] + faster, cas_slope_per_s=state.cas_slope_per_s[:1].expand(80, -1),
                    tailwind_mps=state.tailwind_mps[:1].expand(80, -1))  # fmt: skip
    at = sides.columns("rate")
    y = sides.y.clone()
    y[:, at] = math.log(1.02) * sides.real.double()[:, None]
    alike = by_name(costs_of(replace(sides, state=state, y=y), None, seed=0))
    assert abs(alike["time"].before.estimate) > 0.04 * alike["time"].simulator
    # Two per cent more rate, two per cent less time: exact, for all else is alike.
    equal = alike["time_at_speed"]
    assert equal.before.estimate == pytest.approx((1 / 1.02 - 1) * equal.simulator, rel=1e-9)
    assert equal.simulator == pytest.approx(alike["time"].simulator, rel=1e-9)


def test_nominal_bada_flies_each_flights_own_speed() -> None:
    sides = flying(two_rates(10.0, 10.0))
    # Physics says nothing of the speed that crews choose.
    sides = sides.only(torch.nonzero(~sides.of("cas"))[:, 0])
    alone = replace(sides, y=sides.y[80:], real=sides.real[80:], airframe=sides.airframe[80:])
    alone = replace(alone, state=sides.state.rows(torch.arange(80, 160)))
    cost = by_name(costs_of(alone, None, seed=0))["time"]
    polar = (alone.state.width_m / alone.state.own_log_rate.exp()).sum(1).mean()
    assert cost.simulator == pytest.approx(float(polar))
    assert cost.flights == pytest.approx((HIGH_M - LOW_M) / 10)


def test_flights_that_begin_lower_down_do_not_shorten_the_descent() -> None:
    sides = flying(two_rates(12.0, 10.0))
    y = sides.y.clone()
    upper = torch.tensor([e.band >= 6 for e in sides.entries])
    y[120:, upper] = torch.nan
    costs = by_name(costs_of(replace(sides, y=y), None, seed=0))["time"]
    assert costs.flights == pytest.approx((HIGH_M - LOW_M) / 10)


def test_intervals_of_whole_aircraft_cover_the_truth() -> None:
    """Aircraft of four alike flights: intervals of flights would cover some 60 %, those of aircraft 90 %."""
    covered, above_floor, runs, per = 0, 0, 200, 4
    n = 25 * per
    sides = flying(torch.full((160, 1), 10.0).double())
    rows = torch.arange(2 * n) % 160
    sides = replace(sides, state=sides.state.rows(rows), y=sides.y[rows], real=torch.arange(2 * n) >= n,
                    airframe=torch.arange(2 * n) // per)  # fmt: skip
    at = sides.columns("rate")
    generator = torch.Generator().manual_seed(5)
    for run in range(runs):
        own = 0.05 * torch.randn(2 * n // per, 1, generator=generator, dtype=torch.float64)
        y = sides.y.clone()
        y[:, at] += own.repeat_interleave(per, 0)
        time = by_name(costs_of(replace(sides, y=y), None, seed=run))["time"]
        covered += time.before.low <= 0.0 <= time.before.high
        above_floor += abs(time.before.estimate) > time.floor
    # Binomial: 90 % of 200 runs is 180, spread 4.2; 25 aircraft a side take a per cent or two off. Four spreads.
    assert 160 <= covered <= 195
    assert 4 <= above_floor <= 40


def test_the_profile_is_what_the_simulator_flies() -> None:
    profile = profile_of(flying(two_rates(12.0, 10.0), tas_mps=200.0))
    assert [means.level_fl for means in profile] == pytest.approx([160.0 + 20 * k for k in range(11)])
    assert [means.rate_fpm for means in profile] == pytest.approx([12 / FPM_MPS] * 11)
    # Distance over time, with knots and miles as BADA and ICAO have them: they differ by a part in a million.
    assert [means.tas_kt for means in profile] == pytest.approx([200 / KT_MPS] * 11)


def test_without_a_rate_there_is_no_cost() -> None:
    sides = example_sides()
    assert costs_of(sides.only(sides.columns("tas")), None, seed=0) == []
