"""Airspeeds of plain ADS-B by the wind and temperature that other aircraft report."""

from pathlib import Path

import numpy as np
import polars as pl
import pytest
from ground_toys import plain, truth
from surveillance_toys import written

from descentflow.core.constants import KAPPA, R_AIR
from descentflow.core.errors import DataError
from descentflow.core.units import KT_MPS
from descentflow.surveillance.cleaning._neighbour_air import NeighbourAir, observations
from descentflow.surveillance.out_of_core.spill import Memory
from descentflow.surveillance.prepare import prepare

SILENT = ("4ca001", "4ca004")
NAMES = ("IAS", "Mach", "TAS")


@pytest.fixture(scope="module")
def flown() -> pl.DataFrame:
    """Nine aircraft, five minutes apart, on as many courses in a wind of some 40 kt."""
    rows = truth(9)
    number = pl.col("icao24").str.slice(-1).cast(pl.Int64)
    rows = rows.with_columns(pl.col("timestamp") - number * pl.duration(minutes=55))
    tas = rows["Mach"] * (KAPPA * R_AIR * rows["temperature"]).sqrt() / KT_MPS
    return plain(rows).with_columns(IAS=rows["IAS"], Mach=rows["Mach"], TAS=tas)


def mixed(flown: pl.DataFrame) -> pl.DataFrame:
    silent = pl.col("icao24").is_in(SILENT)
    return flown.with_columns(pl.when(~silent).then(name).alias(name) for name in NAMES)


def test_airspeeds_by_neighbours_are_those_flown(flown: pl.DataFrame) -> None:
    prepared = prepare(mixed(flown), airspeeds_from="neighbours")
    both = prepared.frame.join(prepare(flown).frame, on=["icao24", "level_fl"], suffix="_flown")
    made = both.filter(pl.col("icao24").is_in(SILENT))
    assert made["airspeed_source"].unique().to_list() == ["neighbours"]
    assert made["icao24"].n_unique() == len(SILENT)
    assert float((made["IAS"] - made["IAS_flown"]).abs().max()) < 3.0
    assert float((made["Mach"] - made["Mach_flown"]).abs().max()) < 0.01
    others = both.filter(~pl.col("icao24").is_in(SILENT))
    assert others["airspeed_source"].unique().to_list() == ["reported"]
    assert np.allclose(others["IAS"], others["IAS_flown"])
    assert float((others["derived_IAS"] - others["IAS"]).abs().max()) < 3.0
    note, rows = next((note, rows) for note, rows in prepared.report.notes.items() if note.startswith("reported airsp"))
    assert "kt in the median" in note
    assert 0.6 < rows / len(flown.filter(~pl.col("icao24").is_in(SILENT))) <= 1


def test_an_aircrafts_own_reports_say_nothing_of_it(flown: pl.DataFrame) -> None:
    """One whose TAS is 6 kt too high changes what others get, and hardly what it gets itself."""
    faulty = pl.col("icao24") == "4ca002"
    wrong = flown.with_columns(pl.when(faulty).then(pl.col("TAS") + 6).otherwise("TAS").alias("TAS"))
    places = observations(flown)
    (before, *_), (after, *_) = (NeighbourAir(observations(rows)).at(places) for rows in (flown, wrong))
    change, own = np.abs(after - before), (places["aircraft"] == "4ca002").to_numpy()
    assert np.isfinite(change[own]).mean() > 0.8
    assert np.nanmax(change[own]) < 0.2
    assert np.nanmax(change[~own]) > 0.4


def test_what_is_far_from_all_neighbours_is_left_out(flown: pl.DataFrame) -> None:
    late = pl.when(pl.col("icao24") == SILENT[0]).then(pl.duration(hours=8)).otherwise(pl.duration())
    prepared = prepare(mixed(flown).with_columns(pl.col("timestamp") + late), airspeeds_from="neighbours")
    left_out = next(step for step in prepared.report.steps if step.step == "outside_field_place")
    assert left_out.rows_dropped == len(flown.filter(pl.col("icao24") == SILENT[0]))


def test_rows_in_which_nobody_reports_are_refused(flown: pl.DataFrame) -> None:
    with pytest.raises(DataError, match="no row that reports them"):
        prepare(flown.drop(NAMES), airspeeds_from="neighbours")


def test_neighbours_in_other_partitions_count(flown: pl.DataFrame, tmp_path: Path) -> None:
    path, out, tight = written(mixed(flown), tmp_path / "rows.parquet"), tmp_path / "descents.parquet", 400_000
    assert Memory(tight).rows_bytes < flown.estimated_size()
    prepare(path, airspeeds_from="neighbours", out=out, memory_bytes=tight)
    partitioned, whole = pl.read_parquet(out), prepare(path, airspeeds_from="neighbours").frame
    names = ["icao24", "level_fl", "airspeed_source"]
    assert partitioned.select(names).equals(whole.select(names))
    assert np.allclose(partitioned["IAS"], whole["IAS"], atol=0.01)
