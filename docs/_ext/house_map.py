"""The directive ``house-map``: layers, packages, a sentence each, and which packages each imports."""

import re
from typing import Any

import packages
from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective


def plain(text: str) -> str:
    """A sentence of a docstring in Markdown: references become code."""
    return re.sub(r":\w+:`~?([^`]+)`", lambda found: f"`{found[1].rsplit('.', 1)[-1]}`", text)


class HouseMap(SphinxDirective):
    """The map of the house, read from the files themselves; for pages in Markdown."""

    def run(self) -> list[nodes.Node]:
        """For each layer a definition list of its packages."""
        lines = []
        for layer, inside in packages.layers().items():
            lines += [f"**{layer}**", ""]
            for package in inside:
                arrows = ", ".join(f"`{name}`" for name in sorted(packages.imports_of(package))) or "nothing"
                inner = ", ".join(f"`{path.name}/`" for path in packages.folders(package))
                lines += [f"{{doc}}`{package.name}/ </made/api/{packages.dotted(package)}>`"]
                lines += [f": {plain(packages.first_sentence(package))}", ""]
                lines += [f"  Inside: {inner}." if inner else "", "", f"  Imports {arrows}.", ""]
        return self.parse_text_to_nodes("\n".join(lines))


def setup(app: Sphinx) -> dict[str, Any]:
    """Tell Sphinx."""
    app.add_directive("house-map", HouseMap)
    return {"version": "1", "parallel_read_safe": True}
