"""Turns: the bank by headings and times, rates without each flight's own, and what is named for them."""

from dataclasses import replace
from typing import Any

import pytest
import torch
from example_sides import example_sides
from torch import Tensor

from descentflow.aircraft_types.registry import aircraft
from descentflow.core.constants import G0_MPS2
from descentflow.core.units import FL_M, KT_MPS
from descentflow.diagnosis.sides.two_sides import Compared, compare
from descentflow.effects import EFFECTS
from descentflow.effects.flight_state import log_rate
from descentflow.measurements.along_track import induced_by_turns
from descentflow.measurements.level_channels import LevelGrid
from descentflow.measurements.quantities import CHANNELS, Quantities, quantities_of
from descentflow.simulation.world import simulate
from descentflow.surveillance.prepare import prepare

TURN, BRAKES = EFFECTS["turn"], EFFECTS["speed_brake"]
LEVELS = torch.arange(100.0, 301.0, dtype=torch.float64)
FALL_MPS = 10.0


def steady_sides(n: int) -> Compared:
    """Flights of both sides without an effect, whose rates are alike in shape to 15 % of the example's noise."""
    sides = example_sides(n=n)
    rate = sides.of("rate")
    level = sides.y[:, rate].mean(1, keepdim=True)
    y = sides.y.clone()
    y[:, rate] = level + 0.15 * (y[:, rate] - level)
    return replace(sides, y=y)


def circling(bank_deg: float, tas_mps: float, **channels: Tensor) -> LevelGrid:
    """One flight that descends in a circle, from a heading of 350 degrees."""
    time = (LEVELS[-1] - LEVELS) * FL_M / FALL_MPS
    per_s = torch.rad2deg(G0_MPS2 * torch.tan(torch.deg2rad(torch.tensor(bank_deg))) / tas_mps)
    heading = (350 + per_s * time) % 360
    values = {"heading": heading, "TAS": torch.full_like(heading, tas_mps / KT_MPS), **channels}
    return LevelGrid(LEVELS, time[None], {k: v[None] for k, v in values.items()}, torch.zeros(1), ("one",))


@pytest.mark.parametrize("bank_deg", [0.0, 15.0, 30.0])
def test_the_bank_follows_from_the_change_of_heading(bank_deg: float) -> None:
    of_turns = induced_by_turns(circling(bank_deg, 220.0))
    assert of_turns is not None
    exact = torch.tan(torch.deg2rad(torch.tensor(bank_deg, dtype=torch.float64))) ** 2
    torch.testing.assert_close(of_turns, exact.expand_as(of_turns), rtol=1e-5, atol=1e-12)


def test_headings_that_are_rounded_and_noisy_are_no_turn() -> None:
    heading = 359.5 + torch.randn(len(LEVELS), generator=torch.Generator().manual_seed(3), dtype=torch.float64)
    of_turns = induced_by_turns(circling(0.0, 220.0, heading=heading % 360))
    assert of_turns is not None
    assert float(of_turns.mean()) < 0.002


def test_the_track_says_it_where_no_heading_does_and_a_misread_one_says_nothing() -> None:
    grid = circling(25.0, 200.0)
    track, speed = grid.values["heading"], grid.values["TAS"]
    none = torch.full_like(track, torch.nan)
    by_track = induced_by_turns(
        replace(grid, values={"heading": none, "TAS": speed, "track": track, "groundspeed": speed})
    )
    assert by_track is not None
    torch.testing.assert_close(by_track, induced_by_turns(grid))
    assert induced_by_turns(replace(grid, values={"heading": track})) is None
    misread = track.clone()
    misread[0, 100] += 180.0
    of_turns = induced_by_turns(replace(grid, values={"heading": misread, "TAS": speed}))
    assert of_turns is not None
    assert bool(of_turns[0, 98:103].isnan().all())
    assert bool(of_turns[0, :90].isfinite().all())


def flown(n: int, seed: int, causes: dict[str, Any] | None = None) -> Quantities:
    """Measurements of flights of the world."""
    frame = prepare(simulate("A320", n, seed, plant=causes or {}).rows).frame
    return quantities_of(frame, 150, 350, CHANNELS)


@pytest.fixture(scope="module")
def turning() -> Quantities:
    return flown(60, 1, {"turn": {"bank_deg": 30.0, "share": 0.8}})


def test_rates_are_compared_without_each_flights_own_turns(turning: Quantities) -> None:
    """Against the same flights that fly straight: their own turns are gone, the mean of them is not."""
    unknown = replace(turning, physics={k: v for k, v in turning.physics.items() if k != "turning"})
    others, kind = flown(60, 2), aircraft("A320")
    sides, without, before = (compare(others, one, kind) for one in (turning, flown(60, 1), unknown))

    def added(one: Any) -> Tensor:
        return one.y[one.real][:, one.columns("rate")] - without.y[without.real][:, without.columns("rate")]

    left, was = added(sides), added(before)
    torch.testing.assert_close(left.nanmean(0), was.nanmean(0), atol=0.003, rtol=0.0)
    own, own_before = (part - part.nanmean(0) for part in (left, was))
    # Edges of a turn stay, where reports of the rate are some seconds late.
    assert float(own.square().nanmean().sqrt()) < 0.5 * float(own_before.square().nanmean().sqrt())
    # What is left in the mean is what the headings say, by the energy equation.
    state = sides.state.rows(torch.nonzero(sides.real)[:, 0])
    assert state.turned_more is not None
    said = (log_rate(state, induced=1 + state.turned_more) - log_rate(state)).mean(0)
    bands = [sides.entries[i].band for i in sides.columns("rate").tolist()]
    torch.testing.assert_close(left.nanmean(0), said[bands], atol=0.006, rtol=0.0)


def test_a_checkpoint_of_before_turns_were_measured_is_taken_to_fly_straight(turning: Quantities) -> None:
    state = turning.to_state()
    assert torch.equal(Quantities.from_state(state).physics["turning"].isnan(), turning.physics["turning"].isnan())
    old = {**state, "version": 4, "physics": {k: v for k, v in state["physics"].items() if k != "turning"}}
    reference = Quantities.from_state(old)
    assert "turning" not in reference.physics
    sides = compare(reference, turning, aircraft("A320"))
    torch.testing.assert_close(sides.state.turned_more, turning.physics["turning"].nanmean(0).nan_to_num(0.0))
    with pytest.raises(KeyError, match="version 1"):
        Quantities.from_state({**state, "version": 1})


def test_headings_that_no_real_flight_reports_say_nothing_of_turns(turning: Quantities) -> None:
    """A checkpoint knows its flights' turns; against flights without headings brakes of own levels may be turns."""
    nothing = torch.full_like(turning.physics["turning"], torch.nan)
    real = replace(turning, physics={**turning.physics, "turning": nothing})
    assert compare(turning, real, aircraft("A320")).state.turned_more is None


def test_a_turn_is_as_large_as_headings_say() -> None:
    state = steady_sides(60).state
    measured = torch.full_like(state.altitude_m, 0.04)
    for more, sizes in ((measured, {0.04: True, 0.01: False, 0.1: False, -0.04: False}), (None, {0.04: False})):
        for size, plausible in sizes.items():
            assert TURN.plausible(replace(state, turned_more=more), torch.tensor([size]).double()) is plausible
    # Flights that turn no more than the simulator's have no course of it.
    still = replace(state, turned_more=0.0 * measured)
    assert float(TURN.shift(still, torch.tensor([0.04]).double())["rate"].abs().max()) == 0.0
    # Those of a corrected simulator have the mean of it at every level.
    added = replace(state, turned_more=None, affected=False)
    assert float(TURN.shift(added, torch.tensor([0.04]).double())["rate"].min()) > 0.005


def test_brakes_of_own_levels_that_a_bank_may_be_need_headings() -> None:
    state = steady_sides(60).state
    small, large = (torch.tensor([s, 200, 240, 0.8, 0, 20, 5, 0.02]).double() for s in (0.1, 0.4))
    alike = torch.tensor([0.1, 200, 240, 1.0, 0, 0, 0, 0]).double()
    known = replace(state, turned_more=torch.zeros_like(state.altitude_m))
    assert [BRAKES.may_be(state, theta) for theta in (small, large, alike)] == [("turn",), (), ()]
    assert [BRAKES.may_be(known, theta) for theta in (small, large, alike)] == [(), (), ()]
