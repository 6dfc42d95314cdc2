"""Flights that come again by another clock count once, and flights that are only alike are all kept."""

import polars as pl
import pytest
from surveillance_toys import fleet, flight

from descentflow.core.errors import DescentflowWarning
from descentflow.surveillance.prepare import prepare


def of_another_receiver(rows: pl.DataFrame, hours: float) -> pl.DataFrame:
    """The same flights by another clock, two seconds and an encoder's step apart."""
    shift = pl.duration(seconds=int(3600 * hours) + 2)
    return rows.with_columns(pl.col("timestamp") + shift, pl.col("altitude") + 25)


@pytest.mark.parametrize("rates", [True, False])
@pytest.mark.parametrize("hours", [0.5, 1, 2, 5.5, -1])
def test_each_flight_is_kept_once_and_the_shift_is_named(hours: float, rates: bool) -> None:
    rows = fleet(5).drop(() if rates else "vertical_rate")
    once = prepare(rows)
    with pytest.warns(DescentflowWarning, match=rf"rows that come again {abs(hours):g} h later, of another clock"):
        both = prepare(pl.concat([rows, of_another_receiver(rows, hours)]))
    assert both.flights == once.flights
    step = next(one for one in both.report.steps if one.step == "other_clock")
    assert step.rows_dropped == len(rows)
    if hours > 0:
        assert both.frame["time_s"].to_list() == once.frame["time_s"].to_list()


def test_flights_longer_than_the_shift_are_separated_row_by_row() -> None:
    """Both clocks' rows of one flight lie in each other: half an hour of level flight before the descent."""
    ahead = flight().head(1)
    level = [ahead.with_columns(pl.col("timestamp") - pl.duration(seconds=5 * k)) for k in range(600, 0, -1)]
    rows = pl.concat([*level, flight()])
    with pytest.warns(DescentflowWarning, match=r"come again 0.5 h later"):
        both = prepare(pl.concat([rows, of_another_receiver(rows, 0.5)]))
    assert both.flights == {"A320": 1}
    # Its own level rows half an hour before may stand for a copy: only the first levels depend on them.
    assert len(both.frame) == pytest.approx(len(prepare(rows).frame), abs=10)


def test_alike_flights_of_an_aircraft_an_hour_apart_are_all_kept(recwarn: pytest.WarningsRecorder) -> None:
    other = flight(top_ft=34_000.0, start_s=3600.0).with_columns(pl.col("altitude") * 0.99)
    found = prepare(pl.concat([flight(), other]))
    assert found.flights == {"A320": 2}
    assert not recwarn.list


def test_flights_at_other_speeds_on_the_hour_are_all_kept(recwarn: pytest.WarningsRecorder) -> None:
    """They pass the same levels at the same times past the hour, as flights of a simulated day may."""
    faster = flight(start_s=3600.0).with_columns(pl.col("IAS") + 6.0)
    assert prepare(pl.concat([flight(), faster])).flights == {"A320": 2}
    assert not recwarn.list
