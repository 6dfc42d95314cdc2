"""Filters on hand-made rows of which every drop is known."""

from itertools import product

import numpy as np
import polars as pl
import pytest
from numpy.typing import NDArray
from surveillance_toys import rows_at

from descentflow.surveillance.cleaning._descent_filters import Descending, Falling, LargestDescent, SteadyDescent
from descentflow.surveillance.cleaning._faulty_values import AirspeedsAgree, Despike
from descentflow.surveillance.cleaning._filters import SEGMENT, filtered
from descentflow.surveillance.cleaning.rates import ConstantRate
from descentflow.surveillance.rows.air_data import cas_of_mach_kt
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
    one = Despike("altitude", 300.0, fastest=100.0)
    assert len(one.keep(rows_at(times, altitude=steep))) == 8
    for end in (0, 7):
        wild = [*steep]
        wild[end] = -900.0 if end == 0 else 45_000.0
        assert seconds_left(one.keep(rows_at(times, altitude=wild))) == [t for t in times if t != times[end]]


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
