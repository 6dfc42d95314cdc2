"""Files of weather that are odd or damaged: a field in closed form comes back, or a line names what is wrong."""

import subprocess
import sys
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from refusals import refuses

pytest.importorskip("xarray", reason="xarray is an extra of descentflow (wind)")

import xarray
from weather_toys import START, linear, linear_wind, some_points, weather, written, written_as_grib

from descentflow.core.errors import DataError
from descentflow.core.units import KT_MPS
from descentflow.positions.wind import read_wind_field
from descentflow.weather.weather_field import Points, weather_field

HOURS = np.arange(0, 25, 6)
WORLD = np.arange(-180.0, 180.0, 5.0)
Change = Callable[[xarray.Dataset], xarray.Dataset]


def whole() -> xarray.Dataset:
    return weather(linear, linear_wind, hours=HOURS)


def read(path: Path) -> tuple[np.ndarray, ...]:
    points, _ = some_points(24)
    with weather_field(path) as field:
        values = field.at(points)
        field.check(points)
    return values


def expected() -> tuple[object, ...]:
    points, hours = some_points(24)
    return linear(hours, *points[1:]), *linear_wind(hours, *points[1:])


def changed(name: str, change: Callable[[xarray.DataArray], xarray.DataArray], **attributes: object) -> Change:
    """A variable's values changed, and its attributes; None takes one off."""

    def done(data: xarray.Dataset) -> xarray.Dataset:
        new = change(data[name])
        new.attrs = {key: value for key, value in {**data[name].attrs, **attributes}.items() if value is not None}
        return data.assign_coords({name: new}) if name in data.coords else data.assign({name: new})

    return done


def repeated(axis: str, shift: float = 0.0) -> Change:
    """An axis with its last place once more, its values shifted there."""

    def done(data: xarray.Dataset) -> xarray.Dataset:
        last = data.isel({axis: [-1]})
        return xarray.concat([data, last + shift], axis, data_vars="all")

    return done


def holed(data: xarray.Dataset) -> xarray.Dataset:
    return data.where((abs(data["latitude"] - 52) > 3) | (abs(data["pressure_level"] - 400) > 60))


def versions(data: xarray.Dataset) -> xarray.Dataset:
    """First and final values beside each other, as in the last months of ERA5."""
    first = data["valid_time"] < data["valid_time"][2]
    return xarray.concat([data.where(first), data.where(~first)], "expver").transpose("valid_time", "expver", ...)


SAME = lambda values: values  # noqa: E731
CERTAIN: dict[str, Change] = {
    "names of before 2024": lambda d: changed("level", SAME, units="millibars")(
        d.rename(valid_time="time", pressure_level="level")
    ),
    "two versions": versions,
    "a level twice": repeated("pressure_level"),
    "a time twice": repeated("valid_time"),
    "axes in disorder": lambda d: d.isel(latitude=[3, 1, 0, 2, *range(4, 9)], pressure_level=slice(None, None, -1)),
    "times in disorder": lambda d: d.isel(valid_time=[3, 1, 0, 2, 4]),
    "Celsius": changed("t", lambda t: t - 273.15, units="degC"),
    "K without a unit": changed("t", SAME, units=None),
    "knots": lambda d: changed("v", lambda v: v / KT_MPS, units="kt")(
        changed("u", lambda u: u / KT_MPS, units="knots")(d)
    ),
    "levels in Pa": changed("pressure_level", lambda p: 100 * p, units="Pa"),
    "levels in Pa without a unit": changed("pressure_level", lambda p: 100 * p, units=None),
    "levels without a unit": changed("pressure_level", SAME, units=None),
    "longitudes from 0": lambda d: d.assign_coords(longitude=d["longitude"] % 360),
    "whole numbers": lambda d: d.assign_coords(pressure_level=d["pressure_level"].astype(int)),
    "another order of dimensions": lambda d: d.transpose("longitude", "valid_time", "latitude", "pressure_level"),
    "other names": lambda d: d.rename(t="ta", u="ua", v="va", pressure_level="plev", latitude="lat", longitude="lon"),
    "one member": lambda d: d.expand_dims(number=[0]),
    "a variable of one level beside": lambda d: d.assign(
        t2m=d["t"].isel(pressure_level=0, drop=True).assign_attrs(standard_name="air_temperature")
    ),
}
REFUSED: dict[str, tuple[Change, str]] = {
    "one component": (lambda d: d.drop_vars("v"), "without northward_wind, with air_temperature and eastward_wind"),
    "winds alone": (lambda d: d[["u", "v"]], "without air_temperature, with eastward_wind and northward_wind"),
    "nothing": (lambda d: d.drop_vars(["t", "u", "v"]), "without air_temperature, with nothing of use"),
    "Celsius without a unit": (changed("t", lambda t: t - 273.15, units=None), r"values of t .*for want of a unit"),
    "Celsius called K": (changed("t", lambda t: t - 273.15), r"values of t in k that no air has"),
    "winds without a unit": (changed("u", SAME, units=None), "u over .*unit missing"),
    "a fill value": (changed("u", lambda u: u.where(u.latitude > 45, 1e20)), r"values of u .* no air has: 1e\+20"),
    "a meridian with two values": (repeated("longitude", 5.0), "two values of t at a place .* longitude"),
    "a time with two values": (repeated("valid_time", 5.0), "with another air_temperature at one time"),
    "a meridian that is none": (changed("longitude", lambda x: x.where(x < 10)), "longitude with .*no numbers"),
    "a time that is none": (changed("valid_time", lambda x: x.where(x > x[1])), "valid_time with .*no times"),
    "numbers for times": (lambda d: d.assign_coords(valid_time=HOURS.astype(float)), "valid_time with .*no times"),
    "latitudes beyond the pole": (changed("latitude", lambda x: x + 40), "latitude of 84 to 100"),
    "metres": (changed("longitude", SAME, units="m"), "longitude of -8 to 18 m"),
    "levels of the model": (
        changed("pressure_level", lambda p: p / 10, units=None),
        "level of 15 to 70 without a unit",
    ),
    "heights": (changed("pressure_level", SAME, units="m"), "pressure_level of 150 to 700 m"),
    "no latitude": (lambda d: d.drop_vars("latitude"), "without a coordinate latitude or lat"),
    "the surface": (lambda d: d.isel(pressure_level=0, drop=True), "without a coordinate isobaricInhPa or"),
    "members": (lambda d: d.expand_dims(number=[0, 1]), "air_temperature as t over number, .*float64"),
    "names at odds": (changed("u", SAME, standard_name="northward_wind"), "u with the standard name northward_wind"),
    "a wind along the grid": (changed("u", SAME, standard_name="x_wind"), "without eastward_wind, with"),
    "one level": (lambda d: d.isel(pressure_level=[4]), "outside of the weather field: .* expected .*FL266 to FL266"),
    "a hole": (
        holed,
        r"[0-9]+ of 200 places of descents in a hole of the weather field \(NaN\): .*with a value of air_temperature",
    ),
    "a field of other days": (changed("valid_time", lambda x: x + np.timedelta64(9, "D")), "outside of the weather"),
}


@pytest.mark.parametrize("name", CERTAIN)
def test_a_field_whose_meaning_is_certain_is_given_back(name: str, tmp_path: Path) -> None:
    path = written(CERTAIN[name](whole()), tmp_path / "era5.nc")
    np.testing.assert_allclose(read(path), expected(), rtol=0, atol=1e-6)
    points, _ = some_points(24)
    wind = read_wind_field(path).at(250.0, points.latitude, points.longitude, points.unix_s)
    np.testing.assert_allclose(wind, linear_wind(some_points(24)[1], 250.0, *points[2:]), rtol=0, atol=1e-6)


@pytest.mark.parametrize("name", REFUSED)
def test_any_other_is_refused_in_a_line_that_names_what_is_wrong(name: str, tmp_path: Path) -> None:
    change, message = REFUSED[name]
    path = written(change(whole()), tmp_path / "era5.nc")
    with pytest.raises(DataError, match=message) as caught:
        read(path)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("longitude", [WORLD, np.append(WORLD, 180.0), np.append(WORLD % 360, 180.0)])
def test_a_globe_is_one_whether_its_first_meridian_ends_it_or_not(longitude: np.ndarray, tmp_path: Path) -> None:
    path = written(weather(lambda *at: 10 * np.cos(np.radians(at[3])), longitude=longitude), tmp_path / "globe.nc")
    place = np.array([-177.5, -2.5, 2.5, 177.5, 182.5])
    with weather_field(path) as field:
        values = field.at(Points(START.astype(float), 250.0, np.full(5, 50.0), place))[0]
    near = [(np.cos(np.radians(x - 2.5)) + np.cos(np.radians(x + 2.5))) * 5 for x in place]
    np.testing.assert_allclose(values, near, rtol=0, atol=1e-9)


def test_one_component_is_refused_wherever_winds_are_asked_for(tmp_path: Path) -> None:
    path = written(whole().drop_vars("v"), tmp_path / "era5.nc")
    refuses(DataError, "without northward_wind", read_wind_field, path)
    written(whole()[["v"]].isel(valid_time=slice(0, 3)), tmp_path / "v.nc")
    refuses(DataError, "5 times of eastward_wind and 3 others of northward_wind", read, tmp_path)
    # The other component may be in another file.
    written(whole()[["v"]], tmp_path / "v.nc")
    np.testing.assert_allclose(read(tmp_path), expected(), rtol=0, atol=1e-9)


def test_a_time_in_two_files_must_be_the_same(tmp_path: Path) -> None:
    data = whole()
    written(data.isel(valid_time=slice(0, 3)), tmp_path / "a.nc")
    later = data.isel(valid_time=slice(2, 5))
    written(later.map(lambda values: values + 0.01, keep_attrs=True), tmp_path / "b.nc")
    np.testing.assert_allclose(read(tmp_path), expected(), rtol=0, atol=0.011)
    written(later.map(lambda values: values + 1.0, keep_attrs=True), tmp_path / "b.nc")
    refuses(DataError, r"a\.nc and .*b\.nc with another air_temperature at one time", read, tmp_path)


@pytest.fixture
def grib(tmp_path: Path) -> Path:
    import pyproj  # noqa: F401 - before ecCodes, as descentflow has it

    return tmp_path / "era5.grib2"


def test_pressure_levels_of_a_grib_file_are_read_beside_other_levels(grib: Path) -> None:
    written_as_grib(whole().isel(pressure_level=[0]), grib, typeOfLevel="heightAboveGround", level=10)
    written_as_grib(whole(), grib)
    np.testing.assert_allclose(read(grib), expected(), rtol=0, atol=1e-4)


def test_variables_of_a_grib_file_may_have_levels_of_their_own(grib: Path) -> None:
    written_as_grib(whole()[["t"]], grib)
    written_as_grib(whole()[["u", "v"]].isel(pressure_level=slice(0, None, 3)), grib)
    np.testing.assert_allclose(read(grib), expected(), rtol=0, atol=1e-4)


def test_a_forecast_counts_by_the_time_that_it_is_for(grib: Path) -> None:
    written_as_grib(whole().isel(valid_time=[0]), grib, forecastTime=6)
    with weather_field(grib) as field:
        assert field.times == [START.astype(float) + 6 * 3600]


@pytest.mark.parametrize(
    ("sample", "message"),
    [
        ("sh_pl_grib2", "without a coordinate latitude"),
        ("reduced_gg_pl_32_grib2", "t over valid_time, isobaricInhPa, values"),
        ("rotated_ll_pl_grib2", "latitude over y, x"),
    ],
)
def test_grib_on_other_grids_is_refused_quietly(
    sample: str, message: str, grib: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    eccodes = pytest.importorskip("eccodes")
    handle = eccodes.codes_grib_new_from_samples(sample)
    eccodes.codes_set(handle, "shortName", "t")
    with grib.open("wb") as file:
        eccodes.codes_write(handle, file)
    eccodes.codes_release(handle)
    refuses(DataError, message, read, grib)
    assert capfd.readouterr() == ("", "")


def test_grib_that_is_no_such_field_is_refused_quietly(grib: Path, capfd: pytest.CaptureFixture[str]) -> None:
    written_as_grib(whole().isel(pressure_level=[0]), grib, typeOfLevel="heightAboveGround", level=10)
    refuses(DataError, "t, u, v on levels heightAboveGround", read, grib)
    grib.unlink()
    written_as_grib(whole()[["t", "u"]], grib)
    refuses(DataError, "without northward_wind", read, grib)
    content = written_as_grib(whole()[["v"]], grib).read_bytes()
    np.testing.assert_allclose(read(grib), expected(), rtol=0, atol=1e-4)
    grib.write_bytes(content[:-50])
    refuses(DataError, "End of resource reached", read, grib)
    # A section longer than its message: ecCodes by itself ends the process.
    section = content.index(b"GRIB", 1000) + 16
    grib.write_bytes(content[:section] + b"\0\0\x80\x15" + content[section + 4 :])
    refuses(DataError, "a damaged message of GRIB at byte", read, grib)
    # A day that no month has: ecCodes by itself writes on the terminal.
    grib.write_bytes(content[: section + 15] + b"\x83" + content[section + 16 :])
    refuses(DataError, r"month 3, day 131 in the message of GRIB at byte", read, grib)
    # Without its last message it is whole, but for a hole.
    grib.write_bytes(content[: content.rindex(b"GRIB")])
    refuses(DataError, r"in a hole of the weather field .*with a value of northward_wind", read, grib)
    assert capfd.readouterr() == ("", "")


@pytest.mark.skipif(find_spec("eckitlib") is None, reason="only the wheel of ecCodes has a PROJ of its own")
@pytest.mark.parametrize(
    ("first", "said"),
    [("import cfgrib", "cfgrib or eccodes imported before pyproj"), ("import pyproj, cfgrib", "180.0")],
)
def test_a_program_that_imports_eccodes_first_is_refused_and_not_ended(first: str, said: str) -> None:
    code = f"""{first}
from descentflow.core.errors import ConfigError
from descentflow.positions.ground_path import path_to
import numpy as np
try:
    print(path_to((52.0, 4.0), track=180.0).at(np.zeros(1))[2][0])
except ConfigError as error:
    print(error)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert said in done.stdout


@pytest.mark.skipif(find_spec("eckitlib") is None, reason="only the wheel of ecCodes has a PROJ of its own")
def test_a_program_that_opened_a_file_by_xarray_reads_fields_all_the_same(tmp_path: Path) -> None:
    """xarray asks each library whether it knows a file, and so imports ecCodes."""
    path = written(weather(linear, hours=HOURS), tmp_path / "cold.nc")
    code = f"""import sys, xarray, eccodes
xarray.open_dataset({str(path)!r}).close()
from descentflow.weather.weather_field import weather_field
with weather_field({str(path)!r}) as field:
    print("eckitlib" in sys.modules, "pyproj" in sys.modules, len(field.times))
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["True", "False", str(len(HOURS))]
