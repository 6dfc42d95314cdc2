"""What may import what, read from the imports themselves; and that light commands stay light."""

import ast
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parents[1] / "descentflow"

ONLY_IN = {
    "pyro": ("densities/gmm.py",),
    "normflows": ("densities/flow.py", "densities/layers.py"),
    "lightning": ("data/", "models/", "callbacks/", "training.py"),
    "tensorboard": ("callbacks/",),
    "rs1090": ("surveillance/sources/",),
    "pyasteryx": ("surveillance/sources/",),
}
"""Library -> the places that may import it."""

KNOWS_NO_TRAINER = (
    "densities",
    "performance",
    "profiles",
    "decoder",
    "fpca",
    "sampling",
    "metrics",
    "world",
    "gap",
    "figures",
)
"""Folders that must not import the parts of the package that know Lightning."""

TRAINER_PARTS = ("descentflow.models", "descentflow.callbacks", "descentflow.training", "descentflow.data.datamodule")


def imports(path: Path) -> Iterator[str]:
    """Every module that a file imports, inside functions too."""
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            yield node.module
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def files() -> list[Path]:
    return sorted(PACKAGE.rglob("*.py"))


def inside(module: str, parent: str) -> bool:
    return module == parent or module.startswith(f"{parent}.")


@pytest.mark.parametrize("library", ONLY_IN)
def test_libraries_stay_in_their_places(library: str) -> None:
    strays = [
        str(path.relative_to(PACKAGE))
        for path in files()
        if any(inside(name, library) for name in imports(path))
        and not str(path.relative_to(PACKAGE)).startswith(ONLY_IN[library])
    ]
    assert strays == []


def test_torch_parts_know_no_trainer() -> None:
    strays = [
        f"{path.relative_to(PACKAGE)} imports {name}"
        for folder in KNOWS_NO_TRAINER
        for path in sorted((PACKAGE / folder).rglob("*.py"))
        for name in imports(path)
        if any(inside(name, part) for part in TRAINER_PARTS)
    ]
    assert strays == []


def test_the_world_never_uses_the_energy_share_form() -> None:
    """The twin that tests the decoder must not share its equation of motion."""
    strays = [
        f"{path.name} imports {name}"
        for path in sorted((PACKAGE / "world").rglob("*.py"))
        for name in imports(path)
        if name.startswith(("descentflow.performance.energy", "descentflow.performance.nominal", "descentflow.decoder"))
    ]
    assert strays == []


def heavy_modules(code: str) -> set[str]:
    """Which heavy modules a fresh process has loaded after running some code."""
    listing = "print(*(m for m in ('torch', 'lightning', 'pyro', 'matplotlib') if m in sys.modules))"
    report = f"import sys\n{code}\n{listing}"
    done = subprocess.run([sys.executable, "-c", report], capture_output=True, text=True, check=True)
    return set(done.stdout.splitlines()[-1].split())


def test_loading_a_density_imports_no_trainer() -> None:
    """Lightning takes longer to import than torch: a script that samples does not pay for it."""
    code = "import descentflow.densities.checkpoint, descentflow.sampling.rejection, descentflow.densities.gaussian"
    assert heavy_modules(code) == {"torch"}


def test_help_imports_nothing_heavy() -> None:
    assert heavy_modules("from descentflow.cli import main; main(['--help'])") == set()
    assert heavy_modules("from descentflow.cli import main; main(['fit', '--help'])") == set()


@pytest.mark.parametrize("command", ["simulate", "prepare", "sample", "evaluate", "diagnose"])
def test_help_of_a_command_imports_nothing_heavy(command: str) -> None:
    code = f"from descentflow.cli import main\ntry: main([{command!r}, '--help'])\nexcept SystemExit: pass"
    assert heavy_modules(code) == set()


def test_surveillance_does_not_pay_torchs_import() -> None:
    names = [
        f"descentflow.surveillance.{path.stem}"
        for path in sorted((PACKAGE / "surveillance").glob("*.py"))
        if path.stem != "__init__"
    ]
    assert "torch" not in heavy_modules("\n".join(f"import {name}" for name in names))
