"""Questions asked flight by flight of tables of many rows."""

import polars as pl
import pytest

from descentflow.core.errors import DataError
from descentflow.surveillance.descents._check_descents import checked_descents


def test_a_level_twice_is_found_where_the_rows_of_a_flight_stand_apart() -> None:
    names, levels = ["a", "a", "b", "a"], [202, 201, 202, 200]
    apart = pl.DataFrame({"flight_id": names, "level_fl": levels, "time_s": [0.0, 2.0, 0.0, 4.0]})
    apart = apart.with_columns(pl.col("level_fl").cast(pl.Int32), icao24=pl.lit("4ca001"), IAS=270.0, Mach=0.55)
    begun = pl.datetime(2026, 1, 1, time_unit="us", time_zone="UTC")
    apart = apart.with_columns(begun.alias("timestamp"), typecode=pl.lit("A320"), vertical_rate=-3000.0)
    assert checked_descents(apart, "apart").equals(apart)
    with pytest.raises(DataError, match="has 1 levels twice in one flight"):
        checked_descents(pl.concat([apart, apart.head(1)]), "apart")
