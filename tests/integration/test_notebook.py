"""Results in a notebook: a figure, and the lines that they print, escaped."""

from pathlib import Path

import pytest
import toys
from markupsafe import escape

import descentflow as df
from descentflow.effects import EFFECTS
from descentflow.surveillance.descents.prepared_descents import read_descents
from descentflow.surveillance.rows.drop_report import DropReport, Step

pytestmark = pytest.mark.usefixtures("components_once")


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


def test_what_has_no_figure_is_shown_in_words() -> None:
    assert df.Gaussian()._repr_html_() == "<pre>Gaussian, not fitted yet</pre>"
    assert DropReport()._repr_html_().startswith("<pre>")
