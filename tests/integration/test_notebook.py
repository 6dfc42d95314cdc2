"""Results in a notebook: a figure, and the lines that they print, escaped."""

import importlib.util
from pathlib import Path

import pytest
import toys
from markupsafe import escape
from matplotlib.axes import Axes

import descentflow as df
from descentflow.core.errors import DataError
from descentflow.effects import EFFECTS
from descentflow.surveillance.descents.prepared_descents import read_descents
from descentflow.surveillance.rows.drop_report import DropReport, Step


def test_results_are_shown_with_a_figure_and_their_lines(tmp_path: Path) -> None:
    descents = read_descents(toys.write_descents_file(tmp_path / "a320.parquet", 120))
    model = df.fit(descents, "gaussian")
    results = [
        descents,
        DropReport([Step("duplicate", 2, None, 98, None), Step("transient", 8, 0, 90, 3)]),
        model,
        df.sample(model, 60),
        df.evaluate(model, descents, n=200, n_splits=2),
        df.predict(model, descents, from_fl=290, n=50),
        df.diagnose(descents, "A320", catalogue={"mass": EFFECTS["mass"]}),
    ]
    for result in results:
        shown = result._repr_html_()
        assert '<figure><img alt="Figure of the ' in shown, type(result)
        assert 'src="data:image/png;base64,' in shown
        assert shown.endswith(f"<pre>{escape(str(result))}</pre>")
        axes = result.plot()
        assert all(isinstance(ax, Axes) for ax in axes), type(result)
        assert any(ax.has_data() for ax in axes), type(result)


def test_what_has_no_figure_is_shown_in_words() -> None:
    assert df.Gaussian()._repr_html_() == "<pre>Gaussian, not fitted yet</pre>"
    assert DropReport()._repr_html_().startswith("<pre>")
    for nothing in (df.Gaussian(), DropReport()):
        with pytest.raises(DataError, match=f"a {type(nothing).__name__} with nothing to draw"):
            nothing.plot()


@pytest.mark.slow
def test_the_notebook_of_the_tutorials_runs_and_shows_figures() -> None:
    docs = Path(__file__).resolve().parents[2] / "docs"
    spec = importlib.util.spec_from_file_location("run_notebook", docs / "_ext" / "run_notebook.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    notebook = module.executed(docs / "tutorials" / module.NAME)
    pages = [
        output["data"]["text/html"]
        for cell in notebook["cells"]
        for output in cell.get("outputs", ())
        if "text/html" in output.get("data", {})
    ]
    assert sum("<img" in page for page in pages) >= 6
