"""Winds of a weather model, from NetCDF and GRIB, beside what was written into them."""

from pathlib import Path

import numpy as np
import pytest
from position_toys import steady_descents

from descentflow.core.errors import ConfigError, DataError
from descentflow.positions.ground_plan import ground_plan
from descentflow.positions.wind import read_wind_field

xarray = pytest.importorskip("xarray", reason="xarray is an extra of descentflow (wind)")

TIMES = np.array(["2026-11-22T00", "2026-11-22T06", "2026-11-22T12"], dtype="datetime64[ns]")
PRESSURE = np.array([600.0, 500.0, 400.0, 300.0, 200.0])
LATITUDE, LONGITUDE = np.arange(56.0, 44.0, -0.5), np.arange(-6.0, 12.1, 0.5)


def linear(hours: object, latitude: object, longitude: object) -> tuple[object, object]:
    """A wind that is linear in time and place, so that interpolation must give it back exactly."""
    east = 20 + 0.5 * hours + 0.7 * (latitude - 50) - 0.3 * longitude
    return east, 5 - 0.2 * hours + 0.1 * (latitude - 50) + 0.4 * longitude


def dataset(**changes: object) -> object:
    hours = ((TIMES - TIMES[0]) / np.timedelta64(1, "h"))[:, None, None, None]
    east, north = linear(hours, LATITUDE[None, None, :, None], LONGITUDE[None, None, None, :])
    shape = (len(TIMES), len(PRESSURE), len(LATITUDE), len(LONGITUDE))
    dims = ("valid_time", "pressure_level", "latitude", "longitude")
    attributes = {"units": "m s**-1"} | changes
    winds = {
        name: (dims, np.broadcast_to(value, shape).copy(), attributes) for name, value in (("u", east), ("v", north))
    }
    axes = dict(zip(dims, (TIMES, PRESSURE, LATITUDE, LONGITUDE), strict=True))
    return xarray.Dataset(winds, axes)


@pytest.fixture
def netcdf(tmp_path: Path) -> Path:
    dataset().to_netcdf(tmp_path / "era5.nc")
    return tmp_path / "era5.nc"


def test_flights_in_a_field_of_constant_wind_fly_as_in_that_wind(tmp_path: Path) -> None:
    field = dataset()
    field["u"][:], field["v"][:] = 30.0, 0.0
    field.isel(valid_time=[0]).to_netcdf(tmp_path / "one_time.nc")
    where = {"end": (51.0, 4.0), "track": 200.0}
    flown = steady_descents([200.0, 220.0])
    by_field = ground_plan(**where, wind=tmp_path / "one_time.nc").place(flown)
    by_text = ground_plan(**where, wind=f"270/{30 / 0.514444}").place(flown)
    np.testing.assert_allclose(by_field.to_go_m, by_text.to_go_m, rtol=1e-9)
    np.testing.assert_allclose(by_field.latitude, by_text.latitude, rtol=1e-9)


def test_a_time_is_needed_and_must_be_in_the_field(netcdf: Path) -> None:
    flown, where = steady_descents([200.0]), {"end": (51.0, 4.0), "track": 200.0, "wind": netcdf}
    with pytest.raises(ConfigError, match="3 times, and no time of the descents"):
        ground_plan(**where).place(flown)
    assert np.isfinite(ground_plan(**where, end_time="2026-11-22T05:00").place(flown).to_go_m).all()
    with pytest.raises(DataError, match=r"outside of the weather field: 2026-11-25T05.*expected 2026-11-22T00"):
        ground_plan(**where, end_time="2026-11-25T05:00").place(flown)
    with pytest.raises(DataError, match="latitude"):
        ground_plan(end=(30.0, 4.0), track=200.0, wind=netcdf, end_time="2026-11-22T05:00").place(flown)


def test_files_that_are_no_winds_are_refused(tmp_path: Path) -> None:
    (tmp_path / "text.nc").write_text("nothing")
    with pytest.raises(DataError, match=r"text\.nc"):
        read_wind_field(tmp_path / "text.nc")
    with pytest.raises(DataError, match=r"absent\.nc"):
        read_wind_field(tmp_path / "absent.nc")
    dataset(units="furlong").to_netcdf(tmp_path / "slow.nc")
    with pytest.raises(DataError, match=r"u over .*unit furlong"):
        read_wind_field(tmp_path / "slow.nc")
    dataset().drop_vars("v").to_netcdf(tmp_path / "half.nc")
    with pytest.raises(DataError, match="without northward_wind, with eastward_wind"):
        read_wind_field(tmp_path / "half.nc")
