"""One page of the API for each package, from its docstrings, written before Sphinx reads its sources."""

import ast
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import packages
from docutils import nodes
from sphinx.addnodes import pending_xref
from sphinx.application import Sphinx
from sphinx.domains.python import ObjectEntry
from sphinx.environment import BuildEnvironment
from sphinx.util.nodes import make_refnode

import descentflow


def heading(text: str, mark: str) -> list[str]:
    """A heading in reStructuredText."""
    return [text, mark * len(text), ""]


def toctree(names: list[str], hidden: bool = False) -> list[str]:
    """A list of pages."""
    options = ["   :hidden:"] if hidden else []
    return [".. toctree::", "   :maxdepth: 1", *options, "", *(f"   {name}" for name in names), ""]


def module_section(path: Path) -> list[str]:
    """A module with everything public in it."""
    name = packages.dotted(path)
    short = name.rsplit(".", 1)[1]
    return [*heading(short, "-"), f".. automodule:: {name}", "   :members:", ""]


def own_constants(package: Path) -> list[str]:
    """Constants with a docstring that a package's own file defines; the rest of what it exports has its own page."""
    body = ast.parse((package / "__init__.py").read_text()).body
    found = []
    for node, after in pairwise(body):
        documented = isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant)
        targets = (
            [node.target] if isinstance(node, ast.AnnAssign) else node.targets if isinstance(node, ast.Assign) else []
        )
        found += [t.id for t in targets if documented and isinstance(t, ast.Name) and not t.id.startswith("_")]
    return found


def page(package: Path) -> str:
    """The page of a package: its docstring, its inner packages, then its modules in one go."""
    name = packages.dotted(package)
    inner = packages.folders(package)
    lines = [f".. _api-{name}:", "", *heading(name.split(".", 1)[1], "="), f".. automodule:: {name}"]
    constants = own_constants(package)
    lines += [f"   :members: {', '.join(constants)}", ""] if constants else [""]
    if inner:
        lines += [".. rubric:: Packages", "", *toctree([packages.dotted(path) for path in inner])]
    for module in packages.modules(package):
        lines += module_section(module)
    return "\n".join(lines)


def front_page() -> str:
    """The page of the front door: its own docstring, whose names lead to where each function is."""
    return "\n".join([*heading("descentflow, the front door", "="), ".. automodule:: descentflow", ""])


def index() -> str:
    """The list of packages by layer."""
    lines = [
        *heading("API reference", "="),
        "Every package, by layer; each page is made from the docstrings.",
        "",
        *toctree(["descentflow"]),
    ]
    for layer, inside in packages.layers().items():
        lines += [*heading(layer, "-"), *toctree([packages.dotted(path) for path in inside])]
    return "\n".join(lines)


def write(app: Sphinx) -> None:
    """Write the pages that changed into made/api."""
    folder = Path(app.srcdir) / "made" / "api"
    folder.mkdir(parents=True, exist_ok=True)
    pages = {"index": index(), "descentflow": front_page()}
    waiting = [package for inside in packages.layers().values() for package in inside]
    while waiting:
        package = waiting.pop()
        pages[packages.dotted(package)] = page(package)
        waiting += packages.folders(package)
    for old in folder.glob("*.rst"):
        if old.stem not in pages:
            old.unlink()
    for name, text in pages.items():
        target = folder / f"{name}.rst"
        if not target.is_file() or target.read_text() != text:
            target.write_text(text)


@cache
def last_parts(env: BuildEnvironment) -> dict[str, list[tuple[str, ObjectEntry]]]:
    """Objects of the API with a page of their own, by the last part of their names, once all pages are read.

    Thousands of references are looked up when pages are written, and each would read through thousands of names.
    """
    found: dict[str, list[tuple[str, ObjectEntry]]] = {}
    for name, entry in env.domains.python_domain.objects.items():
        if not entry.aliased:
            found.setdefault(name.rsplit(".", 1)[-1], []).append((name, entry))
    return found


def by_last_name(
    app: Sphinx, env: BuildEnvironment, node: pending_xref, content: nodes.TextElement
) -> nodes.reference | None:
    """Resolve a short name, or one that a package exports, where a single object of the API has that name."""
    if node.get("refdomain") != "py":
        return None
    parts, known = str(node["reftarget"]).split("."), last_parts(env)
    ends = [f".{'.'.join(parts)}", f".{parts[-1]}"] if parts[0] == "descentflow" else [f".{'.'.join(parts)}"]
    if node.get("py:module") == "descentflow" and parts[-1] in descentflow._PLACES:
        ends = [f"descentflow.{'.'.join(descentflow._PLACES[parts[-1]])}"]
    for end in ends:
        found = [(name, entry) for name, entry in known.get(end.rsplit(".", 1)[-1], []) if name.endswith(end)]
        if len(found) == 1:
            name, entry = found[0]
            return make_refnode(app.builder, node["refdoc"], entry.docname, entry.node_id, [content], name)
    return None


def setup(app: Sphinx) -> dict[str, Any]:
    """Tell Sphinx."""
    app.connect("builder-inited", write)
    app.connect("missing-reference", by_last_name)
    return {"version": "1", "parallel_read_safe": True}
