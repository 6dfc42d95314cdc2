"""Contexts as numbers: encoding, rare and missing values, and the columns that a DataModule reads."""

from pathlib import Path

import numpy as np
import polars as pl
import pytest
import torch
import toys
from refusals import refuses

from descentflow.core.errors import ConfigError, DataError
from descentflow.generation.sample_contexts import context_rows
from descentflow.representation.context import OTHER, ContextEncoder
from descentflow.representation.context_columns import flight_context, read_context_table
from descentflow.training.datamodule import DescentDataModule

D, C = 3, 2


def flights_table(n: int = 60) -> pl.DataFrame:
    operators = (["AAA"] * 30 + ["BBB"] * 20 + ["CCC"] * 10)[:n]
    return pl.DataFrame({"deviation_k": np.arange(n) * 1.0, "operator": operators, "hour": (np.arange(n) % 24) * 1.0})


def test_encoder_standardises_and_encodes() -> None:
    frame = flights_table()
    encoder = ContextEncoder.fit(frame, ["deviation_k", "operator", "hour"])
    numbers = encoder.encode(frame)
    assert numbers.shape == (60, 5)
    assert float(numbers[:, 0].mean()) == pytest.approx(0, abs=1e-12)
    assert float(numbers[:, 0].std()) == pytest.approx(1)
    assert numbers[:30, 1:3].abs().sum() == 0, "the most frequent is the origin"
    torch.testing.assert_close(numbers[:, 3:].norm(dim=1), torch.ones(60, dtype=torch.float64))
    again = ContextEncoder.from_state(encoder.to_state())
    assert torch.equal(again.encode(frame), numbers)


def test_rare_and_unseen_categories_are_the_others() -> None:
    frame = flights_table().with_columns(operator=pl.col("operator").replace({"CCC": "BBB"}))
    rare = frame.with_columns(operator=pl.when(pl.col("deviation_k") < 3).then(pl.lit("ZZZ")).otherwise("operator"))
    encoder = ContextEncoder.fit(rare, ["operator"])
    assert encoder.columns[0].values == ("BBB", "AAA", OTHER)
    assert torch.equal(encoder.encode_one({"operator": "NEW"}), encoder.encode_one({"operator": "ZZZ"}))
    refuses(ConfigError, "operator = 'NEW'", ContextEncoder.fit(frame, ["operator"]).encode_one, {"operator": "NEW"})


def test_missing_values_have_their_indicator_or_are_refused() -> None:
    frame = flights_table().with_columns(
        deviation_k=pl.when(pl.col("deviation_k") > 50).then(None).otherwise("deviation_k")
    )
    with_indicator = ContextEncoder.fit(frame, ["deviation_k", "operator"], "indicator")
    numbers = with_indicator.encode(frame)
    assert numbers[-1].tolist()[:2] == [0.0, 1.0]
    assert numbers[0, 1] == 0
    without = ContextEncoder.fit(frame, ["deviation_k", "operator"])
    assert int(without.lacking(frame)["deviation_k"].sum()) == 9
    refuses(ConfigError, "deviation_k = None", without.encode, frame)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"wind": "3"}, "context wind"),
        ({"deviation_k": "3"}, "no value for the context operator"),
        ({"deviation_k": "warm", "operator": "AAA"}, "deviation_k = 'warm'"),
        ({"deviation_k": "3", "operator": "QQQ"}, "one of AAA, BBB, CCC"),
    ],
)
def test_a_context_that_cannot_be_says_what_could(values: dict[str, str], message: str) -> None:
    encoder = ContextEncoder.fit(flights_table(), ["deviation_k", "operator"])
    refuses(ConfigError, message, encoder.encode_one, values)


def test_a_context_that_no_training_flight_was_near_is_refused_at_once() -> None:
    encoder = ContextEncoder.fit(flights_table(), ["deviation_k", "operator", "hour"])
    near = {"deviation_k": "59", "operator": "AAA", "hour": 23.5}
    assert context_rows(near, encoder)["deviation_k"].to_list() == [59.0]
    with pytest.raises(ConfigError, match=r"deviation_k = 59.1; expected 0 to 59, as the training flights had"):
        context_rows({**near, "deviation_k": "59.1"}, encoder)
    for several in ([59.0, 58.0], torch.tensor([59.0, 58.0]), np.array([59.0]), (59.0,)):
        with pytest.raises(ConfigError, match=r"one value of each name, for all descents; .* a row for each descent"):
            context_rows({**near, "deviation_k": several}, encoder)
    table = pl.DataFrame([near, {**near, "deviation_k": "-1"}, {**near, "deviation_k": "-2"}])
    refuses(ConfigError, r"deviation_k = -1 \(and 1 more\)", context_rows, table, encoder)
    for hour, told in ((25, "hour = 25.0"), ("-1", "hour = -1.0")):
        with pytest.raises(ConfigError, match=rf"{told}; expected an hour of the day \(UTC\), 0 to 24"):
            context_rows({**near, "hour": hour}, encoder)
    assert context_rows({**near, "hour": "24"}, encoder)["hour"].to_list() == [24.0]
    # Held-out flights beyond the training flights are still scored.
    assert encoder.encode(table).shape == (3, encoder.width)
    assert ContextEncoder.from_state(encoder.to_state()).columns == encoder.columns
    old = [{k: v for k, v in column.items() if k not in ("low", "high")} for column in encoder.to_state()]
    assert context_rows({**near, "deviation_k": "99"}, ContextEncoder.from_state(old)) is not None
    half = [{**column, "low": None} for column in encoder.to_state()]
    refuses(TypeError, "the context column", ContextEncoder.from_state, half)


@pytest.mark.parametrize("word", ["N/A", "NA", "-", "", " ", "null", "nan"])
def test_numbers_among_words_for_none_stay_numbers(word: str) -> None:
    frame = pl.DataFrame({"wind": ["0.5", "1.5", "2.5", word] * 10})
    encoder = ContextEncoder.fit(frame, ["wind"])
    assert (encoder.columns[0].kind, encoder.columns[0].high) == ("number", 2.5)
    assert int(encoder.lacking(frame)["wind"].sum()) == 10


def test_a_column_of_numbers_and_a_few_words_is_refused() -> None:
    frame = pl.DataFrame({"wind": ["0.5", "1.5", "2.5", "calm"] * 10})
    refuses(DataError, "30 numbers, and 'calm'", ContextEncoder.fit, frame, ["wind"])


def test_columns_that_tell_nothing_are_refused() -> None:
    frame = flights_table().with_columns(same=pl.lit(3.0), one=pl.lit("x"), hour=pl.lit(70.0))
    for name in ("same", "one", "hour"):
        refuses(DataError, name, ContextEncoder.fit, frame, [name])


@pytest.fixture
def descents(tmp_path: Path) -> Path:
    return toys.write_descents_file(tmp_path / "d.parquet", 120)


def context_file(descents: Path, folder: Path, *, lacking: int = 0) -> Path:
    flights = pl.read_parquet(descents)["flight_id"].unique().sort().to_list()
    operators = [("AAA", "BBB", "CCC")[i % 3] for i in range(len(flights))]
    values = [None if i < lacking else float(i % 17) for i in range(len(flights))]
    frame = pl.DataFrame({"flight_id": flights, "deviation_k": values, "operator": operators})
    frame.write_csv(folder / "context.csv")
    return folder / "context.csv"


def test_datamodule_serves_contexts_beside_weights(descents: Path, tmp_path: Path) -> None:
    names = ["deviation_k", "operator", "entry_fl", "hour"]
    table = context_file(descents, tmp_path, lacking=7)
    data = DescentDataModule(descents, context=names, context_table=table)
    data.setup()
    plain = DescentDataModule(descents)
    plain.setup()
    assert plain.contexts("train").shape[1] == 0
    assert sum(len(data.profiles(part)) for part in ("train", "validation", "test")) == 113
    evidence, context = next(iter(data.train_dataloader()))
    assert context.shape == (len(evidence), 6)
    train = data.contexts("train")
    assert float(train[:, 0].mean()) == pytest.approx(0, abs=1e-9), "fitted on training flights"
    kept = DescentDataModule(descents, context=["deviation_k"], context_table=table, missing_context="indicator")
    kept.setup()
    assert sum(len(kept.profiles(part)) for part in ("train", "validation", "test")) == 120
    for part in ("train", "test"):
        assert torch.equal(kept.weights(part), plain.weights(part)), "the same flights, the same weights"


def test_context_columns_come_from_table_descents_or_are_derived(descents: Path, tmp_path: Path) -> None:
    frame = pl.read_parquet(descents).with_columns(callsign=pl.lit("KLM123 "))
    found = flight_context(frame, ["operator", "entry_fl", "hour", "icao24"])
    assert found["operator"].unique().to_list() == ["KLM"]
    assert found["entry_fl"].max() == frame["level_fl"].max()
    assert found["hour"].min() >= 0
    table = read_context_table(context_file(descents, tmp_path))
    assert set(flight_context(frame, ["operator"], table)["operator"]) == {"AAA", "BBB", "CCC"}
    with pytest.raises(ConfigError, match="for a density without context"):
        DescentDataModule(descents, context_table=tmp_path / "context.csv").setup()
    refuses(ConfigError, r"context wind_mps.*entry_fl", flight_context, frame, ["wind_mps"])
    frame.select("IAS").write_csv(tmp_path / "bad.csv")
    refuses(DataError, "flight_id", read_context_table, tmp_path / "bad.csv")
