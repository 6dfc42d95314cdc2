"""Run the notebook of the tutorials: its code cells in their order, each with what a notebook shows below it."""

import ast
import contextlib
import io
import json
import tempfile
from pathlib import Path
from typing import Any

from sphinx.application import Sphinx

NAME = "notebook.ipynb"


def shown(value: object) -> dict[str, Any]:
    """Output of a cell whose last line has this value, as a notebook keeps it."""
    page = getattr(value, "_repr_html_", None)
    data = {"text/plain": repr(value)} | ({"text/html": page()} if page else {})
    return {"output_type": "execute_result", "execution_count": None, "metadata": {}, "data": data}


def run_cell(code: str, names: dict[str, Any]) -> list[dict[str, Any]]:
    """Outputs of a cell, with the names that it makes added to those of the cells before."""
    lines = ast.parse(code)
    last = lines.body.pop() if lines.body and isinstance(lines.body[-1], ast.Expr) else None
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        exec(compile(lines, NAME, "exec"), names)
        value = None if last is None else eval(compile(ast.Expression(last.value), NAME, "eval"), names)
    text = printed.getvalue()
    outputs = [{"output_type": "stream", "name": "stdout", "text": text}] if text else []
    return outputs + ([] if value is None else [shown(value)])


def executed(path: Path) -> dict[str, Any]:
    """The notebook with its outputs, run in a folder of its own; the error of a cell that fails is raised."""
    notebook: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    names: dict[str, Any] = {"__name__": "__main__"}
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        for cell in notebook["cells"]:
            if cell["cell_type"] == "code":
                cell["outputs"] = run_cell("".join(cell["source"]), names)
    return notebook


def make(app: Sphinx) -> None:
    """Write the notebook with its outputs where the site has it for download."""
    folder = Path(app.srcdir) / "made" / "site"
    folder.mkdir(parents=True, exist_ok=True)
    text = json.dumps(executed(Path(app.srcdir) / "tutorials" / NAME), indent=1)
    (folder / NAME).write_text(text, encoding="utf-8")


def setup(app: Sphinx) -> dict[str, Any]:
    """Tell Sphinx."""
    app.connect("builder-inited", make)
    return {"version": "1", "parallel_read_safe": True}
