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


def as_printed(app: Sphinx, what: str, name: str, found: object, options: object, lines: list[str]) -> None:
    """Show a docstring that is the help of a command as the terminal does."""
    if any(line.startswith("usage: descentflow ") for line in lines):
        lines[2:] = ["::", "", *(f"    {line}" for line in lines[2:]), ""]


def setup(app: Sphinx) -> dict[str, Any]:
    """Tell Sphinx."""
    app.add_directive("command-help", CommandHelp)
    app.connect("autodoc-process-docstring", as_printed, priority=900)  # after napoleon
    return {"version": "1", "parallel_read_safe": True}
