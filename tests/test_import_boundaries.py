"""Allowed imports, read from the imports themselves; and that light commands stay light."""

import ast
import functools
import subprocess
import sys
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parents[1] / "descentflow"

ONLY_IN = {
    "pyro": ("densities/mixture.py",),
    "normflows": ("densities/flow.py", "densities/layers.py"),
    "lightning": ("training/", "cli/lightning_cli.py"),
    "tensorboard": ("training/callbacks/",),
    "rs1090": ("surveillance/formats/",),
    "pyasteryx": ("surveillance/formats/",),
}
"""Library -> the places that may import it."""

KNOW_THE_TRAINER = {"training", "cli"}
"""Packages that may import what knows Lightning; the front door does so only when it is asked."""


@functools.cache
def imports(path: Path) -> tuple[str, ...]:
    """Every module that a file imports, inside functions and for type checking too."""
    names: list[str] = []
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module:
            names += [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
    return tuple(names)


@functools.cache
def files() -> list[Path]:
    return sorted(PACKAGE.rglob("*.py"))


def inside(module: str, parent: str) -> bool:
    return module == parent or module.startswith(f"{parent}.")


def imported_modules(path: Path) -> set[str]:
    """Modules of the package that a file imports; names imported from a module count as the module."""
    imported = set()
    for name in imports(path):
        parts = name.split(".")
        while parts and not _is_module(*parts):
            parts.pop()
        if len(parts) > 1 and parts[0] == PACKAGE.name:
            imported.add(".".join(parts[1:]))
    return imported


@functools.cache
def _is_module(*parts: str) -> bool:
    place = PACKAGE.parent.joinpath(*parts)
    return place.is_dir() or place.with_suffix(".py").is_file()


def module_of(path: Path) -> str:
    parts = path.relative_to(PACKAGE).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


@functools.cache
def modules() -> dict[str, set[str]]:
    """Module -> modules that it imports, lazily and for type checking too; the front door is left out."""
    by_module = {}
    for path in files():
        own = module_of(path)
        if own:
            # A package is loaded before its modules whatever they import: that is no arrow.
            by_module[own] = {name for name in imported_modules(path) if name != own and not inside(own, name)}
    return by_module


def packages(within: str = "") -> dict[str, set[str]]:
    """The folders directly inside a package (or the top) and which of the others they import."""
    start = f"{within}." if within else ""
    depth = len(start.split("."))
    folders = {
        f"{start}{p.name}" for p in PACKAGE.joinpath(*within.split(".")).iterdir() if (p / "__init__.py").is_file()
    }
    by_folder: dict[str, set[str]] = {folder: set() for folder in folders}
    for module, others in modules().items():
        own = ".".join(module.split(".")[:depth])
        if own in folders:
            by_folder[own] |= {".".join(name.split(".")[:depth]) for name in others} & folders - {own}
    return by_folder


@pytest.mark.parametrize("within", ["", *sorted(packages())])
def test_folders_import_each_other_in_one_direction(within: str) -> None:
    TopologicalSorter(packages(within)).prepare()  # a circle is an error that names it


def test_modules_import_each_other_in_one_direction() -> None:
    TopologicalSorter(modules()).prepare()


def test_a_file_name_stands_for_one_file() -> None:
    names = [path.name for path in PACKAGE.rglob("*.py") if path.name not in ("__init__.py", "__main__.py")]
    assert sorted({name for name in names if names.count(name) > 1}) == []


def test_private_modules_stay_in_their_package() -> None:
    """No other top package, and no script, imports a module whose name begins with an underscore."""
    scripts = sorted((PACKAGE.parent / "scripts").rglob("*.py"))
    uses = modules() | {f"scripts.{path.stem}": imported_modules(path) for path in scripts}
    strays = {
        (user, name)
        for user, others in uses.items()
        for name in others
        if name.split(".")[-1].startswith("_") and user.split(".")[0] != name.split(".")[0]
    }
    assert strays == set()


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
    strays = {folder for folder, others in packages().items() if "training" in others}
    assert strays <= KNOW_THE_TRAINER


def test_the_package_imports_no_study() -> None:
    """Studies lie beside the package, in ``scripts/studies``, and are not in the wheel."""
    strays = [str(path) for path in files() if any(inside(name, "studies") for name in imports(path))]
    assert strays == []


def test_the_world_never_uses_the_energy_share_form() -> None:
    """The twin that tests the decoder must not share its equation of motion."""
    strays = [
        f"{path.name} imports {name}"
        for path in sorted((PACKAGE / "simulation").rglob("*.py"))
        for name in imports(path)
        if name.startswith(
            ("descentflow.physics.energy", "descentflow.physics.nominal_descent", "descentflow.representation")
        )
    ]
    assert strays == []


def test_the_decoder_knows_nothing_of_effects_or_the_diagnosis() -> None:
    strays = [
        f"{module} imports {name}"
        for module, others in modules().items()
        if inside(module, "representation.decoder")
        for name in others
        if name.startswith(("effects", "diagnosis"))
    ]
    assert strays == []


def test_the_report_of_a_diagnosis_reads_findings_and_only_the_front_door_reads_the_report() -> None:
    arrows = [
        (module.removeprefix("diagnosis."), name.removeprefix("diagnosis."))
        for module, others in modules().items()
        for name in others
        if inside(module, "diagnosis") and inside(name, "diagnosis")
    ]
    assert {name.split(".")[0] for module, name in arrows if inside(module, "report")} == {"findings", "report"}
    assert {module.split(".")[0] for module, name in arrows if inside(name, "report")} == {"diagnose", "report"}


def heavy_modules(code: str) -> set[str]:
    """Heavy modules that a fresh process has loaded after running some code."""
    listing = "print(*(m for m in ('torch', 'lightning', 'pyro', 'matplotlib', 'polars') if m in sys.modules))"
    report = f"import sys\n{code}\n{listing}"
    done = subprocess.run([sys.executable, "-c", report], capture_output=True, text=True, check=True)
    return set(done.stdout.splitlines()[-1].split())


def test_loading_a_density_imports_no_trainer() -> None:
    """Lightning takes longer to import than torch: a script that samples does not pay for it."""
    code = "import descentflow.densities.checkpoint, descentflow.generation.rejection, descentflow.densities.gaussian"
    assert heavy_modules(code) - {"polars"} == {"torch"}


def test_a_diagnosis_of_flights_imports_no_model_and_no_reader_of_rows() -> None:
    code = "import sys, descentflow.diagnosis.diagnose\nprint(*(m for m in sys.modules if 'descentflow.' in m))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    loaded = {name.removeprefix("descentflow.") for name in done.stdout.split()}
    models = ("densities.checkpoint", "generation", "representation", "positions", "training", "evaluation", "air")
    others = (*models, "surveillance.formats", "surveillance.prepare")
    assert [name for name in loaded if any(inside(name, parent) for parent in others)] == []


@pytest.mark.parametrize("command", ["", "fit", "simulate", "prepare", "sample", "evaluate", "diagnose"])
def test_help_imports_nothing_heavy(command: str) -> None:
    code = f"from descentflow.cli import main\ntry: main([*{command.split()}, '--help'])\nexcept SystemExit: pass"
    assert heavy_modules(code) <= ({"polars"} if command not in ("", "fit") else set())


def test_surveillance_does_not_pay_torchs_import() -> None:
    names = [
        ".".join(path.relative_to(PACKAGE.parent).with_suffix("").parts)
        for path in sorted((PACKAGE / "surveillance").rglob("*.py"))
        if path.stem != "__init__" and "figures" not in path.parts
    ]
    assert "torch" not in heavy_modules("\n".join(f"import {name}" for name in names))
