"""The directive ``house-map``: layers, packages, a sentence each, and which packages each imports."""

from typing import Any

import packages
from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective


class HouseMap(SphinxDirective):
    """The map of the house, read from the files themselves."""

    def run(self) -> list[nodes.Node]:
        """Sections of packages, each a definition list."""
        lines = []
        for layer, inside in packages.layers().items():
            lines += [f"**{layer}**", ""]
            for package in inside:
                arrows = ", ".join(f"``{name}``" for name in sorted(packages.imports_of(package))) or "nothing"
                inner = [path.name for path in packages.folders(package)]
                lines += [f":doc:`{package.name}/ <made/api/{packages.dotted(package)}>`".replace("<made", "</made")]
                lines += [f"   {packages.first_sentence(package)}", ""]
                if inner:
                    lines += ["   Inside: " + ", ".join(f"``{name}/``" for name in inner) + ".", ""]
                lines += [f"   Imports {arrows}.", ""]
        return self.parse_text_to_nodes("\n".join(lines))


def setup(app: Sphinx) -> dict[str, Any]:
    """Tell Sphinx."""
    app.add_directive("house-map", HouseMap)
    return {"version": "1", "parallel_read_safe": True}
