"""Samples in bluebird-dt itself, in a whole simulation of it; needs its wheel, which holds pandas below 3."""

import copy
import importlib.util
import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import descentflow as df
from descentflow.exports.export import export

N = 200
TOP_FL, LOW_FL = 340.0, 150.0
STEP_S = 6.0


def bluebird() -> Any:
    return pytest.importorskip(
        "bluebird_dt",
        reason="bluebird-dt (AGPL-3.0, no extra of ours) needs pandas below 3: install it in an environment of its own",
        exc_type=ImportError,
    )


@pytest.fixture(scope="module")
def written(a320: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("bluebird")
    export(a320, "bluebird", folder / "flown.py", n=2000)
    export(a320, "bluebird", folder / "a320.json", n=2000)
    return folder


@pytest.fixture(scope="module")
def own_seconds(a320: Path) -> np.ndarray:
    """From FL340 to FL150 of samples that come from there or above."""
    flown = df.sample(a320, 2000).trajectories
    levels = flown.levels_fl.tolist()
    top, low = levels.index(TOP_FL), levels.index(LOW_FL)
    high = flown.entry >= top
    return (flown.time_s[high, low] - flown.time_s[high, top]).numpy()


def predictor(folder: Path, *, sampled: bool, dt: float = 3.0) -> Any:
    """The exported predictor, or bluebird's own with the exported tables."""
    from bluebird_dt.predictor.linear_predictor import LinearPredictor

    paths = {
        "aircraft_mapping_path": str(folder / "a320_mapping.json"),
        "performance_profile_data_path": str(folder / "a320_profile.json"),
        "performance_uncertainty_data_path": str(folder / "a320_uncertainty.json"),
    }
    if not sampled:
        return LinearPredictor(dt, 1.0, None, **paths)
    spec = importlib.util.spec_from_file_location("flown", folder / "flown.py")
    module = importlib.util.module_from_spec(spec)
    sys.modules["flown"] = module
    spec.loader.exec_module(module)
    return module.SampledDescents(dt, 1.0, None, **paths)


def simulated_seconds(own: Any, n: int, monkeypatch: pytest.MonkeyPatch, folder: Path) -> np.ndarray:
    """A whole simulation of theirs, with n A320 in place of its two aircraft, cleared from FL340 to FL140."""
    from bluebird_dt.simulator.simulator import Simulator

    monkeypatch.chdir(folder)
    simulator = Simulator.from_category(
        "Two Aircraft", "I-Sector", predictor=own, save_log_to_file=False, save_csv=False, autosave_interval=None
    )
    fleet = simulator.manager.environment.aircraft
    pattern = next(iter(fleet.values()))
    fleet.clear()
    for number in range(n):
        one = copy.deepcopy(pattern)
        one.callsign, one.aircraft_type = f"DF{number:04d}", "A320"
        one.fl = one.selected_fl = one.cleared_instructions.fl = one.selected_instructions.fl = TOP_FL
        one.on_route, one.selected_instructions.heading = False, 90.0
        for name in ("vertical_speed", "cas", "mach"):
            setattr(one.selected_instructions, name, None)
        one.randomise_performance(number)
        fleet[one.callsign] = one
    for one in fleet.values():
        one.selected_fl = one.selected_instructions.fl = one.cleared_instructions.fl = 140.0
    passed: dict[str, float] = {}
    before = dict.fromkeys(fleet, TOP_FL)
    for step in range(400):
        assert simulator.evolve(STEP_S)
        for name, one in simulator.manager.environment.aircraft.items():
            if before[name] > LOW_FL >= one.fl:
                share = (before[name] - LOW_FL) / (before[name] - one.fl)
                passed[name] = STEP_S * (step + share)
            before[name] = one.fl
        if len(passed) == n:
            break
    assert len(passed) == n
    return np.array([passed[name] for name in sorted(passed)])


@pytest.mark.filterwarnings("ignore")
def test_the_predictor_flies_samples_in_a_whole_simulation(
    written: Path, own_seconds: np.ndarray, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """2 % of the mean and 10 % of the spread; by chance 200 flights are off by 0.9 % and 5 % (one sigma)."""
    bluebird()
    found = simulated_seconds(predictor(written, sampled=True), N, monkeypatch, tmp_path)
    assert found.mean() == pytest.approx(own_seconds.mean(), rel=0.02)
    assert found.std() == pytest.approx(own_seconds.std(), rel=0.10)
    tabled = simulated_seconds(predictor(written, sampled=False), 5, monkeypatch, tmp_path)
    assert (np.abs(found[:5] - tabled) > 1).any(), "these are samples, not tables"
    again = simulated_seconds(predictor(written, sampled=True), 5, monkeypatch, tmp_path)
    np.testing.assert_array_equal(again, found[:5])


@pytest.mark.filterwarnings("ignore")
def test_the_tables_give_times_like_the_samples(
    written: Path, own_seconds: np.ndarray, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bluebird()
    found = simulated_seconds(predictor(written, sampled=False), N, monkeypatch, tmp_path)
    assert found.mean() == pytest.approx(own_seconds.mean(), rel=0.03)
    assert found.std() == pytest.approx(own_seconds.std(), rel=0.15)


@pytest.mark.filterwarnings("ignore")
def test_what_a_controller_commands_is_flown_as_ever(written: Path) -> None:
    bluebird()
    from bluebird_dt.core import Aircraft

    own, stock = predictor(written, sampled=True), predictor(written, sampled=False)
    for said in ({"vertical_speed": 1000.0}, {"cas": 250.0}):
        rates = []
        for one in (own, stock):
            flight = Aircraft(
                lat=51.0, lon=0.0, fl=300.0, heading=90.0, flight_plan=None, callsign="A1", selected_fl=150,
                aircraft_type="A320", random_seed=3,
            )  # fmt: skip
            for name, value in said.items():
                setattr(flight.selected_instructions, name, value)
            one.update_total_speeds(flight)
            one.update_vertical_speeds(flight)
            rates.append((flight.vertical_speed, flight.speed_tas))
        assert rates[0] == rates[1]


def test_tables_have_the_form_that_bluebird_reads(a320: Path, tmp_path: Path) -> None:
    written = export(a320, "bluebird", tmp_path / "a320.json", n=500, fly_as="A319,A320")
    profile, spread, mapping = (json.loads(path.read_text()) for path in written)
    own = profile["aircraft"]["A320"]
    assert (np.diff(own["flight_level"]) > 0).all()
    assert all(len(own[name]) == len(own["flight_level"]) for name in own)
    assert min(own["rocd_des"]) > 500
    for about in spread["aircraft"]["A320"].values():
        assert about["minimum"] < about["norm_mean"] < about["maximum"]
    assert mapping == {"DEFAULT": "A320", "A319": "A320", "A320": "A320"}
