"""Winds of a weather model, from NetCDF and GRIB, beside what was written into them."""

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("xarray", reason="xarray is an extra of descentflow (wind)")

from position_toys import steady_descents
from weather_toys import linear, linear_wind, weather, written

from descentflow.core.errors import ConfigError, DataError
from descentflow.positions.ground_plan import ground_plan
from descentflow.positions.wind import read_wind_field

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
    with pytest.raises(ConfigError, match="3 times, and no time of the descents"):
        ground_plan(**where).place(flown)
    assert np.isfinite(ground_plan(**where, end_time="2024-03-03T05:00").place(flown).to_go_m).all()
    with pytest.raises(DataError, match=r"outside of the weather field: 2024-03-06T05.*expected 2024-03-03T00"):
        ground_plan(**where, end_time="2024-03-06T05:00").place(flown)
    with pytest.raises(DataError, match="latitude"):
        ground_plan(end=(30.0, 4.0), track=200.0, wind=netcdf, end_time="2024-03-03T05:00").place(flown)


def test_files_that_are_no_winds_are_refused(tmp_path: Path) -> None:
    (tmp_path / "text.nc").write_text("nothing")
    with pytest.raises(DataError, match=r"text\.nc"):
        read_wind_field(tmp_path / "text.nc")
    with pytest.raises(DataError, match=r"absent\.nc"):
        read_wind_field(tmp_path / "absent.nc")
