"""Every example of a docstring is run, in a folder that holds the files which examples speak of."""

import doctest
import functools
import importlib
import pkgutil
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import torch

import descentflow
import studies
from descentflow.cli import main
from descentflow.effects import EFFECTS

NEEDS = {
    f"studies.jsbsim_world.{name}": "jsbsim" for name in ("fly_models", "model_aircraft", "model_files", "model_flight")
} | {
    "descentflow.exports.onnx_export": "onnxscript",
    "descentflow.surveillance.formats._asterix": "pyasteryx",
    "descentflow.surveillance.formats._mode_s": "rs1090",
}
"""Modules whose examples need an optional library; where it is missing they are skipped."""
LONG = ("descentflow.exports.onnx_export",)
"""Modules whose examples compile a sampler, as tests of the exports do by default."""


def module_names() -> list[str]:
    return sorted(
        module.name
        for package in (descentflow, studies)
        for module in pkgutil.walk_packages(package.__path__, f"{package.__name__}.")
    )


@pytest.fixture(scope="session")
def example_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """``rows.parquet``, ``descents.parquet`` and ``best.ckpt``: 120 A320 of the simulated world and a Gaussian."""
    folder = tmp_path_factory.mktemp("examples")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        assert main(["simulate", "--typecode", "A320", "--flights", "120", "--out", "rows.parquet"]) == 0
        assert main(["prepare", "rows.parquet", "--out", "descents.parquet"]) == 0
        fit = ["fit", "--model", "Gaussian", "--data.descents", "descents.parquet", "--trainer.max_epochs", "1"]
        assert main([*fit, "--trainer.logger", "false"]) == 0
    (checkpoint,) = folder.rglob("best.ckpt")
    checkpoint.rename(folder / "best.ckpt")
    return folder


USUAL: dict[str, tuple[tuple[object, ...], dict[str, object]]] = {
    "descentflow.diagnosis.diagnose": (("descents.parquet", "A320"), {"catalogue": {"mass": EFFECTS["mass"]}}),
    "descentflow.repairs.repair": (("descents.parquet",), {"aircraft": "A320"}),
    "descentflow.qualification.qualify": (("descents.parquet", "A320"), {}),
}
"""Module -> arguments of the call of its function of the same name whose result many examples show a part of."""


@pytest.fixture(scope="session")
def results() -> dict[str, object]:
    """Module -> what its usual call gave."""
    return {}


@pytest.fixture
def own_once(name: str, results: dict[str, object], monkeypatch: pytest.MonkeyPatch) -> dict[str, object]:
    """Usual calls are made once, every other call runs as it stands; gives the function of the module of this name."""
    own: dict[str, object] = {}
    for place, usual in USUAL.items():
        module, function = importlib.import_module(place), place.rpartition(".")[2]
        made = functools.partial(once, getattr(module, function), usual, results, place)
        if name == place:
            own[function] = made
        else:
            monkeypatch.setattr(module, function, functools.wraps(getattr(module, function))(made))
    return own


def once(
    function: Callable[..., object],
    usual: tuple[tuple[object, ...], dict[str, object]],
    results: dict[str, object],
    place: str,
    *words: object,
    **options: object,
) -> object:
    """Result of a call, kept if it is the usual one."""
    if (words, options) != usual:
        return function(*words, **options)
    if place not in results:
        results[place] = function(*words, **options)
    return results[place]


# The examples' flights are those that their checkpoint was trained on.
@pytest.mark.filterwarnings("ignore:.*and are no test of it:descentflow.core.errors.DescentflowWarning")
@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=pytest.mark.slow) if name in LONG or name.startswith("studies.") else name
        for name in module_names()
    ],
)
def test_examples_give_what_they_say(
    name: str, own_once: dict[str, object], example_folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if name in NEEDS:
        pytest.importorskip(NEEDS[name], reason=f"{NEEDS[name]} (an extra of descentflow) is not installed")
    monkeypatch.chdir(example_folder)
    module = importlib.import_module(name)
    flags = doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS
    torch.manual_seed(0)
    result = doctest.testmod(module, extraglobs={"torch": torch, "Path": Path, **own_once}, optionflags=flags)
    assert result.failed == 0


def blocks_of(page: str) -> list[str]:
    text = (Path(__file__).resolve().parents[1] / "docs" / "how-to" / f"{page}.md").read_text(encoding="utf-8")
    return re.findall(r"```python\n(.*?)```", text, re.DOTALL)


def test_the_page_of_the_running_simulator_runs(example_folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(example_folder)
    (block,) = blocks_of("running_simulator")
    made: dict[str, object] = {}
    exec(block, made)
    assert len(made["many"]) == 100


@pytest.mark.parametrize("page", ["densities", "air", "positions"])
def test_the_first_lines_of_python_of_a_page_run(
    page: str, example_folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(example_folder)
    made: dict[str, object] = {}
    exec(blocks_of(page)[0], made)
    assert {"model", "samples"} & set(made)


def test_the_page_of_lightning_scripts_runs(example_folder: Path, monkeypatch: pytest.MonkeyPatch, capsys) -> None:
    monkeypatch.chdir(example_folder)
    script, _ = blocks_of("lightning")
    made: dict[str, Any] = {}
    exec(script, made)
    assert len(made["samples"]) == 100
    assert made["best"].best_model_score <= made["trainer"].callback_metrics[made["ENERGY"]]
    assert re.findall(r"epoch (\d): \d+% plausible", capsys.readouterr().out) == ["1", "2", "3"]


def test_the_sweep_of_that_page_runs(example_folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("optuna", reason="Optuna is no extra of descentflow: pip install optuna")
    monkeypatch.chdir(example_folder)
    made: dict[str, Any] = {}
    for block in blocks_of("lightning"):
        exec(block, made)
    assert [trial.state.name for trial in made["study"].trials] == ["COMPLETE"] * 3
    assert 0 < made["study"].best_value < 50
