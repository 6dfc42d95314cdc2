"""The lines that the README shows run, in memory and by paths, and each result says something."""

from pathlib import Path

import polars as pl
import pytest

import descentflow as df


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """``rows.parquet`` of 150 A320 and ``other.parquet`` of 120 others whose rates are reported late."""
    folder = tmp_path_factory.mktemp("door")
    for name, flights, seed in (("rows", 150, 0), ("other", 120, 1)):
        df.simulate("A320", flights, seed, out=folder / f"{name}.parquet")
    return folder


def says_something(result: object) -> None:
    """A few lines and not a dump."""
    text = str(result)
    assert 1 <= len(text.splitlines()) <= 60
    assert len(text) <= 4000
    assert "object at 0x" not in text
    assert "object at 0x" not in repr(result)


def test_the_lines_of_the_readme(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folder)

    descents = df.prepare("rows.parquet", typecode="A320")
    model = df.fit(descents, model="flow", max_epochs=4)
    samples = df.sample(model, n=300, seed=0)
    scores = df.evaluate(model, descents, n=300)
    report = df.diagnose(real="other.parquet", simulator=model)

    for result in (descents, model, samples, scores, report):
        says_something(result)
    assert len(samples) == 300
    assert samples.to_polars()["level_fl"].min() == 150
    assert report.verdict in ("none", "explained", "unknown")
    nominal = df.diagnose("other.parquet", "A320")
    says_something(nominal)
    assert nominal.causes
    assert nominal.causes[0].closure.marginal is not None


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
    assert df.load(Path("gaussian.ckpt")).representation.split == fitted.representation.split

    drawn = [df.sample(model, 50, seed=3).to_polars() for model in (fitted, loaded, "gaussian.ckpt")]
    assert drawn[0].equals(drawn[1])
    assert drawn[0].equals(drawn[2])

    scored = [
        df.evaluate(model, real, n=200).to_polars()
        for model, real in (
            (fitted, in_memory),
            (loaded, world),
            ("gaussian.ckpt", "descents.parquet"),
            ("gaussian.ckpt", "rows.parquet"),
        )
    ]
    assert all(one.equals(scored[0]) for one in scored)

    ahead = [
        df.predict(model, real, from_fl=290, n=20)
        for model, real in ((fitted, in_memory), ("gaussian.ckpt", "descents.parquet"))
    ]
    says_something(ahead[0])
    assert ahead[0].to_polars().equals(ahead[1].to_polars())

    reports = [
        df.diagnose(real, simulator)
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
    samples, found = df.sample(model, 20), df.evaluate(model, descents, n=100)
    ahead = df.predict(model, descents, from_fl=290, n=10)
    for result in (descents, samples, found, ahead):
        table = result.to_polars()
        assert isinstance(table, pl.DataFrame)
        assert list(result.to_pandas().columns) == table.columns
        assert len(result.to_pandas()) == len(table)
    for result in (descents, samples):
        assert result.to_xarray().sizes
