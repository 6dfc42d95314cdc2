"""What the report of all rows must not hide: copies are told from other values, and most rows do not go in silence."""

import warnings

import polars as pl
import pytest
from surveillance_toys import fleet

from descentflow.core.errors import DataError, DescentflowWarning
from descentflow.surveillance.cleaning.flights import OTHER_VALUES, in_order
from descentflow.surveillance.prepare import prepare
from descentflow.surveillance.rows.drop_report import DropReport


def test_a_second_run_of_the_same_addresses_and_times_is_no_copy() -> None:
    rows = fleet(3)
    second = rows.with_columns(pl.col("IAS") + 10)
    with pytest.warns(DescentflowWarning, match=f"{len(rows)} of {2 * len(rows):,} rows have the address and the time"):
        found = prepare([rows, second])
    assert found.report.notes[OTHER_VALUES] == len(rows)
    assert found.frame.equals(prepare(rows).frame), "the first are kept"


def test_copies_are_duplicates_and_nothing_more() -> None:
    rows = fleet(3)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = prepare([rows, rows, rows.with_columns(vertical_rate=pl.lit(None, pl.Float64))])
    assert OTHER_VALUES not in found.report.notes
    assert next(s.rows_dropped for s in found.report.steps if s.step == "duplicate") == 2 * len(rows)


def test_each_repetition_is_held_against_the_row_that_is_kept() -> None:
    rows = fleet(1).head(3)
    report = DropReport()
    in_order(pl.concat([rows, rows.with_columns(IAS=1.0), rows.head(1), rows.tail(1).with_columns(IAS=1.0)]), report)
    assert report.notes[OTHER_VALUES] == 4


def test_most_rows_of_many_small_files_do_not_go_in_silence() -> None:
    """Each file has too few aircraft to be refused, and all of them contradict themselves."""
    files = [one.with_columns(pl.col("IAS") * 1.2) for one in fleet(3).partition_by("icao24")]
    with pytest.warns(DescentflowWarning, match="contradict"), pytest.raises(DataError, match="25 kt or more in"):
        prepare(files)
    with pytest.warns(DescentflowWarning, match="contradict"):
        assert prepare(files, cleaning={"airspeeds_differ_kt": 90.0, "spike_agreeing_kt": 90.0}).flights == {"A320": 3}
