"""A weather model's field beside formulas, scipy and xarray: the air of flights, and winds alone."""

from pathlib import Path

import numpy as np
import polars as pl
import pytest
import torch
from refusals import refuses

pytest.importorskip("xarray", reason="xarray is an extra of descentflow (wind)")

import xarray
from position_toys import steady_descents
from weather_toys import START, levels_fl, linear, linear_wind, some_points, weather, written

import descentflow as df
from descentflow.air.field_air import along_track, field_airs, paths_of_flights
from descentflow.air.level_air import LevelAir
from descentflow.air.measured_air import FlightAirs
from descentflow.cli import main
from descentflow.core.errors import ConfigError, DataError
from descentflow.core.units import FL_M
from descentflow.densities.checkpoint import load_model
from descentflow.diagnosis.sides.diagnosis_inputs import without_weather
from descentflow.measurements.level_channels import LevelGrid
from descentflow.positions.ground_plan import ground_plan
from descentflow.positions.wind import read_wind_field
from descentflow.representation.own_air import with_own_air
from descentflow.representation.profiles import profiles_from_frame
from descentflow.simulation.world_config import WorldConfig
from descentflow.surveillance.descents.prepared_descents import Descents, write_descents
from descentflow.training.datamodule import DescentDataModule
from descentflow.weather.weather_field import Points, weather_field

LEVELS = torch.arange(150, 341).double()
WARM = WorldConfig(deviation_mean_k=10.0)


def test_a_rough_field_is_interpolated_as_xarray_does(tmp_path: Path) -> None:
    data = weather(lambda h, *_: np.random.default_rng(0).normal(0, 5, h.shape))
    points, _ = some_points(160)
    with weather_field(written(data, tmp_path / "era5.nc")) as field:
        found = field.at(points)[0]
        assert not field.wind
    # Temperature on flight levels: below the tropopause a linear temperature is a linear deviation.
    by_level = data["t"].assign_coords(pressure_level=levels_fl()).sortby(["pressure_level", "latitude"])
    at = {name: xarray.DataArray(values, dims="point") for name, values in zip(
        ("pressure_level", "latitude", "longitude"), points[1:], strict=True)}  # fmt: skip
    time = (START + (points.unix_s - START.astype(float)).astype("timedelta64[s]")).astype("datetime64[ns]")
    there = by_level.interp(valid_time=xarray.DataArray(time, dims="point"), **at).to_numpy()
    below = points.level_fl < levels_fl()[3]
    assert below.sum() > 100
    standard = 288.15 - 0.0065 * points.level_fl * FL_M
    # xarray was given whole seconds.
    np.testing.assert_allclose((found + standard)[below], there[below], rtol=0, atol=5e-3)


def test_files_of_other_times_and_variables_are_one_field(tmp_path: Path) -> None:
    data = weather(linear, linear_wind)
    written(data[["t"]].isel(valid_time=slice(0, 14)), tmp_path / "b.nc")
    written(data[["t"]].isel(valid_time=slice(14, None)), tmp_path / "a.nc")
    written(data[["u", "v"]], tmp_path / "wind.nc")
    points, hours = some_points(160)
    with weather_field(tmp_path) as field:
        np.testing.assert_allclose(field.at(points)[0], linear(hours, *points[1:]), rtol=0, atol=1e-9)
        assert field.wind
    # Two days without a file are not interpolated across.
    (tmp_path / "a.nc").unlink()
    written(data[["t"]].isel(valid_time=slice(22, None)), tmp_path / "a.nc")
    with weather_field([tmp_path / "a.nc", tmp_path / "b.nc"]) as field:
        values = field.at(points)[0]
    np.testing.assert_array_equal(np.isnan(values), (hours > 13 * 6) & (hours < 22 * 6))


@pytest.mark.parametrize("west", [-10.0, 0.0, 170.0, 350.0])
def test_a_region_across_a_seam_and_the_globe(west: float, tmp_path: Path) -> None:
    def wave(_h: object, _l: object, _p: object, longitude: object) -> object:
        return 10 * np.cos(np.radians(longitude))

    region, globe = (np.arange(west, west + width, 2.0) for width in (22.0, 360.0))
    place = (west + np.array([3.0, 11.0, 19.0]) + 180) % 360 - 180
    points = Points(np.full(3, START.astype(float)), np.full(3, 250.0), np.full(3, 50.0), place)
    expected = [(wave(0, 0, 0, x - 1) + wave(0, 0, 0, x + 1)) / 2 for x in place]
    for name, longitude in (("region", region), ("globe", globe)):
        # Counted from 0 to 360, in ascending order, as a file that was merged is.
        path = written(weather(wave, longitude=np.sort(longitude % 360)), tmp_path / f"{name}.nc")
        with weather_field(path) as field:
            np.testing.assert_allclose(field.at(points)[0], expected, rtol=0, atol=1e-9)
            beyond = field.at(points._replace(longitude=np.full(3, west + 100)))
            assert np.isnan(beyond[0]).all() == (name == "region")


def test_a_turn_in_a_steady_wind_is_no_growth() -> None:
    east, north = np.full((1, 50), 30.0), np.full((1, 50), -10.0)
    turning = np.radians(np.linspace(0, 120, 50))[None]
    tailwind = along_track(east, north, turning)
    np.testing.assert_allclose(tailwind, (30 * np.sin(turning) - 10 * np.cos(turning)).mean(), rtol=1e-12)
    # A wind that grows along a turning track grows by its growth along it: exact where the track is straight.
    growing = np.linspace(0, 49, 50)[None]
    straight = along_track(growing, 0 * growing, np.full((1, 50), np.pi / 6))
    np.testing.assert_allclose(straight, growing / 2, rtol=1e-12)


def test_places_between_those_reported_and_across_the_date_line() -> None:
    levels = torch.arange(150.0, 161.0).double()
    time = (160 - levels)[None] * 10
    longitude = torch.full((1, 11), torch.nan).double()
    longitude[0, 2], longitude[0, 8] = -179.0, 179.0
    values = {"latitude": torch.full((1, 11), 50.0).double(), "longitude": longitude}
    grid = LevelGrid(levels, time, values, torch.zeros(1), ("one",))
    paths = paths_of_flights(grid, time.numpy())
    np.testing.assert_allclose(paths.longitude[0, 2:9] % 360, np.linspace(181, 179, 7))
    assert paths.known[0].tolist() == [2 <= level <= 8 for level in range(11)]
    np.testing.assert_allclose(np.degrees(paths.track[0, 3:8]), 90, err_msg="eastbound, as its places follow")


@pytest.fixture(scope="module")
def descents() -> Descents:
    return df.prepare(df.simulate("A320", 80, seed=6, scenario=WARM).rows, typecode="A320")


@pytest.fixture(scope="module")
def warm_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("weather") / "era5.nc"
    return written(weather(lambda *_: 10.0, lambda h, *_: (0 * h, 0 * h)), path)


@pytest.fixture(scope="module")
def airs(descents: Descents, warm_file: Path) -> FlightAirs:
    return field_airs(descents.frame, LEVELS, warm_file)


def test_drag_in_the_field_is_that_of_the_air_it_holds(descents: Descents, airs: FlightAirs) -> None:
    a320 = df.aircraft("A320")
    profiles = profiles_from_frame(descents.frame, a320, 150, 340)
    in_air = with_own_air(profiles, a320, airs, print)
    assert in_air.flight_ids == profiles.flight_ids
    assert airs.wind
    uniform = LevelAir.uniform(LEVELS, 10.0).rows([0] * len(profiles))
    given = FlightAirs(profiles.flight_ids, uniform, profiles.mask, *[profiles.drag_n] * 3, 0)
    expected = with_own_air(profiles, a320, given, print)
    torch.testing.assert_close(in_air.drag_n[in_air.mask], expected.drag_n[in_air.mask], rtol=1e-9, atol=0)
    assert int(in_air.mask.sum()) > 0.97 * int(expected.mask.sum()), "levels without a place at the ends are not known"


def test_a_wind_of_the_field_is_met_along_the_track(descents: Descents, tmp_path: Path) -> None:
    path = written(weather(linear, linear_wind), tmp_path / "era5.nc")
    airs_met = field_airs(descents.frame, LEVELS, path)
    row = descents.frame.filter(pl.col("level_fl") == 250).drop_nulls(["latitude", "track"]).row(3, named=True)
    number, level = airs_met.flight_ids.index(row["flight_id"]), 100
    hours = (row["timestamp"].timestamp() - START.astype(float)) / 3600
    where = hours, 250, row["latitude"], row["longitude"]
    assert float(airs_met.air.deviation_k[number, level]) == pytest.approx(linear(*where), abs=1e-4)
    east, north = linear_wind(*where)
    along = east * np.sin(np.radians(row["track"])) + north * np.cos(np.radians(row["track"]))
    # The simulated tracks are straight but for the rounding of their report, 0.18 degrees.
    assert float(airs_met.air.tailwind_mps[number, level]) == pytest.approx(along, abs=0.1)
    without_track = field_airs(descents.frame.drop("track"), LEVELS, path)
    assert float(without_track.air.tailwind_mps[number, level]) == pytest.approx(along, abs=0.5)


def test_what_is_outside_is_dropped_and_counted(descents: Descents, tmp_path: Path) -> None:
    some = weather(linear).isel(valid_time=slice(0, 10)).sel(pressure_level=slice(250, None))
    found = field_airs(descents.frame, LEVELS, written(some, tmp_path / "some.nc"))
    limit = (START + np.timedelta64(54, "h")).item()
    start = descents.frame.group_by("flight_id").agg(pl.min("timestamp"), pl.max("timestamp").alias("end"))
    inside = start.filter(pl.col("end").dt.replace_time_zone(None) < limit)
    early = start.filter(pl.col("timestamp").dt.replace_time_zone(None) < limit)
    assert len(inside) <= len(found.flight_ids) <= len(early) < len(start)
    assert found.without == len(start) - len(found.flight_ids)
    # 250 hPa is FL339.9: the level next to the edge has no slope.
    assert not found.known[:, LEVELS >= 339].any()
    assert found.known[:, LEVELS == 330].any()
    lines: list[str] = []
    a320 = df.aircraft("A320")
    with_own_air(profiles_from_frame(descents.frame, a320, 150, 340), a320, found, lines.append)
    assert f"left out {found.without} of {len(start)} flight(s) of whose air nothing is known" in lines
    assert any("levels at which the air is not known" in line for line in lines)
    other = written(weather(linear).isel(valid_time=slice(0, 2)), tmp_path / "other.nc")
    with pytest.raises(DataError, match=r"places of descents outside of the weather field: 2024-03-04T.*expected 2"):
        field_airs(descents.frame, LEVELS, other)
    refuses(DataError, "descents without places", field_airs, descents.frame.drop("latitude"), LEVELS, other)


def test_a_model_of_a_field_meets_other_flights_in_a_field(descents: Descents, warm_file: Path, tmp_path: Path) -> None:
    path = tmp_path / "field.ckpt"
    df.fit(DescentDataModule(descents, air=warm_file), model="gaussian", out=path)
    kept = load_model(path).held_out_fit.representation.air
    assert kept is not None
    assert (kept.source, kept.wind) == ("field", True)
    torch.testing.assert_close(kept.training.deviation_k, torch.full_like(kept.training.deviation_k, 10.0))
    assert "of a weather field: temperature ISA +10.0 K" in kept.describe()
    settings = {"n": 100, "n_splits": 2}
    refuses(ConfigError, "no field of these flights", df.evaluate, path, descents, **settings)
    by_field = df.evaluate(path, descents, air=warm_file, **settings)
    by_reports = df.evaluate(path, descents, air="measured", **settings)
    assert len(by_field.real) == len(by_reports.real) > 10
    still, unknown = without_weather(descents.frame, load_model(path).held_out_fit.representation, warm_file)
    assert unknown == 0
    # Without the field's 10 K a descent is 2 to 3 % faster.
    faster = still["vertical_rate"].mean() / descents.frame["vertical_rate"].mean()  # type: ignore[operator]
    assert 1.01 < faster < 1.05
    assert float(df.sample(path, 20, seed=0).air.deviation_k.mean()) == pytest.approx(10.0)  # type: ignore[union-attr]
    data = DescentDataModule(descents, air=warm_file, checkpoint=path)
    data.setup()
    assert data.profiles("train").air is not None
    refuses(ConfigError, r"data\.air = 'warm'", df.evaluate, path, descents, air="warm", **settings)


def test_the_command_line_takes_a_field_and_a_folder_of_them(
    descents: Descents, warm_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_descents(descents, tmp_path / "d.parquet")
    path, words = tmp_path / "field.ckpt", ["--real", str(tmp_path / "d.parquet"), "-n", "60", "--no-figures"]
    df.fit(DescentDataModule(descents, air=warm_file.parent), model="gaussian", out=path)
    out = ["--out", str(tmp_path / "scores")]
    assert main(["evaluate", str(path), *words, *out, "--air", str(warm_file.parent)]) == 0
    assert main(["evaluate", str(path), *words, *out]) != 0
    assert "--air FILE" in capsys.readouterr().err


pytest.importorskip("xarray", reason="xarray is an extra of descentflow (wind)")


HOURS = np.array([0, 6, 12])


@pytest.fixture
def netcdf(tmp_path: Path) -> Path:
    return written(weather(linear, linear_wind, hours=HOURS)[["u", "v"]], tmp_path / "era5.nc")


def test_flights_in_a_field_of_constant_wind_fly_as_in_that_wind(tmp_path: Path) -> None:
    field = weather(linear, lambda h, *_: (0 * h + 30, 0 * h), hours=HOURS[:1])
    written(field, tmp_path / "one_time.nc")
    where = {"end": (51.0, 4.0), "track": 200.0}
    flown = steady_descents([200.0, 220.0])
    by_field = ground_plan(**where, wind=tmp_path / "one_time.nc").place(flown)
    by_text = ground_plan(**where, wind=f"270/{30 / 0.514444}").place(flown)
    np.testing.assert_allclose(by_field.to_go_m, by_text.to_go_m, rtol=1e-9)
    np.testing.assert_allclose(by_field.latitude, by_text.latitude, rtol=1e-9)


def test_a_time_is_needed_and_must_be_in_the_field(netcdf: Path) -> None:
    flown, where = steady_descents([200.0]), {"end": (51.0, 4.0), "track": 200.0, "wind": netcdf}
    refuses(ConfigError, "3 times, and no time of the descents", ground_plan(**where).place, flown)
    assert np.isfinite(ground_plan(**where, end_time="2024-03-03T05:00").place(flown).to_go_m).all()
    with pytest.raises(DataError, match=r"outside of the weather field: 2024-03-06T05.*expected 2024-03-03T00"):
        ground_plan(**where, end_time="2024-03-06T05:00").place(flown)
    with pytest.raises(DataError, match="latitude"):
        ground_plan(end=(30.0, 4.0), track=200.0, wind=netcdf, end_time="2024-03-03T05:00").place(flown)


def test_files_that_are_no_winds_are_refused(tmp_path: Path) -> None:
    (tmp_path / "text.nc").write_text("nothing")
    refuses(DataError, r"text\.nc", read_wind_field, tmp_path / "text.nc")
    refuses(DataError, r"absent\.nc", read_wind_field, tmp_path / "absent.nc")
