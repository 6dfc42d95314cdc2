"""The directive ``command-help``: what ``descentflow --help`` prints, as it prints it today."""

from typing import Any

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

from descentflow.cli.entry import OVERVIEW


class CommandHelp(SphinxDirective):
    """The overview of the commands."""

    def run(self) -> list[nodes.Node]:
        """One literal block."""
        return [nodes.literal_block(OVERVIEW, OVERVIEW, language="text")]


def setup(app: Sphinx) -> dict[str, Any]:
    """Tell Sphinx."""
    app.add_directive("command-help", CommandHelp)
    return {"version": "1", "parallel_read_safe": True}
