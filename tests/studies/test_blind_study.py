"""A study from the key to the score: sealed, resumed, and refused where a seal is broken."""

import json
import runpy
from pathlib import Path
from typing import Any

import polars as pl
import pytest
from blind_toys import perfect_report
from refusals import refuses

from descentflow.core.errors import DataError
from descentflow.densities.checkpoint import load_model
from descentflow.surveillance.descents.prepared_descents import read_descents
from studies.blind_diagnosis import processes
from studies.blind_diagnosis.blind_flights import simulator_path, write_set, write_simulator
from studies.blind_diagnosis.blind_plan import FORMS, Plan, SetPlan, SimulatorPlan
from studies.blind_diagnosis.blind_run import OF_CLOSURE, _of_key, diagnose_all, generate, how_long
from studies.blind_diagnosis.closing import closing, fly_fresh
from studies.blind_diagnosis.drawn_causes import CATALOGUED
from studies.blind_diagnosis.outcome import outcomes
from studies.blind_diagnosis.seal import DIAGNOSES, KEY, MANIFEST, open_key, read_json, write_json
from studies.blind_diagnosis.study_score import score, table

SCRIPT = runpy.run_path(str(Path(__file__).resolve().parents[2] / "scripts" / "withheld_effects.py"))
WARM = {"temperature": {"deviation_k": 10.0, "spread_k": 2.0}}
BIASED = {"airspeed_bias": {"bias_kt": 2.0, "slope_kt_per_mach": 25.0}}
A320 = ("own", "A320")
PLAN = Plan(
    seed=0,
    nonce="00",
    sets=(
        SetPlan("blind_0000", "blind", "null", {}, 0.0, "all", 100, "simulator_000", 11, *A320),
        SetPlan("blind_0001", "blind", "single", WARM, 1.0, "all", 100, "simulator_000", 12, *A320, closure=True),
        SetPlan("blind_0002", "blind", "single", BIASED, 1.0, "basic", 100, "simulator_000", 13, *A320),
    ),
    simulators=(SimulatorPlan("simulator_000", 14, *A320, flights=140),),
)
JOBS = [f"{one.name}_{form}" for one in PLAN.sets for form in FORMS]
SETS = {one.name: one for one in PLAN.sets}


# torch's own forward-mode differentiation, when it is first used.
pytestmark = pytest.mark.filterwarnings("ignore:.torch.jit.script. is deprecated")


def quiet(_: str) -> None:
    """Say nothing."""


def knows(rows: Path, simulator: Path, without: str | None, out: Path | None = None) -> dict[str, Any]:
    """A diagnosis that knows the key."""
    assert rows.is_file()
    assert simulator.is_file()
    return perfect_report(SETS[rows.stem], without)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("study")
    generate(made, PLAN, progress=quiet)
    return made


def test_what_is_public_before_diagnosis_tells_nothing(folder: Path) -> None:
    manifest = read_json(folder / MANIFEST)
    assert [job["name"] for job in manifest["jobs"]] == JOBS
    text = json.dumps(manifest).replace('"without": null', "")
    assert not any(name in text for name in (*CATALOGUED, "null", "double", "outside"))
    files = sorted(path.name for path in (folder / "simulators").iterdir())
    assert files == sorted(simulator_path(folder, "simulator_000", form).name for form in FORMS)
    for one in PLAN.sets:
        rows = pl.read_parquet(folder / "sets" / f"{one.name}.parquet")
        assert rows["flight_id"].n_unique() == 100
        assert ("TAS" in rows.columns) == (one.channels == "all")
        assert ("groundspeed" in rows.columns) == (one.channels == "all")
        assert "latitude" not in rows.columns
    model = load_model(folder / "simulators" / "simulator_000.ckpt")
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

    assert diagnose_all(folder, diagnose=counted, parts=["blind_0002"], progress=quiet) == 15
    assert diagnose_all(folder, diagnose=counted, progress=quiet) == 15
    assert calls == ["blind_0002"] * 5 + ["blind_0000"] * 5 + ["blind_0001"] * 5
    assert how_long(folder).count("3 diagnosed, median") == 5
    monkeypatch.setattr("sys.argv", ["withheld_effects.py", "score", str(folder)])
    assert SCRIPT["main"]() == 0
    printed = capsys.readouterr().out
    assert "| false alarms | 0.0% (0% to 66%, n 2) | - | 0.0% (0% to 56%, n 3) |" in printed
    assert "closures: 2 of 2" in printed
    scored = read_json(folder / "score.json")
    refused = next(row for row in scored["rows"] if (row["goal"], row["column"]) == ("refused", "own"))
    assert refused["misses"] == ["blind_0002_checkpoint"]
    assert (folder / "score.md").read_text() == f"{table(scored)}\n"
    monkeypatch.setattr("sys.argv", ["withheld_effects.py", "score", str(folder), str(folder)])
    assert SCRIPT["main"]() == 1
    assert "one key twice" in capsys.readouterr().err
    monkeypatch.setattr("sys.argv", ["withheld_effects.py", "score", str(folder / "sets")])
    assert SCRIPT["main"]() == 1
    assert "run the study's earlier steps first" in capsys.readouterr().err


def test_broken_seals_are_refused(folder: Path) -> None:
    diagnose_all(folder, diagnose=knows, progress=quiet)
    file = folder / "diagnoses" / "blind_0001_bare.json"
    before = file.read_text()
    file.write_text(before.replace('"verdict"', '"Verdict"'))
    refuses(DataError, r"blind_0001_bare.* is not the diagnosis", open_key, folder)
    refuses(DataError, "not the diagnosis that was sealed", diagnose_all, folder, diagnose=knows, progress=quiet)
    file.write_text(before)
    key = (folder / KEY).read_text()
    (folder / KEY).write_text(key.replace("nonce", "once"))
    refuses(DataError, "not the key that was sealed", open_key, folder)
    (folder / KEY).write_text(key)
    assert open_key(folder)[0] == PLAN
    # Once it is open, nothing more is diagnosed.
    (folder / "diagnoses" / "blind_0000_bare.json").unlink()
    refuses(DataError, "was opened at", diagnose_all, folder, diagnose=knows, progress=quiet)
    (folder / DIAGNOSES).unlink()
    refuses(DataError, "earlier steps", open_key, folder)


def test_a_worker_left_over_from_another_study_writes_nothing_into_this_one(tmp_path: Path) -> None:
    """Two studies have sets of the same names: what one of them flew must not be taken for the other's."""
    write_json(tmp_path / MANIFEST, {"key_sha256": "b" * 64, "jobs": []})
    path = tmp_path / "blind_0000.parquet"
    with pytest.raises(DataError, match="a folder of its own"):
        _of_key(tmp_path, "a" * 64, None, lambda one, where: where.write_text(one), ("flights",), path)
    assert not path.exists()
    _of_key(tmp_path, "b" * 64, None, lambda one, where: where.write_text(one), ("flights",), path)
    assert path.read_text() == "flights"


@pytest.mark.slow
def test_the_package_finds_what_is_hidden(folder: Path, tmp_path: Path) -> None:
    """The study in little: nothing where nothing is, and each effect by its name, size and interval."""
    for name in ("sets", "simulators", MANIFEST, KEY):
        (tmp_path / name).symlink_to(folder / name)
    (tmp_path / "diagnoses").mkdir()
    assert diagnose_all(tmp_path, progress=quiet) == 15
    fates = outcomes(*open_key(tmp_path))
    assert [o.job for o in fates if not o.exact] == []
    intervals = {(row["column"], row["parameter"]): row for row in score(fates, {})["intervals"]}
    assert abs(intervals["own", "deviation_k"]["error"]) < 0.1
    assert abs(intervals["bare", "growth_kt"]["error"]) < 0.2
    for form in OF_CLOSURE:
        fresh = fly_fresh(PLAN.simulators[0], form, tmp_path)
        rows, report = tmp_path / "sets" / "blind_0001.parquet", tmp_path / "reports" / f"blind_0001_{form}"
        closed = closing(rows, fresh, report)
        assert closed is not None
        assert closed["reported"] == pytest.approx(closed["measured"], abs=0.3)  # of 100 flights a side


def test_foreign_sets_are_flown_and_trained_with_another_types_coefficients(tmp_path: Path) -> None:
    pytest.importorskip("jsbsim", reason="jsbsim (an extra of descentflow) is not installed")
    braked = {"speed_brake": {"share": 1.0, "spread_fl": 10.0}}
    foreign = ("foreign", "global5000")
    write_set(SetPlan("b", "blind", "single", braked, 1.0, "basic", 4, "s", 3, *foreign), tmp_path / "b.parquet")
    rows = pl.read_parquet(tmp_path / "b.parquet")
    assert rows["flight_id"].n_unique() == 4
    assert rows["typecode"].unique().to_list() == ["F2TH"]
    assert "TAS" not in rows.columns
    plan = SimulatorPlan("s", 4, *foreign, flights=4)
    write_simulator(plan, "one", simulator_path(tmp_path, "s", "one"))
    flown = read_descents(tmp_path / "s_one.parquet").frame
    assert flown["flight_id"].n_unique() == 4
    # Of one planned speed, but for the autopilot's own error and the entry into each phase.
    assert flown.filter(pl.col("level_fl") == 200)["IAS"].std() < 1.0


def test_more_work_than_processes_are_kept_for_is_all_done(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """All processes of a share end at the same time; the study of 980 files stood still after the first fifty."""
    monkeypatch.setattr(processes, "TASKS_PER_PROCESS", 2)
    files, counted = [tmp_path / str(k) for k in range(9)], []
    processes.spread([(Path.touch, file) for file in files], 2, counted.append)
    assert all(file.exists() for file in files)
    assert counted == list(range(1, 10))
