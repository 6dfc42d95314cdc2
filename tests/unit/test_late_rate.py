"""Delay of reported rates, from their excess over altitude over time."""

from dataclasses import replace
from pathlib import Path

import pytest
import torch

from descentflow.diagnosis.diagnose import diagnose
from descentflow.effects import EFFECTS
from descentflow.effects._example_flights import example_flights
from descentflow.simulation.world import simulate
from descentflow.surveillance.descents.prepared_descents import write_descents
from descentflow.surveillance.prepare import prepare

LATE = EFFECTS["vertical_rate_lag"]
STEP_S, BAND_S = 0.01, 45.0


def test_a_lag_is_exact_for_any_course_of_the_rate() -> None:
    time = torch.arange(0.0, BAND_S, STEP_S, dtype=torch.float64)
    flown = 10.0 + 2.0 * torch.sin(time / 7.0) + 1.5 * (time > 20.0)
    lag_s, reported = 8.0, torch.empty_like(flown)
    reported[0] = 9.0
    keep = torch.tensor(-STEP_S / lag_s).exp()
    for k in range(1, len(time)):
        reported[k] = keep * reported[k - 1] + (1 - keep) * flown[k]
    # Downwards in time is downwards in altitude: the change is that from the band's lower to its upper edge.
    change = (reported[0] - reported[-1]) / (reported.mean() * BAND_S)
    state = example_flights(1)
    found = LATE.shift(
        replace(state, rate_change_per_s=torch.full_like(state.cas_mps, float(change))), torch.tensor([lag_s, 0.0])
    )
    # The sum over steps of 10 ms is the integral to 1e-3 of the 5 % that the report exceeds by.
    torch.testing.assert_close(found["lag"][0, 0].exp(), reported.mean() / flown.mean(), rtol=1e-4, atol=0)


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
