"""A study from the key to the page: sealed, resumed, and refused where a seal is broken."""

import json
import runpy
from pathlib import Path
from typing import Any

import polars as pl
import pytest
from blind_toys import perfect_report

from descentflow.core.errors import DataError
from descentflow.densities.checkpoint import load_model
from descentflow.simulation.causes import CATALOGUED
from descentflow.surveillance.descents.prepared_descents import read_descents
from studies.blind_diagnosis.blind_flights import write_set, write_simulator
from studies.blind_diagnosis.blind_plan import Plan, SetPlan, SimulatorPlan
from studies.blind_diagnosis.blind_run import _of_key, diagnose_all, generate, how_long
from studies.blind_diagnosis.blind_score import score
from studies.blind_diagnosis.closing import MIN_CELLS, closing
from studies.blind_diagnosis.seal import DIAGNOSES, KEY, MANIFEST, open_key, read_json, write_json

SCRIPT = runpy.run_path(str(Path(__file__).resolve().parents[2] / "scripts" / "withheld_effects.py"))
NAMES = tuple(cause.name for cause in CATALOGUED)
WARM = {"temperature": {"deviation_k": 10.0, "spread_k": 2.0}}
BIASED = {"airspeed_bias": {"bias_kt": 2.0, "slope_kt_per_mach": 25.0}}
PLAN = Plan(
    seed=0,
    nonce="00",
    sets=(
        SetPlan("blind_0000", "blind", "null", {}, 0.0, "all", 100, "simulator_000", 11),
        SetPlan(
            "blind_0001",
            "blind",
            "single",
            WARM,
            1.0,
            "all",
            100,
            "simulator_000",
            12,
            corrected=True,
            true="true_0001",
        ),
        SetPlan("blind_0002", "blind", "single", BIASED, 1.0, "basic", 100, "simulator_000", 13),
    ),
    simulators=(
        SimulatorPlan("simulator_000", 14, flights=140),
        SimulatorPlan("true_0001", 14, causes=WARM, flights=140, trained=False),
    ),
)
JOBS = [f"{one.name}{by}" for one in PLAN.sets for by in ("", "_flights")]
SETS = {one.name: one for one in PLAN.sets}


# torch's own forward-mode differentiation, when it is first used.
pytestmark = pytest.mark.filterwarnings("ignore:.torch.jit.script. is deprecated")


def quiet(_: str) -> None:
    """Say nothing."""


def knows(rows: Path, simulator: Path, without: str | None, out: Path | None = None) -> dict[str, Any]:
    """A diagnosis that knows the key."""
    assert rows.is_file()
    assert simulator.is_file()
    return perfect_report(SETS[rows.stem], NAMES, without)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("study")
    generate(made, PLAN, progress=quiet)
    return made


def test_what_is_public_before_diagnosis_tells_nothing(folder: Path) -> None:
    manifest = read_json(folder / MANIFEST)
    assert [job["name"] for job in manifest["jobs"]] == JOBS
    assert [job["by"] for job in manifest["jobs"]] == ["checkpoint", "flights"] * 3
    text = json.dumps(manifest).replace('"without": null', "")
    assert not any(name in text for name in (*NAMES, "null", "double", "outside", "polar", "true_"))
    # What a true correction would be is flown when the key is open: its name says whose it is.
    assert sorted(path.name for path in (folder / "simulators").iterdir()) == [
        "simulator_000.ckpt",
        "simulator_000.parquet",
    ]
    for one in PLAN.sets:
        rows = pl.read_parquet(folder / "sets" / f"{one.name}.parquet")
        assert rows["flight_id"].n_unique() == 100
        assert ("TAS" in rows.columns) == (one.channels == "all")
        assert ("groundspeed" in rows.columns) == (one.channels == "all")
        assert "latitude" not in rows.columns
    model = load_model(folder / "simulators" / f"{PLAN.simulators[0].name}.ckpt")
    assert len(model.representation.split.train) == 140  # a simulator is the final fit


def test_it_is_resumed_sealed_and_scored(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert diagnose_all(folder, diagnose=knows, until=0.0, progress=quiet) == 0
    calls = []

    def counted(rows: Path, simulator: Path, without: str | None, out: Path | None) -> dict[str, Any]:
        calls.append(rows.stem)
        if len(calls) == 1:
            raise DataError("nothing in common", expected="common levels", mend="use another simulator")
        return knows(rows, simulator, without, out)

    assert diagnose_all(folder, diagnose=counted, parts=["blind_0002"], progress=quiet) == 6
    assert diagnose_all(folder, diagnose=counted, progress=quiet) == 6
    assert calls == ["blind_0002"] * 2 + ["blind_0000"] * 2 + ["blind_0001"] * 2
    assert how_long(folder).count("3 diagnosed, median") == 2
    monkeypatch.setattr("sys.argv", ["withheld_effects.py", "score", str(folder)])
    assert SCRIPT["main"]() == 0
    said = capsys.readouterr().out
    assert "own: false alarms, at most 5 %: 0 (0.00 to 0.79) (1 sets) met" in said
    assert "true corrections: 1 of 1" in said
    scored = read_json(folder / "score.json")
    assert [refused["job"] for refused in scored["refused"]] == ["blind_0002"]
    assert scored["diagnosed"] == 6
    assert [row["set"] for row in scored["same_verdicts"]["differing"]] == ["blind_0002"]
    assert (folder / "score.html").stat().st_size > 100_000
    monkeypatch.setattr("sys.argv", ["withheld_effects.py", "score", str(folder / "sets")])
    assert SCRIPT["main"]() == 1
    assert "run the study's earlier steps first" in capsys.readouterr().err


def test_broken_seals_are_refused(folder: Path) -> None:
    diagnose_all(folder, diagnose=knows, progress=quiet)
    file = folder / "diagnoses" / "blind_0001.json"
    before = file.read_text()
    file.write_text(before.replace('"verdict"', '"Verdict"'))
    with pytest.raises(DataError, match=r"blind_0001.* is not the diagnosis"):
        open_key(folder)
    with pytest.raises(DataError, match="not the diagnosis that was sealed"):
        diagnose_all(folder, diagnose=knows, progress=quiet)
    file.write_text(before)
    key = (folder / KEY).read_text()
    (folder / KEY).write_text(key.replace("nonce", "once"))
    with pytest.raises(DataError, match="not the key that was sealed"):
        open_key(folder)
    (folder / KEY).write_text(key)
    assert open_key(folder)[0] == PLAN
    # Once it is open, nothing more is diagnosed.
    (folder / "diagnoses" / "blind_0000.json").unlink()
    with pytest.raises(DataError, match="was opened at"):
        diagnose_all(folder, diagnose=knows, progress=quiet)
    (folder / DIAGNOSES).unlink()
    with pytest.raises(DataError, match="earlier steps"):
        open_key(folder)


def test_a_worker_left_over_from_another_study_writes_nothing_into_this_one(tmp_path: Path) -> None:
    """Two studies have sets of the same names: what one of them flew must not be taken for the other's."""
    write_json(tmp_path / MANIFEST, {"key_sha256": "b" * 64, "jobs": []})
    path = tmp_path / "blind_0000.parquet"
    with pytest.raises(DataError, match="a folder of its own"):
        _of_key(tmp_path, "a" * 64, lambda one, where: where.write_text(one), "flights", path)
    assert not path.exists()
    _of_key(tmp_path, "b" * 64, lambda one, where: where.write_text(one), "flights", path)
    assert path.read_text() == "flights"


@pytest.mark.slow
def test_the_package_finds_what_is_hidden(folder: Path, tmp_path: Path) -> None:
    """The study in little: nothing where nothing is, and each effect by its name, size and interval."""
    for name in ("sets", "simulators", MANIFEST, KEY):
        (tmp_path / name).symlink_to(folder / name)
    (tmp_path / "diagnoses").mkdir()
    assert diagnose_all(tmp_path, progress=quiet) == 6
    scored = score(*open_key(tmp_path))
    assert scored["refused"] == []
    own = scored["worlds"]["own"]
    assert own["false_alarms"]["share"] == 0
    assert [row["first"]["share"] for row in own["by_cause"]] == [1, 1]
    assert scored["same_verdicts"]["differing"] == []
    by_name = {(s["cause"], s["parameter"]): s["estimate"] for s in own["sizes"]["estimates"]}
    assert by_name["temperature", "deviation_k"] == pytest.approx(10, abs=1)
    assert by_name["airspeed_bias", "growth_kt"] == pytest.approx(2.5, abs=0.5)


def test_what_a_correction_closes_is_told_beside_the_true_effect(folder: Path, tmp_path: Path) -> None:
    """All of it for the true effect itself, nothing for the simulator as it was."""
    slow = {"speed_schedule": {"cas_kt": -20.0, "mach": -0.02}}
    rows, true = tmp_path / "rows.parquet", tmp_path / "true.ckpt"
    write_set(SetPlan("slow", "blind", "single", slow, 1.0, "all", 100, "simulator_000", 15), rows)
    write_simulator(SimulatorPlan("true", 14, causes=slow, flights=140, trained=False), true)
    assert not true.exists()
    held, true = folder / "simulators" / "simulator_000.parquet", true.with_suffix(".parquet")
    whole, none = (closing(rows, held, corrected, true, "A320") for corrected in (true, held))
    assert whole["cells"] >= MIN_CELLS
    assert whole["of_true"] == pytest.approx(1)
    assert none["of_true"] == pytest.approx(0)
    # Twenty knots are several spreads between flights of one operator, and are all but gone.
    assert whole["after"] < 0.5 * whole["before"]


def test_foreign_sets_are_flown_and_trained_with_another_types_coefficients(tmp_path: Path) -> None:
    pytest.importorskip("jsbsim", reason="jsbsim (an extra of descentflow) is not installed")
    braked = {"speed_brake": {"share": 1.0, "spread_fl": 10.0}}
    foreign = {"world": "foreign", "model": "global5000"}
    write_set(SetPlan("b", "blind", "single", braked, 1.0, "basic", 4, "s", 3, **foreign), tmp_path / "b.parquet")
    rows = pl.read_parquet(tmp_path / "b.parquet")
    assert rows["flight_id"].n_unique() == 4
    assert rows["typecode"].unique().to_list() == ["F2TH"]
    assert "TAS" not in rows.columns
    write_simulator(SimulatorPlan("s", 4, flights=4, trained=False, **foreign), tmp_path / "s.ckpt")
    assert read_descents(tmp_path / "s.parquet").frame["flight_id"].n_unique() == 4
