"""The checks of real data, on flights whose air is known."""

from pathlib import Path

import numpy as np
import polars as pl
import pytest

from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
from descentflow.simulation.world import World, simulate
from descentflow.simulation.world_config import WorldConfig
from descentflow.surveillance.prepare import prepare
from studies.blind_diagnosis.hypsometry import (
    hypsometric_deviation,
    speed_deviation,
)
from studies.blind_diagnosis.winds import tailwind_gradient, wind_profile

pytestmark = pytest.mark.usefixtures("worlds_once")


@pytest.fixture(scope="module")
def windy() -> World:
    config = WorldConfig(
        deviation_mean_k=15.0,
        deviation_spread_k=2.0,
        wind_slope_mean_per_s=0.002,
        low_top_share=0.0,
        step_s=2.0,
        interval_s=2,
    )
    return simulate(open_aircraft("A320"), 15, 3, config)


@pytest.fixture(scope="module")
def descents(windy: World, tmp_path_factory: pytest.TempPathFactory) -> pl.DataFrame:
    path = Path(tmp_path_factory.mktemp("rows")) / "rows.parquet"
    windy.rows.write_parquet(path)
    return prepare(path).frame


def test_heights_and_speeds_give_the_temperature_that_was_flown(windy: World, descents: pl.DataFrame) -> None:
    truth = dict(windy.flights.select("flight_id", "deviation_k").iter_rows())
    by_height, by_speed = hypsometric_deviation(descents), speed_deviation(descents)
    for found, tolerance in ((by_height, 0.6), (by_speed, 0.6)):
        errors = [k - truth[name] for name, k in found.by_flight.select("flight_id", "deviation_k").iter_rows()]
        assert len(errors) == 15
        assert np.abs(errors).max() < tolerance
        assert found.mean_k == pytest.approx(np.mean(list(truth.values())), abs=0.5)
        assert 0.1 < found.error_k < 2


def test_the_wind_of_others_gives_the_gradient_along_a_track(windy: World, descents: pl.DataFrame) -> None:
    # All winds of this world are tailwinds: rows of one track give the profile that this track flies in.
    track = windy.rows["track"][0]
    same = windy.rows.filter((pl.col("track") - track).abs() < 1)
    profile = wind_profile(same, declination_deg=0.0)
    found = tailwind_gradient(descents.filter((pl.col("track") - track).abs() < 1), profile)
    # A metre of geometric altitude is some 0.95 m of pressure altitude in air 15 K warmer.
    assert found.mean_per_s == pytest.approx(0.002 * 1.06, rel=0.06)
