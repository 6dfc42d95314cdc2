"""Filters on hand-made rows of which every drop is known: spikes, transients, held and repeated values, turns."""

from itertools import product

import numpy as np
import polars as pl
import pytest
from numpy.typing import NDArray
from surveillance_toys import fleet, flight, rows_at

from descentflow.surveillance.cleaning._descent_filters import (
    ClearedSpeed,
    Descending,
    Falling,
    LargestDescent,
    SteadyDescent,
)
from descentflow.surveillance.cleaning._faulty_values import AirspeedsAgree, Despike, Stale
from descentflow.surveillance.cleaning.chain import before_rates
from descentflow.surveillance.cleaning.filters import SEGMENT, filtered
from descentflow.surveillance.cleaning.rates import ConstantRate
from descentflow.surveillance.cleaning.thresholds import Cleaning
from descentflow.surveillance.rows.air_data import cas_of_mach_kt, mach_of_cas
from descentflow.surveillance.rows.drop_report import DropReport

EVERY_10_S = [10.0 * i for i in range(12)]
TIME = np.arange(0, 400.0, 4.0)


def seconds_left(rows: pl.DataFrame) -> list[float]:
    return ((rows["timestamp"].dt.epoch("us") - 1709287200_000000) / 1e6).to_list()


def test_a_lone_value_is_a_spike_and_smooth_changes_are_not() -> None:
    values = [30_000.0 - 300 * i for i in range(12)]
    values[5] += 2000
    kept = Despike("altitude", 300.0).keep(rows_at(EVERY_10_S, altitude=values))
    # Without `fastest` the first and last row, 300 ft from their neighbours, are at the floor and stay.
    assert seconds_left(kept) == [t for t in EVERY_10_S if t != 50.0]


def test_ends_of_a_sparse_steep_path_are_no_spikes_but_wild_ends_are() -> None:
    times = [30.0 * i for i in range(8)]
    steep = [30_000.0 - 1500 * i for i in range(8)]
    despike = Despike("altitude", 300.0, fastest=100.0)
    assert len(despike.keep(rows_at(times, altitude=steep))) == 8
    for end in (0, 7):
        wild = [*steep]
        wild[end] = -900.0 if end == 0 else 45_000.0
        assert seconds_left(despike.keep(rows_at(times, altitude=wild))) == [t for t in times if t != times[end]]


def test_airspeeds_that_contradict_each_other_go() -> None:
    cas = float(cas_of_mach_kt(np.array([0.7]), np.array([30_000.0]))[0])
    rows = rows_at([0.0, 1.0, 2.0, 3.0], altitude=[3e4] * 4, Mach=[0.7] * 4, IAS=[cas, cas + 24, cas + 26, cas - 26])
    assert seconds_left(AirspeedsAgree(25.0).keep(rows)) == [0.0, 1.0]


def test_descent_begins_at_500_fpm_and_knows_the_distance_to_level_flight() -> None:
    rates = [0.0, -499.0, -500.0, -2000.0, None, -2000.0, -2000.0, 64.0, -900.0]
    kept = Descending().keep(rows_at(EVERY_10_S[:9], vertical_rate=rates))
    assert seconds_left(kept) == [20.0, 30.0, 50.0, 60.0, 80.0]
    assert kept["_since_level"].to_list() == [10.0, 20.0, 10.0, 20.0, 10.0]
    assert kept["_until_level"].to_list() == [20.0, 10.0, 20.0, 10.0, None]
    assert kept[SEGMENT].to_list() == [2, 2, 3, 3, 4]


def test_transients_go_on_both_sides_of_level_flight() -> None:
    rates, steady = [0.0] * 3 + [-2000.0] * 6 + [0.0] * 3, (Descending(), SteadyDescent(20.0))
    rows = rows_at(EVERY_10_S, vertical_rate=rates)
    report = DropReport()
    kept = filtered(rows, steady, report)
    assert seconds_left(kept) == [40.0, 50.0, 60.0, 70.0]
    assert [(s.step, s.rows_dropped) for s in report.steps] == [("not_descending", 6), ("transient", 2)]
    # Where a flight begins in descent, no transient is known of.
    assert len(filtered(rows.slice(5, 4), steady, DropReport())) == 4


def managed(
    held_fpm: float, *, seconds: float = 120.0, before_s: float = 200.0, after_s: float = 200.0, every_s: float = 4.0
) -> pl.DataFrame:
    """Idle at -2,200 ft/min that weakens by 60 ft/min a minute, a held rate, and idle again; steps of 32 ft/min."""
    time = np.arange(0, before_s + seconds + after_s, every_s)
    idle = -2200 + 60 * time / 60
    rate = np.where((time >= before_s) & (time < before_s + seconds), held_fpm, idle)
    noise = np.random.default_rng(1).normal(0, 30, len(time))
    return flown(time, (32 * np.round((rate + noise) / 32)))


def flown(time: NDArray[np.float64], rate_fpm: NDArray[np.float64]) -> pl.DataFrame:
    """Rows at a TAS of 430 kt, so that 1,740 ft/min are a gradient of 4 %."""
    channels = {"vertical_rate": rate_fpm.tolist(), "Mach": [0.7] * len(time), "altitude": [20_000.0] * len(time)}
    return rows_at(time.tolist(), **channels)


def test_a_held_rate_is_found_and_idle_rates_are_free() -> None:
    rows = managed(-1500.0)
    left = seconds_left(ConstantRate().keep(rows))
    # The cut lies where the means of both sides differ most, within a report or two of the truth.
    assert [t for t in left if t < 190 or t > 330] == [t for t in seconds_left(rows) if t < 190 or t > 330]
    assert not [t for t in left if 210 < t < 310]


@pytest.mark.parametrize(
    ("rows", "why"),
    [
        (managed(-1550.0), "no rate that can be selected"),
        (managed(-1500.0, seconds=60.0), "held for less than 50 s between its settling"),
        (managed(-1500.0, every_s=25.0), "too few reports to tell"),
        (managed(-2600.0), "steeper than what is beside it"),
        (managed(-2000.0, seconds=0.0, after_s=400.0), "idle all the way"),
        (flown(TIME, 32 * np.round(np.where(TIME < 100, -3000.0, -2100 + 80 * (TIME - 100) / 60) / 32)), "Mach to CAS"),
        *(
            (flown(TIME, np.where(before_s > TIME, rate_fpm - 600, rate_fpm)), "one CAS, or Mach before it")
            for before_s, rate_fpm in product((0.0, 100.0), (-1800.0, -2100.0, -2400.0))
        ),
    ],
)
def test_what_is_not_taken_for_managed(rows: pl.DataFrame, why: str) -> None:
    assert len(ConstantRate().keep(rows)) == len(rows), why


def test_a_managed_stretch_parts_what_stands_around_it() -> None:
    rows = managed(-1500.0).with_columns(pl.lit(0, pl.Int64).alias(SEGMENT))
    assert ConstantRate().keep(rows)[SEGMENT].n_unique() == 2


def test_of_two_descents_the_larger_is_kept() -> None:
    height = [30_000.0, 29_000.0, 28_000.0, 29_500.0, 27_000.0, 24_000.0, 21_000.0]
    rows = rows_at(EVERY_10_S[:7], altitude=height)
    assert seconds_left(LargestDescent().keep(rows)) == [30.0, 40.0, 50.0, 60.0]
    ripple = rows.with_columns(altitude=pl.Series([3e4, 29e3, 28e3, 28.9e3, 27e3, 24e3, 21e3]))
    assert len(LargestDescent().keep(ripple)) == 7


def test_rows_not_below_all_before_go() -> None:
    rows = rows_at(EVERY_10_S[:6], altitude=[1000.0, 975.0, 975.0, 1000.0, 950.0, 925.0])
    assert seconds_left(Falling().keep(rows)) == [0.0, 10.0, 40.0, 50.0]


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
