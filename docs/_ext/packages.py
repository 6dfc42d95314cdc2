"""The package as its files tell it: packages, modules, first sentences and the arrows between layers."""

import ast
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = ROOT / "descentflow"

LAYERS = {
    "Ground": ("core", "configs", "reporting"),
    "Physics and aircraft": ("physics", "aircraft_types"),
    "Data": ("surveillance", "measurements", "air", "weather"),
    "Model": ("representation", "densities", "training", "positions", "generation", "evaluation", "exports"),
    "Diagnosis": ("effects", "diagnosis", "repairs", "qualification", "watching"),
    "Worlds": ("simulation",),
    "Command line": ("cli",),
}
"""The reading order of the house; a package that is missing here stops the build."""


def is_public(path: Path) -> bool:
    """Test for a file or folder that is a module of the API."""
    return not path.name.startswith(("_", "."))


def folders(package: Path) -> list[Path]:
    """The packages directly inside a package, by name."""
    return sorted(path.parent for path in package.glob("*/__init__.py") if is_public(path.parent))


def modules(package: Path) -> list[Path]:
    """The modules directly inside a package, by name."""
    return sorted(path for path in package.glob("*.py") if is_public(path))


def dotted(path: Path) -> str:
    """The import name of a module or package."""
    return ".".join(path.relative_to(ROOT).with_suffix("").parts)


def first_sentence(path: Path) -> str:
    """The first sentence of a module's docstring."""
    text = ast.get_docstring(ast.parse((path / "__init__.py" if path.is_dir() else path).read_text())) or ""
    return " ".join(text.split("\n\n")[0].split())


def layers() -> dict[str, list[Path]]:
    """Layer -> its packages, checked against the folders that there are."""
    named = [name for names in LAYERS.values() for name in names]
    there = [path.name for path in folders(PACKAGE)]
    if sorted(named) != there:
        raise ValueError(f"docs/_ext/packages.py: LAYERS names {sorted(named)}, and the packages are {there}")
    return {layer: [PACKAGE / name for name in names] for layer, names in LAYERS.items()}


def imports_of(package: Path) -> set[str]:
    """The other top packages that any file of a package imports, lazily and for typing too."""
    found: set[str] = set()
    for path in package.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.ImportFrom) and node.module and node.module.startswith("descentflow."):
                found.add(node.module.split(".")[1])
            elif isinstance(node, ast.Import):
                found |= {a.name.split(".")[1] for a in node.names if a.name.startswith("descentflow.")}
    return found - {package.name}
