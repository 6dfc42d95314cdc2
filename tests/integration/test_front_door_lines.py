"""The lines that the README shows run, each result prints something, and notebooks show figures and lines."""

import importlib.util
import re
from pathlib import Path
from typing import Any

import polars as pl
import pytest
import toys
from markupsafe import escape
from matplotlib.axes import Axes

import descentflow as df
from descentflow.core.errors import DataError
from descentflow.effects import EFFECTS
from descentflow.simulation.world_config import WorldConfig
from descentflow.surveillance.descents.prepared_descents import read_descents
from descentflow.surveillance.rows.drop_report import DropReport, Step

README = Path(__file__).resolve().parents[2] / "README.md"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """``rows.parquet`` of 150 A320 and ``other.parquet`` of 120 others in air that is 10 K warmer."""
    folder = tmp_path_factory.mktemp("door")
    df.simulate("A320", 150, 0, out=folder / "rows.parquet")
    df.simulate("A320", 120, 1, scenario=WorldConfig(deviation_mean_k=10.0), out=folder / "other.parquet")
    return folder


def says_something(result: object) -> None:
    """A few lines and not a dump."""
    text = str(result)
    assert 1 <= len(text.splitlines()) <= 60
    assert len(text) <= 4000
    assert "object at 0x" not in text
    assert "object at 0x" not in repr(result)


def test_the_lines_of_the_readme(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The very lines, as the README prints them."""
    readme = README.read_text(encoding="utf-8")
    block = re.search(r"<!-- the dozen lines -->\n```python\n(.*?)```", readme, re.DOTALL)
    assert block is not None
    monkeypatch.chdir(folder)
    names: dict[str, Any] = {}

    exec(block[1], names)

    for name in ("descents", "model", "samples", "scores", "report"):
        says_something(names[name])
    assert len(names["samples"]) == 10_000
    assert names["samples"].to_polars()["level_fl"].min() == 150
    assert [cause.effect for cause in names["report"].causes] == ["temperature"]
    assert names["report"].causes[0].closure.marginal.estimate > 0.8


@pytest.mark.filterwarnings("ignore:.*and are no test of it:descentflow.core.errors.DescentflowWarning")
def test_each_takes_what_the_last_returns_or_a_path_of_it(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folder)
    world = df.simulate(df.aircraft("A320"), 150, 0)
    says_something(world)
    says_something(df.aircraft("A320"))

    in_memory = df.prepare(world)
    written = df.prepare("rows.parquet", out="descents.parquet")
    for descents in (written, df.read_descents("descents.parquet"), df.prepare(world.rows)):
        assert descents.frame.equals(in_memory.frame)

    fitted = df.fit(in_memory, "gaussian")
    df.fit("descents.parquet", df.Gaussian(), out="gaussian.ckpt")
    loaded = df.load("gaussian.ckpt")
    says_something(loaded)
    assert df.load(Path("gaussian.ckpt")).representation.split == fitted.final.representation.split

    drawn = [df.sample(model, 50, seed=3).to_polars() for model in (fitted, loaded, "gaussian.ckpt")]
    assert drawn[0].equals(drawn[1])
    assert drawn[0].equals(drawn[2])

    scored = [
        df.evaluate(model, real, n=100, n_splits=2).to_polars()
        for model, real in (
            (fitted, in_memory),
            (loaded, world),
            ("gaussian.ckpt", "descents.parquet"),
            ("gaussian.ckpt", "rows.parquet"),
        )
    ]
    assert all(scores.equals(scored[0]) for scores in scored)

    ahead = [
        df.predict(model, real, from_fl=290, n=60)
        for model, real in ((fitted, in_memory), ("gaussian.ckpt", "descents.parquet"))
    ]
    says_something(ahead[0])
    assert ahead[0].to_polars().equals(ahead[1].to_polars())

    reports = [
        df.diagnose(real, simulator, catalogue={"mass": EFFECTS["mass"]})
        for real, simulator in ((df.read_descents("descents.parquet"), fitted), ("rows.parquet", "gaussian.ckpt"))
    ]
    assert reports[0].verdict == reports[1].verdict
    assert reports[0].p_value == reports[1].p_value


def test_tabular_results_convert(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("pandas")
    pytest.importorskip("xarray")
    monkeypatch.chdir(folder)
    descents = df.prepare("rows.parquet")
    model = df.fit(descents, "gaussian")
    samples, evaluation = df.sample(model, 20), df.evaluate(model, descents, n=100, n_splits=2)
    ahead = df.predict(model, descents, from_fl=290, n=60)
    for result in (descents, samples, evaluation, ahead):
        table = result.to_polars()
        assert isinstance(table, pl.DataFrame)
        assert list(result.to_pandas().columns) == table.columns
        assert len(result.to_pandas()) == len(table)
    for result in (descents, samples):
        assert result.to_xarray().sizes


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
