"""Repeated values go where the other channels contradict them, and stay where an aircraft holds them; turns; speeds."""

import numpy as np
import polars as pl
import pytest
from surveillance_toys import fleet, flight, rows_at

from descentflow.surveillance.cleaning._descent_filters import ClearedSpeed, Descending
from descentflow.surveillance.cleaning._faulty_values import Stale
from descentflow.surveillance.cleaning._filters import SEGMENT, filtered
from descentflow.surveillance.cleaning.chain import before_rates
from descentflow.surveillance.cleaning.thresholds import Cleaning
from descentflow.surveillance.rows.air_data import mach_of_cas
from descentflow.surveillance.rows.drop_report import DropReport

LIMITS = {"altitude": 300.0, "IAS": 8.0, "Mach": 0.02, "vertical_rate": 300.0}


def descent(**changes: object) -> pl.DataFrame:
    """Rows of one descent by the second of its flight, CAS falling from 310 to 210 kt so that nothing is constant."""
    rows = flight(every_s=4.0).with_columns(pl.lit("a").alias("flight_id"))
    ias = np.linspace(310.0, 210.0, len(rows)).round()
    rows = rows.with_columns(IAS=pl.Series(ias), Mach=pl.Series(mach_of_cas(ias, rows["altitude"].to_numpy()).round(3)))
    return rows.with_columns(pl.int_range(pl.len()).alias("row"))


def frozen(rows: pl.DataFrame, first: int, last: int, *columns: str) -> pl.DataFrame:
    """The same with the value of row `first` held up to row `last`."""
    held = pl.col("row").is_between(first, last)
    return rows.with_columns(
        pl.when(held).then(pl.lit(rows[name][first])).otherwise(name).alias(name) for name in columns
    )


@pytest.mark.parametrize("column", LIMITS)
def test_a_held_value_goes_but_for_its_first_row(column: str) -> None:
    rows = frozen(descent(), 60, 90, column)
    if column == "vertical_rate":  # rates of a descent hardly change; this one was held over from the climb before
        rows = rows.with_columns(
            vertical_rate=pl.when(pl.col("row").is_between(60, 90)).then(64.0).otherwise("vertical_rate")
        )
    kept = Stale(column, LIMITS[column]).keep(rows)
    assert sorted(set(rows["row"]) - set(kept["row"])) == list(range(61, 91))


def test_a_register_held_whole_goes_too() -> None:
    rows = frozen(descent(), 60, 90, "IAS", "Mach", "vertical_rate")
    assert set(range(61, 91)).isdisjoint(filtered(rows, before_rates(Cleaning()), DropReport())["row"])


@pytest.mark.parametrize("column", LIMITS)
def test_what_an_aircraft_holds_stays(column: str) -> None:
    # Toys hold IAS in descent, and everything in level flight.
    rows = fleet(4).with_columns(pl.col("icao24").alias("flight_id"), pl.col("Mach").round(3))
    assert len(Stale(column, LIMITS[column]).keep(rows)) == len(rows)


def test_held_values_are_not_followed_over_gaps_or_flights_or_missing_ones() -> None:
    rows = frozen(descent(), 60, 90, "altitude")
    gaps = rows.filter((pl.col("row") < 60) | (pl.col("row") > 90) | (pl.col("row") % 20 == 0))
    assert len(Stale("altitude", 300.0).keep(gaps)) == len(gaps)
    flights = rows.with_columns(flight_id=pl.format("{}", pl.col("row") // 4))
    assert len(Stale("altitude", 300.0).keep(flights)) == len(flights)
    missing = rows.with_columns(vertical_rate=pl.lit(None, pl.Float64))
    for column in LIMITS:
        assert len(Stale(column, LIMITS[column]).keep(missing.with_columns(altitude=descent()["altitude"]))) == len(
            rows
        )
    assert len(Stale("altitude", 300.0).keep(missing.drop("vertical_rate"))) == len(rows)
    assert Stale("IAS", 8.0).keep(rows.clear()).is_empty()


def test_rows_under_a_speed_instruction_go_and_some_after_it() -> None:
    time = [10.0 * n for n in range(10)]
    cleared = [None, None, 250.0, 250.0, None, None, None, None, None, None]
    mach = [None] * 8 + [0.78, None]
    rows = rows_at(
        time,
        altitude=[0.0] * 10,
        IAS=[280.0] * 3 + [255.0] * 7,
        Mach=[0.77] * 10,
        cleared_speed_kt=cleared,
        cleared_mach=mach,
        vertical_rate=[-900.0] * 10,
    )
    rows = Descending().keep(rows.with_row_index("row"))
    kept = ClearedSpeed(20.0).keep(rows)
    assert kept["row"].to_list() == [0, 1, 6, 7]
    assert kept[SEGMENT].n_unique() == 2  # no level is bridged across what was cut
    other = rows.with_columns(flight_id=pl.when(pl.col("row") < 4).then(pl.lit("a")).otherwise(pl.lit("b")))
    assert ClearedSpeed(20.0).keep(other)["row"].to_list() == [0, 1, 4, 5, 6, 7]
    assert len(ClearedSpeed(20.0).keep(rows.drop("cleared_speed_kt", "cleared_mach"))) == 10
    # 250 kt or more, and flown at 280: no constraint.
    faster = rows.with_columns(IAS=pl.lit(280.0))
    assert ClearedSpeed(20.0).keep(faster)["row"].to_list() == [0, 1, 2, 3, 4, 5, 6, 7]


def test_a_change_of_speed_that_mach_shares_is_no_spike() -> None:
    # Reports a minute apart of an aircraft that hurries and slows down, as seen over the Netherlands.
    altitude = np.linspace(33_000.0, 28_000.0, 9)
    ias = np.array([250.0, 250, 252, 265, 287, 268, 252, 250, 250])
    rows = rows_at([60.0 * n for n in range(9)], altitude=altitude, IAS=ias, Mach=mach_of_cas(ias, altitude))
    chain = before_rates(Cleaning())
    assert len(filtered(rows, chain, DropReport())) == 9
    strange = rows.with_columns(Mach=pl.Series(mach_of_cas(np.where(ias == 287, 250.0, ias), altitude)))
    assert len(filtered(strange, chain, DropReport())) == 8
