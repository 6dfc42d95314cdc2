"""The gap entry by entry with its error, and gaps that are more than chance and do not matter."""

from dataclasses import replace

import polars as pl
import pytest
import torch
from example_sides import example_sides

from descentflow.aircraft_types.registry import aircraft
from descentflow.core.mode_s_steps import STEPS
from descentflow.diagnosis.diagnosis_steps import diagnose_compared
from descentflow.diagnosis.findings.gap_found import MeasuredEntry
from descentflow.diagnosis.gap._labellings import mean_over_quantities
from descentflow.diagnosis.gap._measured_gap import MeasuredGap, measured_again
from descentflow.diagnosis.gap._previous_round import achieved_share
from descentflow.diagnosis.gap._where import where
from descentflow.diagnosis.gap.costs import costs_of, profile_of
from descentflow.diagnosis.gap.practical_size import below_rounding, rounding_of
from descentflow.diagnosis.report.gap_report import GapReport
from descentflow.diagnosis.report.page import page
from descentflow.diagnosis.sides.diagnosis_settings import Settings
from descentflow.diagnosis.sides.simulator import Simulator
from descentflow.diagnosis.sides.two_sides import Compared
from descentflow.effects import EFFECTS


def test_the_same_flights_are_measured_the_same_again() -> None:
    sides = example_sides(EFFECTS["temperature"], [10.0])
    chosen = sides.of("tas") | sides.of("rate")
    then = MeasuredGap(sides, chosen, seed=0)
    again, spreads, *earlier = measured_again(sides, then.entries())
    now, floor = MeasuredGap(sides, again, 0, spreads), then.floor(sides.y)
    assert torch.equal(again, chosen)
    assert (now.before, now.floor(sides.y)) == pytest.approx((then.before, floor), rel=1e-12)
    means = [float(mean_over_quantities(sides, measured, again)) for measured in earlier]
    assert means == pytest.approx([then.before, floor], rel=1e-12)


def test_other_spreads_are_those_of_the_round_before() -> None:
    sides = example_sides(EFFECTS["temperature"], [10.0])
    then = MeasuredGap(sides, sides.of("tas"), seed=0)
    wider = [MeasuredEntry(e.quantity, e.low_fl, e.high_fl, 2 * e.spread, e.distance, e.floor) for e in then.entries()]
    again, spreads, *_ = measured_again(sides, wider)
    assert MeasuredGap(sides, again, 0, spreads).before == pytest.approx(then.before / 2, rel=1e-12)


def test_the_error_of_a_gap_is_that_between_samples() -> None:
    """Forty samples give a standard deviation to a ninth, a jackknife over twenty groups to a sixth: 45 % allowed."""
    like = example_sides(EFFECTS["temperature"], [10.0])
    generator = torch.Generator().manual_seed(1)
    drawn = [torch.randn(like.y.shape, generator=generator).double() for _ in range(40)]
    each = torch.arange(len(like.y))
    found = [
        replace(like, y=y + 1.0 * like.real[:, None], scale=torch.ones_like(like.scale), airframe=each) for y in drawn
    ]
    gaps = torch.tensor([MeasuredGap(s, s.of("tas"), 0).before for s in found])
    errors = torch.tensor([MeasuredGap(s, s.of("tas"), 0).error for s in found[:5]])
    assert float(errors.mean()) == pytest.approx(float(gaps.std()), rel=0.45)


def test_the_interval_of_achieved_closure_is_the_delta_method() -> None:
    """Of (now - floor) / (then - floor) with independent errors, by 200,000 draws: to two hundredths of its width."""
    before, floor, error, now, error_now = 1.0, 0.1, 0.05, 0.3, 0.04
    share = achieved_share(before, floor, error, now, floor, error_now)
    generator = torch.Generator().manual_seed(0)
    draws = torch.randn(2, 200_000, generator=generator).double()
    shares = 1 - (now + error_now * draws[0] - floor) / (before + error * draws[1] - floor)
    assert share.estimate == pytest.approx(1 - 0.2 / 0.9)
    assert (share.high - share.low) / 2 == pytest.approx(1.645 * float(shares.std()), rel=0.02)
    assert achieved_share(0.1, 0.1, 0.0, 0.1, 0.1, 0.0).estimate is None


MANY = 1500


def diagnosed(sides: Compared) -> GapReport:
    asked = Settings(Simulator(aircraft("A320")), {"temperature": EFFECTS["temperature"]}, [], 0, str)
    return GapReport(**vars(diagnose_compared(sides, asked, "training flights", {}, pl.DataFrame())))


def small_gap(sides: Compared) -> list[str]:
    cells = where(sides, 290.0, 0)
    return [row.quantity for row in below_rounding(sides, cells, costs_of(sides, None, 0), profile_of(sides))]


def test_the_uncertainty_of_a_quantity_is_that_of_rounding_its_fields() -> None:
    """Reports rounded to the steps, against the formula: a true airspeed over that of its Mach number."""
    sides = example_sides()
    profile = profile_of(sides)
    rounding = rounding_of(sides, profile)[sides.columns("tas")]
    generator = torch.Generator().manual_seed(0)
    for at, here in ((0, profile[0]), (10, profile[10])):
        mach = float(sides.state.mach()[:, at].mean())
        tas = here.tas_kt + 40 * torch.rand(200_000, generator=generator, dtype=torch.float64) - 20
        ratio = mach + 0.1 * torch.rand(200_000, generator=generator, dtype=torch.float64) - 0.05
        reported = [torch.round(v / STEPS[n]) * STEPS[n] for v, n in ((tas, "TAS"), (ratio, "Mach"))]
        error = (reported[0] / tas).log() - (reported[1] / ratio).log()
        # Speeds within 5 % of the middle: their mean uncertainty is that of the middle to 1 %.
        assert float(rounding[at]) == pytest.approx(float(error.std()), rel=0.01)


def test_a_fifth_of_a_kelvin_is_measurable_and_no_gap_to_explain() -> None:
    report = diagnosed(example_sides(EFFECTS["temperature"], [0.3], MANY))
    assert report.p_value < 0.02
    assert report.verdict == "none"
    assert report.causes == []
    assert {row.quantity for row in report.below_rounding} == {"rate", "cas", "tas"}
    said = "differ by less than the rounding of one flight's reports."
    assert said in str(report)
    assert "true airspeed against Mach number" in page(report)


def test_a_small_cost_of_time_that_is_more_than_chance_counts() -> None:
    """A rate that is 2 % slower throughout, and the time that it takes with it."""
    sides = example_sides(n=MANY)
    slower = torch.where(sides.real[:, None] & sides.of("rate"), -0.02, 0.0)
    assert small_gap(sides)
    assert small_gap(replace(sides, y=sides.y + slower)) == []


def test_flights_that_differ_more_are_a_gap_though_their_means_agree() -> None:
    sides = example_sides(n=MANY)
    wider = torch.where(sides.real[:, None] & sides.of("cas"), 1.5 * sides.y, sides.y)
    assert small_gap(replace(sides, y=wider)) == []


def test_few_flights_cannot_say_that_a_gap_is_small() -> None:
    assert small_gap(example_sides(EFFECTS["temperature"], [0.3], 80)) == []
