"""Reports that are late: an effect's edges, and the delay by their excess over altitude over time."""

from dataclasses import replace
from pathlib import Path

import pytest
import torch

from descentflow.core.units import FL_M, FPM_MPS
from descentflow.diagnosis.diagnose import diagnose
from descentflow.diagnosis.sides.compared_state import report_delay_s
from descentflow.effects import EFFECTS
from descentflow.effects._example_flights import example_flights
from descentflow.measurements.level_channels import LevelGrid
from descentflow.simulation.world import simulate
from descentflow.surveillance.descents.prepared_descents import write_descents
from descentflow.surveillance.prepare import prepare

BRAKES = EFFECTS["speed_brake"]
RATE_MPS, CHANGE, DELAY_S, STEP_S = 10.0, 0.3, 6.0, 0.05
LOW_FL, HIGH_FL = 205.0, 262.0


def flown() -> LevelGrid:
    """A flight at 10 m/s, and faster by 0.3 in the logarithm between two levels, reported through a first-order lag."""
    levels = torch.arange(150.0, 371.0, dtype=torch.float64)
    altitude, report, time = 372 * FL_M, RATE_MPS, 0.0
    rows, below = {}, len(levels) - 1
    while below >= 0:
        rate = RATE_MPS * (2.718281828459045**CHANGE if LOW_FL * FL_M < altitude < HIGH_FL * FL_M else 1.0)
        report += (rate - report) * STEP_S / DELAY_S
        altitude, time = altitude - rate * STEP_S, time + STEP_S
        if altitude <= float(levels[below]) * FL_M:
            rows[below] = (time - (float(levels[below]) * FL_M - altitude) / rate, report)
            below -= 1
    table = torch.tensor([rows[k] for k in range(len(levels))], dtype=torch.float64)
    return LevelGrid(levels, table[None, :, 0], {"vertical_rate": -table[None, :, 1] / FPM_MPS}, torch.zeros(1), ("a",))


def test_edges_of_a_window_show_as_the_smoothed_reports_do() -> None:
    bands = flown().bands(20.0)
    reported, crossed = bands.rates_mps(-bands.grid.values["vertical_rate"] * FPM_MPS)
    state = example_flights()
    # The example's bands are those of the flight; its own rate is put in the place of what the polar says.
    assert torch.allclose(state.altitude_m, bands.altitude_m)
    late = replace(state, report_delay_s=DELAY_S)
    late.__dict__["schedule_log_rate"] = torch.full_like(state.cas_mps, RATE_MPS).log()
    inset = BRAKES.inset_fl / 2
    ends = torch.tensor([LOW_FL - inset, HIGH_FL + inset], dtype=torch.float64)
    within = BRAKES.within(late, *ends)
    # Logarithms of means are off means of logarithms by at most p (1 - p) 0.3^2 / 2; reports settle in a few seconds.
    torch.testing.assert_close(CHANGE * within["lag"], (reported / crossed).log()[0], atol=0.012, rtol=0)
    torch.testing.assert_close(CHANGE * within["rate"], (reported[0] / RATE_MPS).log(), atol=0.02, rtol=0)
    # Without the delay the lag would have to be explained by something else, at several times that.
    assert float((reported / crossed).log().abs().max()) > 0.03
    assert "lag" not in BRAKES.within(state, *ends)


@pytest.mark.parametrize("delay_s", [0.0, 1.6, 4.0])
def test_the_delay_of_reports_is_measured_from_flights(delay_s: float) -> None:
    state = example_flights(50)
    generator = torch.Generator().manual_seed(0)
    change = 2e-3 * torch.randn(state.cas_mps.shape, generator=generator, dtype=torch.float64)
    change[:, -1] = torch.nan
    lag = delay_s * change + 0.002 * torch.randn(change.shape, generator=generator, dtype=torch.float64)
    found = report_delay_s(replace(state, rate_change_per_s=change), lag)
    # 500 values, each with an error of 1 s: four standard errors.
    assert found == pytest.approx(delay_s, abs=4 * 0.002 / (2e-3 * 500**0.5))


def test_no_delay_where_no_rate_was_reported() -> None:
    state = replace(example_flights(), rate_change_per_s=None)
    assert report_delay_s(state, torch.zeros_like(state.cas_mps)) == 0.0


LATE = EFFECTS["vertical_rate_lag"]
SAMPLED_S, BAND_S = 0.01, 45.0


def test_a_lag_is_exact_for_any_course_of_the_rate() -> None:
    time = torch.arange(0.0, BAND_S, SAMPLED_S, dtype=torch.float64)
    flown = 10.0 + 2.0 * torch.sin(time / 7.0) + 1.5 * (time > 20.0)
    lag_s, reported = 8.0, torch.empty_like(flown)
    reported[0] = 9.0
    keep = torch.tensor(-SAMPLED_S / lag_s).exp()
    for k in range(1, len(time)):
        reported[k] = keep * reported[k - 1] + (1 - keep) * flown[k]
    # Downwards in time is downwards in altitude: the change is that from the band's lower to its upper edge.
    change = (reported[0] - reported[-1]) / (reported.mean() * BAND_S)
    state = example_flights(1)
    shift = LATE.shift(
        replace(state, rate_change_per_s=torch.full_like(state.cas_mps, float(change))), torch.tensor([lag_s, 0.0])
    )
    # The sum over steps of 10 ms is the integral to 1e-3 of the 5 % that the report exceeds by.
    torch.testing.assert_close(shift["lag"][0, 0].exp(), reported.mean() / flown.mean(), rtol=1e-4, atol=0)


def test_the_rate_itself_is_held_against_no_change_of_its_own() -> None:
    state = example_flights(2)
    change = torch.zeros_like(state.cas_mps)
    change[0] = 0.004
    shift = LATE.shift(
        replace(state, rate_change_per_s=change, usual_rate_change_per_s=change.mean(0)), torch.tensor([8.0, 0.0])
    )
    assert not torch.equal(shift["lag"][0], shift["lag"][1])
    assert torch.equal(shift["rate"][0], shift["rate"][1])


@pytest.mark.slow
def test_a_late_rate_is_sized_as_it_was_planted(tmp_path: Path) -> None:
    for name, seed, plant in (("real", 100, {"vertical_rate_lag": {"lag_s": 12.0}}), ("simulator", 900, {})):
        simulate("B738", 250, seed, plant=plant).rows.write_parquet(tmp_path / "rows.parquet")
        write_descents(prepare(tmp_path / "rows.parquet"), tmp_path / f"{name}.parquet")
    report = diagnose(
        tmp_path / "real.parquet", tmp_path / "simulator.parquet", catalogue={"vertical_rate_lag": LATE}, seed=0
    )
    # A standard error of 0.26 s; held against the changes of its own rate it was 10.3 s.
    assert report.causes[0].parameters["lag_s"].estimate == pytest.approx(12.0, abs=1.0)
