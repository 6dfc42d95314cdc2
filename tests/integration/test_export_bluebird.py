"""Samples in bluebird-dt itself, in a whole simulation of it; needs its wheel, which holds pandas below 3."""

import copy
import importlib.util
import json
import re
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import descentflow as df
from descentflow.cli.entry import main
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
    """The exported predictor, or bluebird's own."""
    from bluebird_dt.predictor.linear_predictor import LinearPredictor

    if not sampled:
        return LinearPredictor(dt, 1.0, None)
    spec = importlib.util.spec_from_file_location("flown", folder / "flown.py")
    module = importlib.util.module_from_spec(spec)
    sys.modules["flown"] = module
    spec.loader.exec_module(module)
    return module.SampledDescents(dt, 1.0, None)


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
    """3 % of the mean and 15 % of the spread, three of their standard errors for 200 flights."""
    bluebird()
    sampled = simulated_seconds(predictor(written, sampled=True), N, monkeypatch, tmp_path)
    assert sampled.mean() == pytest.approx(own_seconds.mean(), rel=0.03)
    assert sampled.std() == pytest.approx(own_seconds.std(), rel=0.15)
    tabled = simulated_seconds(predictor(written, sampled=False), 5, monkeypatch, tmp_path)
    assert (np.abs(sampled[:5] - tabled) > 1).any(), "these are samples, not bluebird's table"
    again = simulated_seconds(predictor(written, sampled=True), 5, monkeypatch, tmp_path)
    np.testing.assert_array_equal(again, sampled[:5])


def flight(fl: float, to_fl: float, typecode: str = "A320", **said: float) -> Any:
    from bluebird_dt.core import Aircraft

    made = Aircraft(
        lat=51.0, lon=0.0, fl=fl, heading=90.0, flight_plan=None, callsign="A1", selected_fl=to_fl,
        aircraft_type=typecode, random_seed=3,
    )  # fmt: skip
    made.randomise_performance(3)
    made.on_route, made.selected_instructions.heading = False, 90.0
    for name, value in said.items():
        setattr(made.selected_instructions, name, value)
    return made


@pytest.mark.filterwarnings("ignore")
def test_what_a_controller_instructs_is_flown_as_ever(written: Path) -> None:
    """And at an instructed speed the rate is that of one of the samples whose speed there is nearest."""
    bluebird()
    samples = json.loads((written / "flown.json").read_text())["fleet"][0]["samples"]
    for said in ({"vertical_speed": 1000.0}, {"cas": 250.0}, {"mach": 0.7}, {"vertical_speed": 900.0, "cas": 280.0}):
        flown = []
        for one in (predictor(written, sampled=True), predictor(written, sampled=False)):
            made = flight(300.0, 150, **said)
            one.update_total_speeds(made)
            one.update_vertical_speeds(made)
            flown.append(made)
        if "vertical_speed" in said:
            assert flown[0].vertical_speed == flown[1].vertical_speed
        if "cas" in said or "mach" in said:
            assert flown[0].speed_tas == flown[1].speed_tas
        if said == {"cas": 250.0}:
            high = [one for one in samples if one["level_fl"][0] >= 300]
            near = sorted(high, key=lambda one: abs(one["CAS"][one["level_fl"].index(300)] - 250))
            rates = [one["vertical_rate"][one["level_fl"].index(300)] for one in near[: len(near) // 50 + 1]]
            assert min(np.abs(np.array(rates) - flown[0].vertical_speed)) < 1e-6


@pytest.mark.filterwarnings("ignore")
def test_the_example_of_the_page_flies_samples(a320: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    bluebird()
    page = (Path(__file__).resolve().parents[2] / "docs/how-to/export_bluebird.md").read_text()
    words = re.search(r"^descentflow (export best.ckpt .* --out sampled.py)", page, re.MULTILINE)
    code = re.search(r"```python\n(.*?)```", page, re.DOTALL)
    assert words, "the page's command"
    assert code, "and what it is followed by"
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    Path("best.ckpt").write_bytes(a320.read_bytes())
    assert main(words[1].split()) == 0
    names: dict[str, Any] = {}
    exec(code[1], names)
    one = names["simulator"].manager.environment.aircraft["AIR0"]
    _, number = one.predictor_params["descentflow_sample"]
    own = json.loads(Path("sampled.json").read_text())["fleet"][0]["samples"][number]
    expected = np.interp(-one.fl, -np.array(own["level_fl"]), own["vertical_rate"])
    assert one.vertical_speed == pytest.approx(expected, abs=30.0)
