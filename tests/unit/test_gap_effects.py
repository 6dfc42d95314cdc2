"""Effects: their sizes against the textbook's, and their sensitivities against differences."""

from dataclasses import replace

import gap_toys
import pytest
import torch

from descentflow.effects import EFFECTS
from descentflow.effects.flight_state import log_rate
from descentflow.measurements.quantity_registry import QUANTITIES
from descentflow.physics.airspeed import cas_to_tas_mps


@pytest.mark.parametrize("name", EFFECTS)
def test_an_absent_effect_shifts_nothing(name: str) -> None:
    effect, state = EFFECTS[name], gap_toys.state()
    absent = effect.start()
    if name == "vertical_rate_lag":
        absent[1] = 0.0
    for quantity, shift in effect.shift(state, absent).items():
        assert quantity in QUANTITIES
        torch.testing.assert_close(shift, torch.zeros_like(shift), atol=1e-12, rtol=0)


@pytest.mark.parametrize(
    ("name", "value", "at_mach", "at_cas"),
    [
        # Relative change of the rate at constant Mach at FL330 and at constant CAS at FL150, by the energy balance.
        ("temperature", 10.0, -0.025, -0.020),
        ("wind_gradient", 2 * 0.514444 / 304.8, -0.080, -0.051),
        ("mass", -0.1, 0.058, 0.067),
        ("drag_polar", 0.1, 0.084, 0.096),
    ],
)
def test_sizes_are_those_of_the_energy_balance(name: str, value: float, at_mach: float, at_cas: float) -> None:
    state = gap_toys.state()
    rate = EFFECTS[name].shift(state, torch.tensor([value], dtype=torch.float64))["rate"][2].expm1()
    levels = (state.altitude_m / 30.48).round()
    high, low = rate[(levels - 330).abs().argmin()], rate[(levels - 150).abs().argmin()]
    # The notes' aircraft is another one: signs and sizes to a third.
    assert float(high) == pytest.approx(at_mach, rel=0.35)
    assert float(low) == pytest.approx(at_cas, rel=0.35)


def test_another_speed_changes_the_kinetic_energy_by_its_slope_too() -> None:
    """Of a change that is linear in altitude the slope is known; what is not known of it changes nothing."""
    state = gap_toys.state()
    slope_per_s = 4e-4
    change = (slope_per_s * (state.altitude_m - 8000.0) + 3.0).expand_as(state.cas_mps).clone()
    other = replace(state, cas_mps=state.cas_mps + change, cas_slope_per_s=state.cas_slope_per_s + slope_per_s)
    torch.testing.assert_close(log_rate(state, faster_mps=change), log_rate(other), rtol=1e-12, atol=1e-12)
    change[:, 4:] = torch.nan
    partly = log_rate(state, faster_mps=change)
    torch.testing.assert_close(partly[:, :4], log_rate(other)[:, :4], rtol=1e-12, atol=1e-12)
    torch.testing.assert_close(partly[:, 5:], log_rate(state)[:, 5:], rtol=0, atol=0)


def test_the_noise_of_a_flight_makes_no_steeper_path() -> None:
    """A held path is below the idle path, and the lowest of a flight's own noise is none."""
    path, state = EFFECTS["geometric_path"], gap_toys.state(200, affected=False)
    noise = 0.05 * torch.randn(state.cas_mps.shape, generator=torch.Generator().manual_seed(0), dtype=torch.float64)
    theta, uniform = torch.tensor([1.0, 0.1, 0.0]).double(), torch.full((200, 1), 0.5).double()
    flown = []
    for own in (torch.zeros_like(noise), noise):
        at = replace(state, beyond_polar=own)
        flown.append(own + path.own_change(at, theta, uniform).flown["rate"])
    # The mean noise of a flight of 11 bands is its own: 0.05 over the root of 11 and of 200 flights, four times.
    assert abs(float((flown[1] - flown[0]).mean())) < 4 * 0.05 / (11 * 200) ** 0.5


def test_a_held_path_is_below_the_lowest_of_an_idle_path_that_bends() -> None:
    """A bend that all flights of a simulator share is no noise of theirs."""
    path, state = EFFECTS["geometric_path"], gap_toys.state(20, affected=False)
    bend = torch.zeros_like(state.cas_mps)
    bend[:, -1] = -0.3
    at = replace(state, beyond_polar=bend)
    theta, uniform = torch.tensor([1.0, 0.1, 0.0]).double(), torch.full((20, 1), 0.5).double()
    ground = cas_to_tas_mps(state.cas_mps, state.altitude_m) + state.tailwind_mps
    idle = state.schedule_log_rate - ground.log() + bend
    flown = idle + path.own_change(at, theta, uniform).flown["rate"]
    torch.testing.assert_close(flown, (idle.amin(1, keepdim=True) - 0.1).expand_as(flown))
