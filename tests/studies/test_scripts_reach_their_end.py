"""Every program of scripts/ runs to its end on a small input; what another test file runs is named with it."""

import importlib
import runpy
import sys
import tarfile
import zipfile
from collections.abc import Mapping, Sequence
from pathlib import Path

import pytest

import descentflow as df
from descentflow.surveillance.descents.prepared_descents import write_descents

SCRIPTS = Path(__file__).resolve().parents[2] / "scripts"
ELSEWHERE = {
    "fuzz": "integration/test_fuzz.py",
    "withheld_effects": "studies/test_blind_study.py",
}
"""Scripts -> the test that runs them."""
RUNS: Mapping[str, Sequence[str]] = {
    "benchmark": ["real"],
    "bluesky_descents": ["--like", "{descents}", "--times", "1", "--out", "{out}/rows.parquet"],
    "cleaning_truth": [],
    "derived_airspeeds": ["--fleets", "1", "--flights", "180", "--out", "{out}/record.md"],
    "energy_share_figure": ["{out}/figure.png"],
    "fly_jsbsim": ["--model", "fokker100", "--flights", "1", "--out", "{out}/rows.parquet"],
    "kill": ["{out}", "--times", "1", "--commands", "sample", "--signals", "KILL"],
    "open_aircraft_page": ["{out}/page.html", "A320"],
    "package_contents": ["{p.whl}", "{p.tar}"],
    "paper_study": ["{out}/study", "--types", "A320", "--share", "0.005", "--models", "gaussian", "--samples", "200"],
    "recorder_thrust": ["{shared}/real/rj85_recorder_2001.parquet"],
    "size": [],
    "study_goals": ["{out}/study", "--model", "gaussian"],
    "study_repair": ["{out}/found.json", "--files", "1"],
    "vary_assumptions": ["{descents}", "A320"],
    "watch_trial": ["{out}/watch", "--streams", "2"],
}
SMALL = {
    "cleaning_truth": {"FLIGHTS": 20},
    "derived_airspeeds": {"DRAWN": 200, "SCORED": 200},
    "study_repair": {"JUDGES": 40},
    "watch_trial": {
        "DAYS": 12,
        "CHANGED_FROM": 10,
        "REFERENCE": 8,
        "FLIGHTS": 8,
        "POOL_FLIGHTS": 15,
        "POOLS": {"before": (1, 13, {}), "front": (2, 3, {})},
        "KINDS": ("front",),
    },
}
"""Constants of scripts that have no option for their size."""
NEEDED = {"bluesky_descents": "bluesky", "fly_jsbsim": "jsbsim", "watch_trial": "river"}
pytestmark = pytest.mark.filterwarnings("default")
"""Libraries that scripts import warn of their own."""


@pytest.fixture(scope="module")
def places(tmp_path_factory: pytest.TempPathFactory) -> Mapping[str, Path]:
    """Files that the scripts read; all write into one folder."""
    folder = tmp_path_factory.mktemp("scripts")
    made = {name: folder / name for name in ("descents.parquet", "model.ckpt", "p.whl", "p.tar")}
    descents = df.prepare(df.simulate("A320", 60, seed=2))
    write_descents(descents, made["descents.parquet"])
    df.fit(descents, model="gaussian", out=made["model.ckpt"])
    package = [path for path in (SCRIPTS.parent / "descentflow").rglob("*") if path.is_file()]
    with zipfile.ZipFile(made["p.whl"], "w") as wheel, tarfile.open(made["p.tar"], "w") as sdist:
        for path in package:
            name = path.relative_to(SCRIPTS.parent).as_posix()
            wheel.write(path, name)
            sdist.add(path, f"descentflow-1/{name}")
    return {name.removesuffix(".parquet").removesuffix(".ckpt"): path for name, path in made.items()} | {"out": folder}


def test_every_script_has_a_run() -> None:
    assert set(RUNS) | set(ELSEWHERE) == {path.stem for path in SCRIPTS.glob("*.py")}
    for name, test in ELSEWHERE.items():
        assert f'"{name}.py"' in (SCRIPTS.parent / "tests" / test).read_text(encoding="utf-8")


@pytest.mark.parametrize("name", RUNS)
def test_a_script_reaches_its_end(
    name: str, places: Mapping[str, Path], request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch
) -> None:
    if name in NEEDED:
        pytest.importorskip(NEEDED[name], reason=f"{NEEDED[name]} is an extra of descentflow")
    words = [word.replace("{shared}", "SHARED") for word in RUNS[name]]
    if words != list(RUNS[name]):
        words = [word.replace("SHARED", str(request.getfixturevalue("shared"))) for word in words]
    for place, path in places.items():
        words = [word.replace(f"{{{place}}}", str(path)) for word in words]
    monkeypatch.setattr(sys, "argv", [f"{name}.py", *words])
    if name in SMALL:
        module = importlib.import_module(name)
        for constant, value in SMALL[name].items():
            monkeypatch.setattr(module, constant, value)
        module.main()
        return
    ended: list[object] = []
    monkeypatch.setattr(sys, "exit", ended.append)
    runpy.run_path(str(SCRIPTS / f"{name}.py"), run_name="__main__")
    assert ended in ([], [0])
