"""Registers of Mode S come in rows of their own: what is near in time is joined, and what is not is reported."""

import polars as pl
import pytest
from surveillance_toys import flight

from descentflow.core.errors import DataError, DescentflowWarning
from descentflow.surveillance.prepare import prepare
from descentflow.surveillance.rows._values_of_other_rows import JOINED_VALUES, VALUES_APART, with_values_of_other_rows
from descentflow.surveillance.rows.drop_report import DropReport

WHOLE = flight(every_s=2.0).with_columns(TAS=430.0 - 0.2 * pl.int_range(pl.len()), groundspeed=pl.lit(400.0))
EVEN = pl.int_range(pl.len()) % 2 == 0


def apart(own: tuple[str, ...], others: tuple[str, ...]) -> pl.DataFrame:
    """Rows that have one set of columns and the other in turn."""
    columns = [pl.when(EVEN).then(name).alias(name) for name in own]
    return WHOLE.with_columns(*columns, *(pl.when(~EVEN).then(name).alias(name) for name in others))


def test_values_of_rows_in_between_are_joined_as_those_of_raw_mode_s() -> None:
    rows = apart(("IAS", "Mach"), ("TAS", "groundspeed", "track"))
    found = prepare(rows)
    expected = prepare(WHOLE.filter(EVEN))
    assert found.frame["level_fl"].equals(expected.frame["level_fl"])
    for name in ("TAS", "groundspeed", "track"):
        assert (found.frame[name] - expected.frame[name]).abs().max() < 0.05, name
        assert found.report.notes[JOINED_VALUES.format(name=name)] > 100
    assert (
        with_values_of_other_rows(rows, DropReport())
        .drop("TAS", "groundspeed", "track")
        .equals(rows.select(with_values_of_other_rows(rows, DropReport()).columns).drop("TAS", "groundspeed", "track"))
    ), "rows and their order stay"


def test_altitudes_of_rows_in_between_are_interpolated() -> None:
    found = prepare(apart(("IAS", "Mach"), ("altitude",))).frame
    assert found.height == pytest.approx(prepare(WHOLE.filter(EVEN)).frame.height, abs=2)


def test_tables_whose_rows_have_both_stay_as_they_are() -> None:
    some = pl.int_range(pl.len()) % 10 == 0
    rows = WHOLE.with_columns(TAS=pl.when(some).then("TAS"), IAS=pl.when(EVEN | some).then("IAS"))
    report = DropReport()
    assert with_values_of_other_rows(rows, report) is rows
    assert report.notes == {}


def test_what_is_too_far_in_time_is_told() -> None:
    far = pl.col("timestamp") + pl.when(~EVEN).then(pl.duration(hours=2)).otherwise(pl.duration(hours=0))
    with pytest.warns(DescentflowWarning, match=r"320 rows with TAS but without IAS.*values of TAS stand in"):
        found = prepare(apart(("IAS", "Mach"), ("TAS",)).with_columns(timestamp=far))
    assert VALUES_APART.format(name="TAS") in found.report.notes
    with pytest.raises(DataError, match="values of altitude stand in other rows than IAS: put into each row"):
        prepare(apart(("IAS", "Mach"), ("altitude",)).with_columns(timestamp=far))
