"""The gap entry by entry: closed forms, and its error by resampling against that of many fleets."""

from dataclasses import replace

import pytest
import torch
from example_sides import example_sides

from descentflow.diagnosis.findings._gap_found import MeasuredEntry
from descentflow.diagnosis.gap._labellings import mean_over_quantities
from descentflow.diagnosis.gap._measured_gap import MeasuredGap, measured_again
from descentflow.diagnosis.gap._previous_round import achieved_share
from descentflow.effects import EFFECTS


def test_the_same_flights_are_measured_the_same_again() -> None:
    sides = example_sides(EFFECTS["temperature"], [10.0])
    chosen = sides.of("tas") | sides.of("rate")
    then = MeasuredGap(sides, chosen, seed=0)
    again, spreads, *earlier = measured_again(sides, then.entries())
    now, floor = MeasuredGap(sides, again, 0, spreads), then.floor(sides.y)
    assert torch.equal(again, chosen)
    assert (now.before, now.floor(sides.y)) == pytest.approx((then.before, floor), rel=1e-12)
    means = [float(mean_over_quantities(sides, one, again)) for one in earlier]
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
    found = achieved_share(before, floor, error, now, floor, error_now)
    generator = torch.Generator().manual_seed(0)
    draws = torch.randn(2, 200_000, generator=generator).double()
    shares = 1 - (now + error_now * draws[0] - floor) / (before + error * draws[1] - floor)
    assert found.estimate == pytest.approx(1 - 0.2 / 0.9)
    assert (found.high - found.low) / 2 == pytest.approx(1.645 * float(shares.std()), rel=0.02)
    assert achieved_share(0.1, 0.1, 0.0, 0.1, 0.1, 0.0).estimate is None
