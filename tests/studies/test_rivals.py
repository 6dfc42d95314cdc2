"""Scores of the rivals' answers, and meanings of their names; their libraries are not needed."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl
import pytest
import torch

from benchmarks.rivals_dowhy import flight_table
from benchmarks.rivals_mapping import EFFECTS_OF_NODE
from benchmarks.rivals_sbi import posterior_answer
from benchmarks.rivals_scoring import Answer, Scored, tally
from benchmarks.rivals_sets import read_set, set_folders
from descentflow.core.errors import DataError
from descentflow.simulation.world import simulate
from descentflow.surveillance.descents.prepared_descents import write_descents
from descentflow.surveillance.prepare import prepare
from studies.blind_diagnosis.blind_plan import Plan, SetPlan, SimulatorPlan
from studies.blind_diagnosis.known_sets import write_known_sets
from studies.blind_diagnosis.seal import KEY, OPENED, write_json

RATE = EFFECTS_OF_NODE["rate"]


def scored(kind: str, effects: set[str], *named: frozenset[str], **more: object) -> Scored:
    answer = Answer(named, **{"gap": bool(named), **more})
    return Scored("set", kind, frozenset(effects), answer, 2.0)


@pytest.mark.parametrize(
    ("one", "cause", "exact"),
    [
        (scored("null", set()), "right", None),
        (scored("null", set(), RATE), "wrong", None),
        (scored("null", set(), unknown=True), "wrong", None),
        (scored("single", {"mass"}, RATE), "right", True),
        (scored("single", {"mass"}, frozenset({"temperature"}), RATE), "wrong", False),
        (scored("single", {"mass"}, RATE, frozenset({"temperature"})), "right", False),
        (scored("single", {"mass"}), "none", False),
        (scored("single", {"mass"}, unknown=True), "none", False),
        (scored("double", {"mass", "temperature"}, RATE), "right", False),
        (scored("double", {"mass", "temperature"}, RATE, frozenset({"temperature"})), "right", True),
        (scored("outside", {"kept_thrust"}, unknown=True), "right", None),
        (scored("outside", {"kept_thrust"}, RATE, unknown=True), "wrong", None),
        (scored("outside", {"kept_thrust"}), "none", None),
        (scored("single", {"mass"}, gap=True, says_causes=False), None, None),
    ],
)
def test_an_answer_is_right_wrong_or_none(one: Scored, cause: str | None, exact: bool | None) -> None:
    assert (one.cause, one.exact) == (cause, exact)


def test_tally_counts_each_answer_once_and_says_what_is_left_open() -> None:
    some = [scored("single", {"mass"}, RATE), scored("single", {"mass"}, frozenset({"wind_gradient"}))]
    some += [scored("single", {"mass"}), scored("single", {"mass"}, gap=None)]
    found = tally(some)
    assert (found.n, found.right, found.wrong, found.none) == (4, 1, 1, 2)
    assert (found.gaps, found.says_gaps) == (2, 3)  # one did not say whether there is a gap
    assert (found.left_open, found.seconds) == (4.0, 2.0)  # seven effects of one name, one of the other


def test_npe_names_what_its_interval_says_is_not_zero() -> None:
    """Means of 4, 8 and 1 spreads; at 0.05 over three effects the interval is 2.4 spreads wide to either side."""
    draws = torch.randn(20_000, 3, generator=torch.Generator().manual_seed(1)) + torch.tensor([4.0, -8.0, 1.0])
    names, least = ["mass", "temperature", "wind_gradient"], torch.tensor([0.5, 0.5, 0.5])
    answer = posterior_answer(names, draws, least)
    assert answer.named == (frozenset({"temperature"}), frozenset({"mass"}))
    assert posterior_answer(["mass"], torch.rand(5000, 1), torch.tensor([0.5])).gap is False  # above zero, but small


def test_flight_table_sees_rate_wind_height_noise_and_lost_time() -> None:
    """3 s a level are 2,000 ft/min; 40 s more at one level are a level-off and no part of the rate."""
    levels = np.arange(300, 199, -1)
    time = 3.0 * np.arange(101.0) + 40.0 * (levels < 250)
    frame = pl.DataFrame(
        {
            "flight_id": "a",
            "level_fl": levels,
            "time_s": time,
            "IAS": 280.0,
            "Mach": 0.7,
            "TAS": 400.0,
            "groundspeed": 400.0 + 0.2 * levels,
            "geoaltitude": 104.0 * levels,
            "vertical_rate": np.where(np.arange(101) % 2 == 0, -2000.0, -2064.0),
        }
    )
    row = flight_table(frame).row(0, named=True)
    assert row["rate"] == pytest.approx(2000)
    assert row["stops"] == pytest.approx(40)
    assert row["wind"] == pytest.approx(2.0)  # kt a 1,000 ft
    assert row["height"] == pytest.approx(40.0)  # ft a 1,000 ft
    assert row["noise"] == pytest.approx(np.log(64 * np.sqrt(100 / 99)), abs=0.01)
    assert row["reported"] == pytest.approx(2000 + 64 * 50 / 101)
    assert "TAS" not in flight_table(frame.drop("TAS")).columns


def test_sets_of_an_open_study_are_written_as_rivals_read_them(tmp_path: Path) -> None:
    rows = simulate("A320", 12, 0).rows
    study, out = tmp_path / "study", tmp_path / "sets"
    (study / "sets").mkdir(parents=True)
    (study / "simulators").mkdir()
    rows.write_parquet(study / "sets" / "blind_0000.parquet")
    write_descents(prepare(study / "sets" / "blind_0000.parquet"), study / "simulators" / "right_flights.parquet")
    own = ("own", "A320")
    hidden = SetPlan("blind_0000", "blind", "single", {"mass": {"factor": 0.9}}, 1.0, "all", 12, "right", 0, *own)
    of_three = replace(hidden, name="blind_0001", kind="triple")
    simulator = SimulatorPlan("right", 1, *own, flights=12)
    write_json(study / KEY, Plan(0, "00", (hidden, of_three), (simulator,)).as_dict())
    with pytest.raises(DataError, match="is not open"):
        write_known_sets(study, out, 10)
    write_json(study / OPENED, {"opened_at": "2026-01-01T00:00:00Z", "diagnoses": 1})
    assert write_known_sets(study, out, 10, lambda line: None) == 1
    (folder,) = set_folders(out, None)
    one = read_set(folder)
    assert (one.name, one.kind, one.typecode, one.effects) == ("blind_0000", "single", "A320", {"mass"})
    assert one.real.equals(prepare(study / "sets" / "blind_0000.parquet").frame)
    assert one.simulator["flight_id"].n_unique() > 0
