"""`import descentflow` offers a dozen names and costs nothing; its threads and set-up script."""

import ast
import inspect
import os
import subprocess
import sys
from pathlib import Path

import pytest
import torch
from test_import_boundaries import heavy_modules

import descentflow
from descentflow.core import threads
from descentflow.core.threads import one_thread_where_they_spin

SOURCE = Path(descentflow.__file__)


def test_import_loads_nothing_heavy() -> None:
    assert heavy_modules("import descentflow") == set()
    assert heavy_modules("import descentflow; dir(descentflow)") == set()
    assert heavy_modules("from descentflow import DescentflowError, __version__") == set()


@pytest.mark.parametrize(("told", "wait"), [(None, "PASSIVE"), ("ACTIVE", "ACTIVE")])
def test_waiting_threads_leave_the_processor_to_others_unless_told(told: str | None, wait: str) -> None:
    """It is read when torch is loaded, and what the user set stays."""
    environment = {name: value for name, value in os.environ.items() if name != "OMP_WAIT_POLICY"}
    told_so = {} if told is None else {"OMP_WAIT_POLICY": told}
    asked = "import descentflow, os, sys; print('torch' in sys.modules, os.environ['OMP_WAIT_POLICY'])"
    done = subprocess.run([sys.executable, "-c", asked], env=environment | told_so, capture_output=True, text=True)
    assert done.stdout.split() == ["False", wait]


@pytest.mark.parametrize(
    ("first", "told", "spin"),
    [("torch", {}, "True"), ("descentflow", {}, "False"), ("torch", {"OMP_NUM_THREADS": "2"}, "False")],
)
def test_threads_are_known_to_spin_where_torch_came_first(first: str, told: dict[str, str], spin: str) -> None:
    names = ("OMP_WAIT_POLICY", "OMP_NUM_THREADS")
    environment = {name: value for name, value in os.environ.items() if name not in names} | told
    asked = f"import {first}; from descentflow.core.threads import SPIN; print(SPIN)"
    done = subprocess.run([sys.executable, "-c", asked], env=environment, capture_output=True, text=True)
    assert done.stdout.split() == [spin]


@pytest.mark.parametrize("spin", [True, False])
def test_small_arrays_keep_to_one_thread_where_threads_spin(spin: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(threads, "SPIN", spin)
    before = torch.get_num_threads()
    torch.set_num_threads(2)
    try:
        threads_within = one_thread_where_they_spin()(torch.get_num_threads)()
        assert (threads_within, torch.get_num_threads()) == (1 if spin else 2, 2)
    finally:
        torch.set_num_threads(before)


@pytest.mark.parametrize("name", [name for name in descentflow.__all__ if not name.startswith("__")])
def test_every_name_is_there_and_explained(name: str) -> None:
    attribute = getattr(descentflow, name)
    assert inspect.isclass(attribute) or callable(attribute)
    assert inspect.getdoc(attribute)
    assert name in dir(descentflow)
    # From now on it is an attribute like any other.
    assert vars(descentflow)[name] is attribute


def test_type_checkers_see_the_same_objects() -> None:
    """Names imported for type checking are those that the program gives when it runs."""
    (typing_only,) = (
        node
        for node in ast.parse(SOURCE.read_text()).body
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"
    )
    seen = {
        alias.asname or alias.name: (node.module.removeprefix("descentflow."), alias.name)
        for node in typing_only.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    assert seen == descentflow._PLACES
    assert {*seen, "DescentflowError", "__version__"} == set(descentflow.__all__)


SCRIPT = Path(__file__).resolve().parents[2] / "scripts" / "setup_environment.sh"


def test_traffic_is_sent_to_an_environment_of_its_own() -> None:
    for extras in ("traffic,pandas", "traffic"):
        done = subprocess.run(["bash", str(SCRIPT), extras], capture_output=True, text=True, check=False)
        assert done.returncode == 1
        assert "the extra traffic wants pandas below 3" in done.stderr
        assert "docs/how-to/export_traffic.md" in done.stderr
