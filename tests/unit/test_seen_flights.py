"""Flights that a model has seen are known by aircraft and time: under other names, spellings and cuts too."""

from pathlib import Path

import polars as pl
import pytest
import surveillance_toys
import torch
import toys

from descentflow.core.errors import CheckpointError
from descentflow.densities.checkpoint import content_of, load_model
from descentflow.evaluation.evaluate import evaluate
from descentflow.generation.prediction.predict import predict
from descentflow.representation.encode_flights import split_by_model
from descentflow.representation.seen_flights import SeenFlights
from descentflow.surveillance.descents.prepared_descents import Descents, read_descents
from descentflow.surveillance.prepare import prepare
from descentflow.training.datamodule import DescentDataModule
from descentflow.training.models import Gaussian


@pytest.fixture(scope="module")
def descents(tmp_path_factory: pytest.TempPathFactory) -> Descents:
    """Flights whose aircraft fly once an hour."""
    path = toys.write_descents_file(tmp_path_factory.mktemp("seen") / "descents.parquet", 120, seed=3)
    source = read_descents(path)
    hours = pl.duration(hours=pl.col("flight_id").rank("dense").cast(pl.Int64))
    return Descents(source.frame.with_columns(pl.col("timestamp") + hours), source.metadata)


@pytest.fixture(scope="module")
def model(descents: Descents) -> Gaussian:
    data = DescentDataModule(descents)
    data.setup()
    return toys.fit(Gaussian(), data, 1)


def renamed(source: Descents, **columns: pl.Expr) -> Descents:
    """The same flights in another order of names."""
    names = pl.lit("x") + (1000 - pl.col("flight_id").rank("dense").cast(pl.Int64)).cast(pl.String)
    return Descents(source.frame.with_columns(names.alias("flight_id"), **columns), source.metadata)


@pytest.mark.parametrize(
    "change",
    [
        {},
        {"icao24": pl.lit("0x") + pl.col("icao24").str.to_uppercase()},
        {"timestamp": pl.col("timestamp").dt.truncate("1s")},
        {"timestamp": pl.col("timestamp") + pl.duration(seconds=2)},
    ],
)
def test_evaluation_leaves_out_what_the_model_saw_under_other_names(
    change: dict, model: Gaussian, descents: Descents
) -> None:
    split = model.representation.split
    evaluation = evaluate(model, renamed(descents, **change), n=60, n_splits=1)
    assert evaluation.n_seen == len(split.train) + len(split.validation)
    assert len(evaluation.real) == len(split.test)


def test_predictions_are_of_unseen_flights_under_other_names(model: Gaussian, descents: Descents) -> None:
    ahead = predict(model, renamed(descents), from_fl=250, n=60)
    assert len(ahead) + len(ahead.reasons) == len(model.representation.split.test)
    assert ahead.calibration.startswith("times calibrated on")
    assert f"{120 - len(model.representation.split.test)} left out: the checkpoint was trained" in str(ahead)


def test_parts_of_descents_are_known_and_other_descents_are_not(model: Gaussian, descents: Descents) -> None:
    names, split = (lambda d: d.frame["flight_id"].unique().to_list()), model.representation.split
    lower = renamed(Descents(descents.frame.filter(pl.col("level_fl") < 250), descents.metadata))
    assert len(split_by_model(lower.frame, names(lower), model.representation).train) == len(split.train)
    for other in (
        {"timestamp": pl.col("timestamp") + pl.duration(seconds=20)},
        {"icao24": pl.lit("f") + pl.col("icao24").str.slice(1)},
        # A simulator that flies the same traffic again, each flight from the same start.
        {"timestamp": pl.col("timestamp") + pl.duration(microseconds=(pl.col("time_s") * 4e4).cast(pl.Int64))},
    ):
        others = renamed(descents, **other)
        assert len(split_by_model(others.frame, names(others), model.representation).test) == 120


def test_rows_with_and_without_names_are_the_same_flights(tmp_path: Path) -> None:
    rows = surveillance_toys.fleet(3).with_columns(flight_id="AB" + pl.col("icao24"))
    named = prepare(surveillance_toys.written(rows, tmp_path / "named.parquet")).frame
    unnamed = prepare(surveillance_toys.written(rows.drop("flight_id"), tmp_path / "unnamed.parquet")).frame
    flights = named["flight_id"].unique().to_list()
    assert not set(flights) & set(unnamed["flight_id"])
    seen = SeenFlights.of(named, flights[:2], flights[2:]).among(unnamed)
    assert sorted(seen.values()) == ["train", "train", "validation"]


def test_flights_without_an_address_are_not_recognised(descents: Descents) -> None:
    nobody = descents.frame.with_columns(icao24=pl.lit(None, pl.String))
    flights = nobody["flight_id"].unique().to_list()
    kept = SeenFlights.of(nobody, flights, [])
    assert len(kept) == 0
    assert kept.among(descents.frame) == {}
    assert SeenFlights.of(descents.frame, flights, []).among(nobody) == {}


@pytest.mark.parametrize(
    "change",
    [
        {"address": None},
        {"address": torch.zeros(3)},
        {"part": torch.full((96,), 7)},
        {"time_s": torch.full((96, 5), torch.nan, dtype=torch.float64)},
        {"level_fl": torch.zeros(4, 5, dtype=torch.int64)},
        {"level_fl": torch.tensor(3)},
    ],
)
def test_changed_ones_are_refused(change: dict, model: Gaussian, tmp_path: Path) -> None:
    content = content_of(model.density)
    content["descentflow"]["representation"]["seen_flights"].update(change)
    torch.save(content, tmp_path / "broken.ckpt")
    with pytest.raises(CheckpointError, match=r"broken.ckpt.*seen"):
        load_model(tmp_path / "broken.ckpt")
