"""Descents flown in a weather field along a path: the air of where they are, and where that air lets them be."""

from pathlib import Path

import numpy as np
import pytest
import torch

pytest.importorskip("xarray", reason="xarray is an extra of descentflow (wind)")

from position_toys import steady_descents
from toys import AIRCRAFT
from weather_toys import weather, written

import descentflow as df
from descentflow.air.level_air import LevelAir
from descentflow.core.errors import ConfigError, DataError, DescentflowWarning
from descentflow.core.units import KT_MPS
from descentflow.generation._air_along_path import TURNS, AirAlongPath
from descentflow.positions.ground_plan import ground_plan
from descentflow.positions.placing import place
from descentflow.positions.wind import read_wind_field
from descentflow.representation.decoder.trajectories import Trajectories
from descentflow.representation.own_air import flown_in
from descentflow.training.datamodule import DescentDataModule
from descentflow.weather.weather_field import weather_field

PLAN = {"end": (51.0, 5.0), "track": 250.0, "to_go_nm": 30.0}
NOON = "2024-03-05T12:00:00"


@pytest.fixture(scope="module")
def checkpoint(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("along") / "standard.ckpt"
    descents = df.prepare(df.simulate("A320", 60, seed=2).rows, typecode="A320")
    df.fit(DescentDataModule(descents), model="gaussian", out=path, final=False)
    return path


def test_in_a_field_that_is_the_same_everywhere_it_is_one_air(checkpoint: Path, tmp_path: Path) -> None:
    path = written(weather(lambda *_: 12.0, lambda h, *_: (0 * h, 0 * h)), tmp_path / "era5.nc")
    asked = {"seed": 3}
    along = df.sample(checkpoint, 30, air=path, plan=ground_plan(**PLAN, end_time=NOON), **asked)
    uniform = df.sample(checkpoint, 30, air={"deviation_k": 12.0}, **asked)
    assert along.air is not None
    np.testing.assert_allclose(along.air.deviation_k, 12.0, atol=1e-9)
    torch.testing.assert_close(along.weights, uniform.weights)
    on = along.trajectories.mask
    torch.testing.assert_close(along.trajectories.time_s[on], uniform.trajectories.time_s[on], rtol=1e-9, atol=1e-9)
    frame = along.to_polars()
    assert {"latitude", "longitude", "timestamp", "deviation_k", "groundspeed"} < set(frame.columns)
    with pytest.raises(ConfigError, match="another path"):
        along.placed(end=(52.0, 4.0), track=90.0)


def front(_h: object, level: object, _p: object, longitude: object) -> object:
    """5 K in 100 km, from west to east, and 1 K for each 1,000 ft."""
    return 10 * np.tanh((longitude - 6.0) / 2.8) + 0.1 * (level - 250)


def winds(hours: object, level: object, latitude: object, longitude: object) -> tuple[object, object]:
    return 25 + 0.1 * (level - 250) + 2 * (longitude - 6), -10 + 0.3 * (latitude - 50) + 0.2 * hours


def test_the_air_is_that_of_the_place_where_it_lets_descents_be(tmp_path: Path) -> None:
    path = written(weather(front, winds, longitude=np.arange(-8.0, 18.1, 0.25)), tmp_path / "era5.nc")
    standard = descents()
    plan = ground_plan(**PLAN, end_time=NOON)
    with weather_field(path) as field:
        along = AirAlongPath(field, plan)
        along_it, further = along.flown(AIRCRAFT, standard), along.flown(AIRCRAFT, standard, turns=TURNS + 3)
    # Independently: descents in that air, laid along the path by Heun's method in the winds of the same file.
    again = flown_in(AIRCRAFT, standard, along_it.air)
    torch.testing.assert_close(again.time_s, along_it.flown.time_s)
    placed = place(again, plan.path, read_wind_field(path), to_go_m=30 * 1852.0, end_time=plan.end_time)
    np.testing.assert_allclose(along_it.positions.to_go_m, placed.to_go_m, atol=2.0)
    on = standard.mask.numpy()
    np.testing.assert_allclose(along_it.positions.groundspeed_mps[on], placed.groundspeed_mps[on], atol=0.01)
    # A place errs by 2 m, where the front has 5e-5 K in a metre; linear between meridians 17 km apart it errs by more.
    assert along_it.positions.longitude is not None
    expected = front(0, np.arange(150.0, 351.0), 0, along_it.positions.longitude)
    assert np.abs(along_it.air.deviation_k.numpy() - expected).max() < 0.15
    assert np.abs(along_it.positions.to_go_m - further.positions.to_go_m).max() < 0.01
    assert np.ptp(along_it.air.deviation_k[0].numpy()) > 5


def descents() -> Trajectories:
    """Descents from FL350 and FL300 that a drag explains."""
    flown = steady_descents([210.0, 225.0])
    cas = torch.full_like(flown.cas_mps, 140.0)
    drag = torch.full_like(cas, 38_000.0)
    return Trajectories(
        flown.levels_fl, torch.tensor([200, 150]), flown.time_s - torch.tensor([[0.0], [152.4]]), cas, flown.mach,
        flown.tas_mps, flown.rate_mps, drag,
    )  # fmt: skip


def test_what_the_field_does_not_hold_or_the_plan_does_not_say(checkpoint: Path, tmp_path: Path) -> None:
    path = written(weather(front, winds), tmp_path / "era5.nc")
    with pytest.raises(ConfigError, match="without a path"):
        df.sample(checkpoint, 3, air=path)
    with pytest.raises(ConfigError, match="no time of the descents"):
        df.sample(checkpoint, 3, air=path, plan=ground_plan(**PLAN))
    with pytest.raises(ConfigError, match="a wind next to a weather field"):
        df.sample(checkpoint, 3, air=path, plan=ground_plan(**PLAN, wind="270/30", end_time=NOON))
    with pytest.raises(DataError, match=r"outside of the weather field: 2024-06-.*expected 2024-03-03"):
        df.sample(checkpoint, 3, air=path, plan=ground_plan(**PLAN, end_time="2024-06-05T12:00:00"))
    with pytest.raises(DataError, match="outside of the weather field"):
        df.sample(checkpoint, 3, air=path, plan=ground_plan(end=(30.0, 5.0), track=90.0, end_time=NOON))
    windless = written(weather(front).isel(valid_time=[4]), tmp_path / "one.nc")
    with pytest.warns(DescentflowWarning, match="has no wind"):
        samples = df.sample(checkpoint, 3, air=windless, plan=ground_plan(**PLAN))
    assert "timestamp" not in samples.to_polars().columns


def test_the_command_line_flies_a_field_along_a_route(checkpoint: Path, tmp_path: Path) -> None:
    import polars as pl

    from descentflow.cli import main

    path = written(weather(front, winds), tmp_path / "era5.nc")
    out = tmp_path / "samples.parquet"
    words = ["sample", str(checkpoint), "-n", "20", "--air", str(path), "--out", str(out), "--time", NOON]
    assert main([*words, "--route", "52.5,7.5", "51.5,6", "51,5", "--to-go", "20"]) == 0
    frame = pl.read_parquet(out)
    assert frame["distance_to_go_nm"].min() == pytest.approx(20.0)
    low = frame.filter(pl.col("level_fl") == 150).row(0, named=True)
    fall = low["vertical_rate"] * 0.3048 / 60
    east, north = winds(60, 150, low["latitude"], low["longitude"])
    sine, cosine = np.sin(np.radians(low["track"])), np.cos(np.radians(low["track"]))
    level = np.sqrt((low["TAS"] * KT_MPS) ** 2 - fall**2 - (east * cosine - north * sine) ** 2)
    assert low["groundspeed"] * KT_MPS == pytest.approx(level + east * sine + north * cosine, abs=0.05)
    assert not isinstance(df.sample(checkpoint, 2).air, LevelAir)
