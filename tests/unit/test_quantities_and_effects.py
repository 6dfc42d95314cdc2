"""Quantities measured for a diagnosis, and effects: sizes of the textbook, sensitivities against differences."""

from dataclasses import replace
from pathlib import Path

import gap_toys
import numpy as np
import polars as pl
import pytest
import torch

from descentflow.effects import EFFECTS
from descentflow.effects.flight_state import log_rate
from descentflow.measurements.level_channels import LevelGrid, short_scale_noise
from descentflow.measurements.quantities import Quantities, of_some_aircraft, quantities_of, reference_state
from descentflow.measurements.quantity_registry import QUANTITIES
from descentflow.physics.airspeed import cas_to_tas_mps
from descentflow.surveillance.cleaning._level_grid import to_levels
from descentflow.surveillance.cleaning.thresholds import Cleaning
from descentflow.surveillance.descents.prepared_descents import read_descents
from descentflow.surveillance.rows.drop_report import DropReport


def test_a_reference_takes_whole_aircraft(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    frame = read_descents(gap_toys.flights(tmp_path, 60, seed=5)).frame
    monkeypatch.setattr("descentflow.measurements.quantities.MAX_REFERENCE", 22)
    everyone = frame["flight_id"].unique().to_list()
    kept = of_some_aircraft(frame, everyone, 22)
    assert kept["flight_id"].n_unique() == 22
    per_aircraft = kept.group_by("icao24").agg(pl.col("flight_id").n_unique())["flight_id"].sort().to_list()
    # Five flights an aircraft: the last one drawn is cut short and no other.
    assert per_aircraft == [2, 5, 5, 5, 5]
    assert len(reference_state(frame, 150, 340, everyone)["cluster"]) == 22
    assert of_some_aircraft(frame, everyone, 60).equals(frame)
    assert set(of_some_aircraft(frame, everyone[:7], 60)["flight_id"]) == set(everyone[:7])


def test_the_change_over_a_band_is_that_between_its_edges() -> None:
    levels = torch.arange(150, 211, dtype=torch.float64)
    values = torch.where(levels < 171, 8.0, 10.0).double().expand(2, -1).clone()
    values[1, 13:18] = torch.nan
    grid = LevelGrid(levels, levels.expand(2, -1), {"vertical_rate": values}, torch.zeros(2), ("a", "b"))
    change = grid.bands(15.0).change(values)
    # Bands FL150-165, 165-180, ...: the step lies within the second one; the other flight shows one level at an edge.
    torch.testing.assert_close(change[0], torch.tensor([0.0, 2.0, 0.0, 0.0], dtype=torch.float64))
    assert change[1, :2].isnan().all()
    assert change[1, 2:].isfinite().all()


def test_noise_below_the_rounding_of_a_report_counts_as_that(tmp_path: Path) -> None:
    """A simulator that writes a constant rate has the most that rounding of a steady change to 32 ft/min makes."""
    frame = read_descents(gap_toys.flights(tmp_path, 20, seed=5)).frame.with_columns(vertical_rate=pl.lit(-1500.0))
    grid = LevelGrid.of_frame(frame, 150, 340, ["IAS", "vertical_rate"])
    noise = short_scale_noise(grid)["noise_rate"]
    assert noise[noise.isfinite()].exp().tolist() == pytest.approx([16.0] * int(noise.isfinite().sum()))
    assert int(noise.isfinite().sum()) > 10


def reported(mean_fpm: float, every_s: float, step_fpm: float = 0.0) -> LevelGrid:
    """Flights at about a rate that is larger by a step from FL260 down, all with the same noise of reports."""
    generator, parts = np.random.default_rng(0), []
    for flight in range(60):
        # Rows at other levels in each flight.
        rate_fpm = mean_fpm * generator.uniform(0.9, 1.1)
        time_s = np.arange(0.0, 60 * 21_000 / rate_fpm, every_s) + generator.uniform(0, every_s)
        exact_ft = 37_000 - rate_fpm / 60 * time_s
        below = (26_000 - exact_ft).clip(min=0.0)
        rate = rate_fpm + np.where(below > 0, step_fpm, 0.0)
        noise = {
            "vertical_rate": -(rate + 40 * generator.standard_normal(len(rate))) // 32 * 32,
            "IAS": np.round(280 - below / 400 + 0.8 * generator.standard_normal(len(rate))),
            "TAS": np.round((450 - below / 100) / 2) * 2,
        }
        rows = {"flight_id": f"f{flight:02d}", "icao24": f"a{flight:02d}", "typecode": "A320", "callsign": "", **noise}
        stamps = (time_s * 1e6).astype("int64")
        parts.append(pl.DataFrame({**rows, "altitude": np.round(exact_ft / 25) * 25, "timestamp": stamps}))
    frame = pl.concat(parts).with_columns(pl.from_epoch("timestamp", time_unit="us"))
    falling = frame.filter(pl.col("altitude").diff().over("flight_id").fill_null(-1.0) < 0)
    levels = to_levels(falling, Cleaning(slowest_fpm=0.0), DropReport())
    return LevelGrid.of_frame(levels, 150, 360, ["IAS", "vertical_rate", "TAS"])


@pytest.mark.parametrize("every_s", [1.0, 4.0, 8.0, 12.0])
def test_equal_noise_is_equal_however_fast_a_flight_descends(every_s: float) -> None:
    """To less than a tenth, from which noise is named; nor do steps of the flight count, as from Mach number to CAS."""
    slow, fast = (short_scale_noise(reported(fpm, every_s, 0.2 * fpm)) for fpm in (2000.0, 2800.0))
    for name in ("noise_rate", "noise_cas", "noise_tas"):
        assert float(fast[name].nanmean() - slow[name].nanmean()) == pytest.approx(0.0, abs=0.09), name
    assert float(slow["noise_rate"].nanmean().exp()) == pytest.approx(41.0, rel=0.25)
    assert float(slow["noise_cas"].nanmean().exp()) == pytest.approx(0.85, rel=0.15)


def test_the_least_noise_is_the_same_in_a_checkpoint(tmp_path: Path) -> None:
    """A rounding of 1e-8 would tell the sides apart where neither has noise."""
    frame = read_descents(gap_toys.flights(tmp_path, 60, seed=5)).frame.with_columns(
        TAS=pl.lit(400.0), IAS=pl.lit(250.0)
    )
    values = quantities_of(frame, 150, 340, ["IAS", "TAS", "vertical_rate"]).values
    state = reference_state(frame, 150, 340, frame["flight_id"].unique().to_list())
    kept = Quantities.from_state(state).values
    for name in ("noise_cas", "noise_tas", "noise_rate"):
        torch.testing.assert_close(kept[name], values[name], rtol=0.0, atol=0.0, equal_nan=True)


def test_a_reference_that_measured_noise_otherwise_is_compared_without_it(tmp_path: Path) -> None:
    frame = read_descents(gap_toys.flights(tmp_path, 60, seed=5)).frame
    state = reference_state(frame, 150, 340, frame["flight_id"].unique().to_list())
    old = Quantities.from_state({**state, "version": 3}).values
    new = Quantities.from_state(state).values
    assert set(new) - set(old) == {name for name in new if name.startswith("noise_")} != set()


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
