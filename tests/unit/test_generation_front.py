"""Sampling, evaluating and predicting from Python: what each accepts, returns, leaves out and refuses."""

from pathlib import Path

import polars as pl
import pytest
import torch
import toys
from refusals import refuses

from descentflow.core.errors import ConfigError, DataError, DescentflowWarning
from descentflow.densities.checkpoint import content_of, load_model
from descentflow.evaluation.evaluate import evaluate
from descentflow.generation.prediction.predict import predict
from descentflow.generation.sample import sample
from descentflow.surveillance.descents.prepared_descents import Descents, read_descents
from descentflow.training.datamodule import DescentDataModule
from descentflow.training.models import Gaussian


@pytest.fixture(scope="module")
def descents(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return toys.write_descents_file(tmp_path_factory.mktemp("front") / "descents.parquet", 240)


def fitted(descents: Path, **settings: object) -> Gaussian:
    data = DescentDataModule(descents, **settings)
    data.setup()
    return toys.fit(Gaussian(), data, 1)


@pytest.fixture(scope="module")
def model(descents: Path) -> Gaussian:
    return fitted(descents)


@pytest.fixture(scope="module")
def conditional(descents: Path) -> Gaussian:
    return fitted(descents, context=["entry_fl", "hour"])


def test_a_path_a_density_and_a_fitted_model_give_the_same_samples(model: Gaussian, tmp_path: Path) -> None:
    torch.save(content_of(model.density), tmp_path / "model.ckpt")
    models = [model, model.density, tmp_path / "model.ckpt", load_model(tmp_path / "model.ckpt")]
    tables = [sample(one, 20, seed=3).to_polars() for one in models]
    assert all(table.equals(tables[0]) for table in tables)


def test_entry_levels_are_those_asked_for(model: Gaussian) -> None:
    flown = sample(model, 40, entry_fl=[250, 300]).trajectories
    assert set(flown.levels_fl[flown.entry].tolist()) == {250.0, 300.0}
    refuses(ConfigError, "entry_fl 500", sample, model, 5, entry_fl=500)
    refuses(ConfigError, "n = 0", sample, model, 0)


def test_contexts_are_values_a_table_or_a_path(conditional: Gaussian, tmp_path: Path) -> None:
    one = sample(conditional, 4, context={"entry_fl": 300, "hour": "12"})
    assert one.to_polars()["given_entry_fl"].unique().to_list() == [300.0]
    assert one.to_xarray()["given_hour"].values.tolist() == [12.0] * 4
    rows = pl.DataFrame({"entry_fl": [260.0, 340.0], "hour": [3.0, 18.0], "remark": ["a", "b"]})
    rows.write_csv(tmp_path / "rows.csv")
    table, path = (sample(conditional, 5, seed=2, context=c) for c in (rows, tmp_path / "rows.csv"))
    assert table.to_polars().equals(path.to_polars())
    assert path.trajectories.levels_fl[path.trajectories.entry].tolist() == [260, 340, 260, 340, 260]
    for wrong, message in (
        (None, "without a context"),
        (rows.head(0), "without a row"),
        ({"entry_fl": 300}, "no value for the context hour"),
    ):
        refuses((ConfigError, DataError), message, sample, conditional, 5, context=wrong)
    refuses(ConfigError, "next to a context that holds entry_fl", sample, conditional, 5, context=rows, entry_fl=300)


def test_evaluation_leaves_out_what_the_model_has_seen(model: Gaussian, descents: Path, tmp_path: Path) -> None:
    found = evaluate(model, descents, n=200, n_splits=2)
    split = model.representation.split
    assert len(found.real) == len(split.test)
    assert found.n_seen == len(split.train) + len(split.validation)
    assert f"{len(split.test)} held-out flights ({found.n_seen} left out" in str(found)
    in_memory = evaluate(model.density, read_descents(descents), n=200, n_splits=2)
    assert in_memory.to_polars().equals(found.to_polars())
    assert len(found.to_pandas()) == len(found.to_polars())
    found.write(tmp_path / "e", figures=False)
    assert sorted(path.name for path in (tmp_path / "e").iterdir()) == [
        "classifier.csv", "level_flight.csv", "rejections.json", "scores.csv"
    ]  # fmt: skip


def test_flights_of_another_type_are_told(model: Gaussian, descents: Path) -> None:
    source, words = read_descents(descents), "240 flights of B738, and the model was trained on A320"
    renamed = source.frame.with_columns(typecode=pl.lit("B738"), flight_id="b738-" + pl.col("flight_id"))
    others = Descents(renamed, source.metadata)
    with pytest.warns(DescentflowWarning, match=words):
        evaluate(model, others, n=100, n_splits=2)
    with pytest.warns(DescentflowWarning, match=words):
        predict(model, others, 290, n=60, flights=["b738-toy-0-00000"])


def test_flights_with_a_level_too_few_are_named(model: Gaussian, descents: Path) -> None:
    source = read_descents(descents)
    flight = model.representation.split.test[0]
    short = source.frame.filter((pl.col("flight_id") != flight) | (pl.col("level_fl") == 200))
    found = evaluate(model, Descents(short, source.metadata), n=50, n_splits=1)
    assert "left out 1 flight(s) with fewer than two levels on the grid" in str(found)


def test_nothing_unseen_to_score(model: Gaussian, descents: Path) -> None:
    source = read_descents(descents)
    seen = source.frame.filter(pl.col("flight_id").is_in(model.representation.split.train))
    refuses(DataError, "no flight to score against", evaluate, model, Descents(seen, source.metadata), n=50)


def test_predictions_of_unseen_flights(model: Gaussian, descents: Path, tmp_path: Path) -> None:
    told: list[int] = []
    ahead = predict(model, descents, from_fl=250, n=60, progress=told.append, total=told.append)
    assert told == [len(model.representation.split.test), *[1] * len(model.representation.split.test)]
    assert set(ahead.to_polars()["flight_id"]) <= set(model.representation.split.test)
    assert len(ahead) + len(ahead.reasons) == len(model.representation.split.test)
    assert ahead.calibration.startswith("times calibrated on")
    assert ahead.coverage()["covered"].is_between(0, 1).all()
    dataset = ahead.to_xarray()
    assert dataset["q50_s"].attrs["units"] == "s"
    assert len(ahead.to_pandas()) == len(ahead.to_polars())
    ahead.write(tmp_path / "p.parquet")
    assert pl.read_parquet(tmp_path / "p.parquet").equals(ahead.to_polars())
    one = predict(model, descents, from_fl=250, n=60, flights=[ahead.flights[3].flight_id])
    assert one.to_polars().equals(ahead.to_polars().filter(flight_id=ahead.flights[3].flight_id))


def test_predictions_refuse_what_cannot_be(model: Gaussian, descents: Path) -> None:
    refuses(ConfigError, "flight nobody", predict, model, descents, from_fl=290, flights=["nobody"])
    refuses(ConfigError, "49 continuations", predict, model, descents, from_fl=290, n=49)
    highest = pl.read_parquet(descents).group_by("flight_id").agg(pl.col("level_fl").max())
    below = highest.filter(pl.col("level_fl") < 369, pl.col("flight_id").is_in(model.representation.split.test))
    with pytest.raises(DataError, match="can be predicted"):
        predict(model, descents, from_fl=369, n=60, flights=[below["flight_id"].min()])
