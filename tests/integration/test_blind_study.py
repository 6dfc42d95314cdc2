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
from descentflow.studies.blind_diagnosis.blind_plan import Plan, SetPlan, SimulatorPlan
from descentflow.studies.blind_diagnosis.blind_run import diagnose_all, generate, package_diagnosis
from descentflow.studies.blind_diagnosis.blind_score import score
from descentflow.studies.blind_diagnosis.closing import MIN_CELLS, closing
from descentflow.studies.blind_diagnosis.seal import DIAGNOSES, KEY, MANIFEST, open_key, read_json

SCRIPT = runpy.run_path(str(Path(__file__).resolve().parents[2] / "scripts" / "withheld_effects.py"))
NAMES = tuple(cause.name for cause in CATALOGUED)
WARM = {"temperature": {"deviation_k": 10.0, "spread_k": 2.0}}
BIASED = {"airspeed_bias": {"bias_kt": 2.0, "slope_kt_per_mach": 25.0}}
PLAN = Plan(
    seed=0,
    nonce="00",
    sets=(
        SetPlan("blind_0000", "blind", "null", {}, 0.0, "all", 100, "simulator_000", 11),
        SetPlan("blind_0001", "blind", "single", WARM, 1.0, "all", 100, "simulator_000", 12),
        SetPlan("blind_0002", "blind", "single", BIASED, 1.0, "basic", 100, "simulator_000", 13),
    ),
    simulators=(SimulatorPlan("simulator_000", 14, 1.0, {}),),
)
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
    generate(made, PLAN, reference_flights=140, progress=quiet)
    return made


def test_what_is_public_before_diagnosis_tells_nothing(folder: Path) -> None:
    manifest = read_json(folder / MANIFEST)
    assert [job["name"] for job in manifest["jobs"]] == [one.name for one in PLAN.sets]
    text = json.dumps(manifest).replace('"without": null', "")
    assert not any(name in text for name in (*NAMES, "null", "double", "outside", "polar"))
    for one in PLAN.sets:
        rows = pl.read_parquet(folder / "sets" / f"{one.name}.parquet")
        assert rows["flight_id"].n_unique() == 100
        assert ("TAS" in rows.columns) == (one.channels == "all")
        assert ("groundspeed" in rows.columns) == (one.channels == "all")
        assert "latitude" not in rows.columns
    model = load_model(folder / "simulators" / f"{PLAN.simulators[0].name}.ckpt")
    assert len(model.representation.split.train) == pytest.approx(0.72 * 140, abs=2)


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

    assert diagnose_all(folder, diagnose=counted, parts=["blind_0002"], progress=quiet) == 3
    assert diagnose_all(folder, diagnose=counted, progress=quiet) == 3
    assert calls == ["blind_0002", "blind_0000", "blind_0001"]
    monkeypatch.setattr("sys.argv", ["withheld_effects.py", "score", str(folder)])
    assert SCRIPT["main"]() == 0
    assert "false alarms at most 5 %: 0 (1 sets) met" in capsys.readouterr().out
    scored = read_json(folder / "score.json")
    assert [refused["job"] for refused in scored["refused"]] == ["blind_0002"]
    assert scored["diagnosed"] == 3
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
    (folder / DIAGNOSES).unlink()
    with pytest.raises(DataError, match="earlier steps"):
        open_key(folder)


def test_the_package_finds_what_is_hidden(folder: Path, tmp_path: Path) -> None:
    """The study in little: nothing where nothing is, and each effect by its name, size and interval."""
    for name in ("sets", "simulators", MANIFEST, KEY):
        (tmp_path / name).symlink_to(folder / name)
    (tmp_path / "diagnoses").mkdir()
    assert diagnose_all(tmp_path, progress=quiet) == 3
    scored = score(*open_key(tmp_path))
    assert scored["refused"] == []
    assert scored["false_alarms"]["share"] == 0
    assert [row["first"]["share"] for row in scored["by_cause"]] == [1, 1]
    by_name = {(s["cause"], s["parameter"]): s["estimate"] for s in scored["sizes"]["estimates"]}
    assert by_name["temperature", "deviation_k"] == pytest.approx(10, abs=1)
    assert by_name["airspeed_bias", "growth_kt"] == pytest.approx(2.5, abs=0.5)


def test_a_corrected_simulator_comes_closer_to_the_flights(folder: Path, tmp_path: Path) -> None:
    rows = folder / "sets" / "blind_0001.parquet"
    simulator = folder / "simulators" / "simulator_000.ckpt"
    report = package_diagnosis(rows, simulator, None, tmp_path)
    assert report["verdict"] == "effect"
    corrected = tmp_path / "corrected.ckpt"
    whole = closing(rows, simulator, corrected, corrected)
    # Ten kelvins change the rate by 2 %: beside the chance of who flies it shows at some levels only.
    assert 0 < whole["cells"] < 200
    assert whole["after"] < whole["before"]
    assert whole["true"] == whole["after"]
    assert whole["of_true"] == (pytest.approx(1.0) if whole["cells"] >= MIN_CELLS else None)
