"""Columns of each flight are compared as tightly as real sources agree, and what differs is named."""

import warnings

import numpy as np
import polars as pl
import pytest

from descentflow.core.errors import DataError, DescentflowWarning
from descentflow.surveillance.rows._units_check import check_units
from descentflow.surveillance.rows.air_data import cas_of_mach_kt, isa_tas_of_mach_kt, mach_of_cas


def rows_of_flights(number: int = 6) -> pl.DataFrame:
    """Descents of 2,400 ft/min and more at constant CAS, a row each 10 s."""
    flights = []
    for flight in range(number):
        seconds = np.arange(0.0, 700.0, 10.0)
        rate_fpm = -2400.0 - 100 * flight
        altitude = 38_000.0 + rate_fpm * seconds / 60
        ias = np.full(len(seconds), 260.0 + 5 * flight)
        tas = isa_tas_of_mach_kt(mach_of_cas(ias, altitude), altitude)
        flights.append(
            pl.DataFrame(
                {
                    "icao24": f"4ca00{flight}",
                    "timestamp": pl.from_epoch(pl.Series(1_709_287_200 + 7200 * flight + seconds).cast(pl.Int64)),
                    "altitude": altitude,
                    "IAS": ias,
                    "Mach": mach_of_cas(ias, altitude),
                    "vertical_rate": rate_fpm,
                    "TAS": tas,
                    "groundspeed": tas + 10.0 * (flight - 2),
                }
            )
        )
    return pl.concat(flights)


ODD = pl.col("icao24").str.slice(-1).cast(pl.Int64) % 2 == 1


@pytest.mark.parametrize(
    ("factor", "words", "mend"),
    [
        (2.0, "doubled", r"vertical_rate\*0.5"),
        (0.5, "halved", r"vertical_rate\*2"),
        (1 / 32, "raw counts of 32 ft/min", r"vertical_rate\*32"),
        (1 / 64, "raw counts of 64 ft/min", r"vertical_rate\*64"),
    ],
)
def test_a_scaled_rate_is_named_with_its_own_factor(factor: float, words: str, mend: str) -> None:
    with pytest.raises(DataError, match=f"(?s){words}.*{mend}"):
        check_units(rows_of_flights().with_columns(pl.col("vertical_rate") * factor), "rows")


@pytest.mark.parametrize("factor", [0.95, 1.0, 1.04])
def test_rates_as_of_real_sources_pass_in_silence(factor: float) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_units(rows_of_flights().with_columns(pl.col("vertical_rate") * factor), "rows")


@pytest.mark.parametrize(
    ("column", "factor", "words"),
    [
        ("vertical_rate", 0.00508, "vertical_rate seems to be in m/s"),
        ("altitude", 0.3048, "altitude seems to be in metres"),
        ("IAS", 0.514444, "IAS seems to be in m/s"),
        ("vertical_rate", -1.0, "vertical_rate has the sign of a sink rate"),
        ("TAS", 1.852, "TAS seems to be in km/h"),
        ("groundspeed", 0.514444, "groundspeed seems to be in m/s"),
        ("groundspeed", 1.852, "groundspeed seems to be in km/h"),
    ],
)
def test_some_flights_in_another_unit_are_named(column: str, factor: float, words: str) -> None:
    rows = rows_of_flights().with_columns(pl.when(ODD).then(factor).otherwise(1.0).mul(pl.col(column)).alias(column))
    with pytest.warns(DescentflowWarning, match=rf"in 3 flights \(4ca001, 4ca003, 4ca005\) {words}"):
        check_units(rows, "rows")


def test_flights_of_several_sources_are_named_each_with_its_own_unit() -> None:
    number = pl.col("icao24").str.slice(-1).cast(pl.Int64)
    factor = pl.when(number == 1).then(0.00508).when(number == 2).then(-1.0).otherwise(1.0)
    with pytest.warns(DescentflowWarning, match=r"1 flights \(4ca001\) .*m/s; in 1 flights \(4ca002\) .*sink rate"):
        check_units(rows_of_flights().with_columns(pl.col("vertical_rate") * factor), "rows")


def test_a_strong_wind_is_no_other_unit() -> None:
    """From 160 kt against to 100 kt behind, on tracks of all directions."""
    wind = pl.Series(np.repeat([-160.0, -100.0, 0.0, 40.0, 70.0, 100.0], 70))
    rows = rows_of_flights().with_columns(groundspeed=pl.col("groundspeed") + wind)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_units(rows, "rows")


def test_a_geometric_altitude_in_warm_air_is_called_so() -> None:
    rows = rows_of_flights()
    mach, geometric = rows["Mach"].to_numpy(), rows["altitude"].to_numpy() * (1 + 18 / 260)
    assert np.median(rows["IAS"].to_numpy() - cas_of_mach_kt(mach, geometric)) > 5
    with pytest.warns(DescentflowWarning, match="altitude seems to be a geometric altitude"):
        check_units(rows.with_columns(altitude=pl.Series(geometric)).drop("vertical_rate"), "rows")
