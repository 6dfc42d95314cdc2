"""Prepared descents that contradict themselves are refused or named; several files are one set."""

import json
import warnings
from pathlib import Path

import polars as pl
import pytest
from surveillance_toys import fleet

from descentflow.core.errors import DataError, DescentflowWarning
from descentflow.simulation.world import simulate
from descentflow.surveillance.descents.prepared_descents import join_descents, read_descents
from descentflow.surveillance.descents.store import KEY
from descentflow.surveillance.open_descents import FlightSource
from descentflow.surveillance.prepare import prepare
from descentflow.surveillance.rows.drop_report import DropReport, Step

ODD = pl.col("flight_id").str.slice(-1).cast(pl.Int64) % 2 == 1
REFUSED = {
    "constant rates": (pl.lit(-1.0).alias("vertical_rate"), "vertical_rate is -1 in all of"),
    "rates in m/s": (pl.col("vertical_rate") * 0.00508, "vertical_rate seems to be in m/s"),
    "sink rates": (-pl.col("vertical_rate"), "sign of a sink rate"),
    "times halved": (pl.col("time_s") / 2, "vertical_rate seems to be halved"),
    "IAS in m/s": (pl.col("IAS") * 0.514444, "IAS seems to be in m/s"),
    "a year that no date has": (
        pl.from_epoch(pl.lit(-7 * 10**18), time_unit="us").dt.replace_time_zone("UTC").alias("timestamp"),
        "column timestamp holds .* values outside 0 to 1e",
    ),
}
NAMED = {
    "half of the rates in m/s": (
        pl.when(ODD).then(pl.col("vertical_rate") * 0.00508).otherwise("vertical_rate").alias("vertical_rate"),
        r"in \d+ flights .* vertical_rate seems to be in m/s",
    ),
    "rates of no unit": (pl.col("vertical_rate") * 0.0005, "vertical_rate contradicts the other columns"),
}


@pytest.fixture(scope="module")
def descents(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("descents") / "descents.parquet"
    prepare(simulate("A320", 30, seed=2).rows, out=path)
    return path


def changed(descents: Path, change: pl.Expr, path: Path) -> Path:
    about = json.loads(pl.read_parquet_metadata(descents)[KEY])
    pl.read_parquet(descents).with_columns(change).write_parquet(path, metadata={KEY: json.dumps(about)})
    return path


@pytest.mark.parametrize("kind", REFUSED)
def test_columns_that_contradict_each_other_are_refused(kind: str, descents: Path, tmp_path: Path) -> None:
    change, words = REFUSED[kind]
    path = changed(descents, change, tmp_path / "d.parquet")
    with pytest.raises(DataError, match=f"{words}.*that `descentflow prepare` wrote"):
        read_descents(path)
    with pytest.raises(DataError, match=words):
        FlightSource(pl.read_parquet(path)).descents()


@pytest.mark.parametrize("kind", NAMED)
def test_flights_that_contradict_others_are_named(kind: str, descents: Path, tmp_path: Path) -> None:
    change, words = NAMED[kind]
    with pytest.warns(DescentflowWarning, match=words):
        read_descents(changed(descents, change, tmp_path / "d.parquet"))


def test_whole_descents_pass_in_silence(descents: Path) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        read_descents(descents)


def test_files_prepared_with_and_without_a_type_are_joined() -> None:
    rows = fleet(4).with_columns(typecode=pl.lit("A320"))
    others = rows.with_columns(icao24=pl.col("icao24").str.replace("4ca", "fff"))
    both = [prepare(rows, typecode="A320"), prepare(others)]
    for parts in (both, both[::-1]):
        joined = join_descents(parts, ["one", "two"])
        assert sum(joined.flights.values()) == sum(sum(part.flights.values()) for part in parts)
        steps = {step.step: step for step in joined.report.steps}
        assert steps["read"].rows_left == len(rows) + len(others)
        assert steps["other_type"].rows_dropped == 0
        assert steps["other_type"].rows_left == steps["missing_value"].rows_left + steps["missing_value"].rows_dropped


def test_a_step_that_a_part_lacks_keeps_its_place_and_its_rows() -> None:
    alone = DropReport([Step("read", 1, None, 9, None), Step("twice", 2, 1, 7, 2), Step("late", 3, 1, 4, 1)])
    other = DropReport([Step("read", 0, None, 5, None), Step("late", 1, 0, 4, 3)])
    for parts in ([alone, other], [other, alone]):
        joined = DropReport()
        joined.extend(parts)
        assert joined.steps == [
            Step("read", 1, None, 14, None), Step("twice", 2, 1, 12, 2), Step("late", 4, 1, 8, 4)
        ]  # fmt: skip


def test_descents_into_a_jet_stream_are_read(descents: Path, tmp_path: Path) -> None:
    """Five real B738 over Japan flew at 0.68 to 0.94 of their TAS."""
    path = changed(descents, (pl.col("TAS") * 0.68).alias("groundspeed"), tmp_path / "d.parquet")
    with warnings.catch_warnings():
        warnings.simplefilter("error", DescentflowWarning)
        assert read_descents(path).frame["groundspeed"].mean() == pytest.approx(
            0.68 * read_descents(descents).frame["TAS"].mean()
        )
