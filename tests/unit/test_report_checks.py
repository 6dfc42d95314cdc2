"""Checks of the report of all rows: copies, most rows in silence, and rules that leave nothing."""

import warnings
from pathlib import Path

import polars as pl
import pytest
from surveillance_toys import fleet, flight

from descentflow.core.errors import ConfigError, DataError, DescentflowWarning
from descentflow.surveillance.cleaning._flights import OTHER_VALUES
from descentflow.surveillance.cleaning.chain import after_rates, before_rates
from descentflow.surveillance.cleaning.drop_report_checks import REASONS, nothing_left
from descentflow.surveillance.cleaning.thresholds import Cleaning
from descentflow.surveillance.prepare import prepare
from descentflow.surveillance.rows.drop_report import DropReport, Step


def test_a_second_run_of_the_same_addresses_and_times_is_no_copy() -> None:
    rows = fleet(3)
    second = rows.with_columns(pl.col("IAS") + 10)
    with pytest.warns(DescentflowWarning, match=f"{len(rows)} rows with the address and time of another row"):
        prepared = prepare([rows, second])
    assert prepared.report.notes[OTHER_VALUES] == len(rows)
    assert prepared.frame.equals(prepare(rows).frame), "the first are kept"


def test_copies_are_duplicates_and_nothing_more() -> None:
    rows = fleet(3)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        prepared = prepare([rows, rows, rows.with_columns(vertical_rate=pl.lit(None, pl.Float64))])
    assert OTHER_VALUES not in prepared.report.notes
    assert next(s.rows_dropped for s in prepared.report.steps if s.step == "duplicate") == 2 * len(rows)


def test_most_rows_of_many_small_files_do_not_go_in_silence() -> None:
    """Each file has too few aircraft to be refused, and all of them contradict themselves."""
    files = [one.with_columns(pl.col("IAS") * 0.8) for one in fleet(3).partition_by("icao24")]
    with pytest.warns(DescentflowWarning, match="contradict"), pytest.raises(DataError, match="25 kt or more in"):
        prepare(files)
    with pytest.warns(DescentflowWarning, match="contradict"):
        assert prepare(files, cleaning={"airspeeds_differ_kt": 90.0, "spike_agreeing_kt": 90.0}).flights == {"A320": 3}


def test_what_stands_for_no_type_is_none() -> None:
    rows = fleet(3)
    first = pl.col("icao24") == "4ca000"
    prepared = prepare(rows.with_columns(typecode=pl.when(first).then(pl.lit("zzzz")).otherwise("typecode")))
    assert (
        next(s.rows_dropped for s in prepared.report.steps if s.step == "unknown_type")
        == rows.select(first.sum()).item()
    )
    with pytest.raises(DataError, match="rows without any typecode"):
        prepare(rows.with_columns(typecode=pl.lit("XXXX")))
    typed = prepare(
        rows.with_columns(typecode=pl.lit("XXXX")), types=pl.DataFrame({"icao24": ["4ca001"], "typecode": ["B738"]})
    )
    assert typed.flights == {"B738": 1}


@pytest.mark.parametrize("name", ["s2.csv", "out.JSON", "d.tar.gz"])
def test_a_name_of_another_format_makes_no_folder(name: str, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"a name that ends in \.parquet"):
        prepare(fleet(1), out=tmp_path / name)
    assert not list(tmp_path.iterdir())


def test_the_first_line_says_what_took_most_and_the_table_follows() -> None:
    steps = [Step("read", 0, None, 90, None), Step("duplicate", 5, None, 85, None), Step("not_descending", 80, 2, 5, 1)]
    first, *table = str(nothing_left(DropReport([*steps, Step("transient", 5, 1, 0, 0)]), Cleaning())).splitlines()
    assert first.startswith("no free descent is left: 80 of 90 rows do not descend at 500 ft/min or more")
    assert "negative in descent" in first
    assert table == str(DropReport([*steps, Step("transient", 5, 1, 0, 0)])).splitlines()


def test_level_flight_ends_so(tmp_path) -> None:
    rows = flight().with_columns(vertical_rate=pl.lit(-100.0), altitude=pl.lit(35_000.0), Mach=pl.lit(0.79))
    with pytest.raises(DataError, match=r"no free descent is left: [\d,]+ of [\d,]+ rows do not descend"):
        prepare(rows.with_columns(IAS=pl.lit(268.0)))


def test_every_filter_has_its_mend() -> None:
    rules = Cleaning()
    for rule in (*before_rates(rules), *after_rates(rules)):
        message = str(nothing_left(DropReport([Step(rule.reason, 9, 1, 0, 0)]), rules))
        assert "see what that step asks for" not in message, rule.reason
    assert len({why for why, _ in REASONS.values()}) == len(REASONS)
