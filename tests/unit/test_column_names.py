"""Columns of other names and of a radar feed, computed ones, and tables of types that fit no row."""

from pathlib import Path

import numpy as np
import polars as pl
import polars.selectors as cs
import pytest
from polars.testing import assert_frame_equal
from surveillance_toys import fleet

from descentflow.cli.entry import main
from descentflow.core.errors import ConfigError, DataError
from descentflow.surveillance.descents.prepared_descents import read_descents
from descentflow.surveillance.open_descents import FlightSource
from descentflow.surveillance.prepare import prepare
from descentflow.surveillance.read_rows import read_rows
from descentflow.surveillance.rows._column_names import LEVEL_NAMES, row_names
from descentflow.surveillance.rows.drop_report import DropReport
from descentflow.surveillance.rows.schema import ALIASES, COLUMNS, TRADE


@pytest.mark.parametrize("suffix", ["parquet", "csv", "feather", "json"])
def test_a_column_of_another_name_is_the_same_column(suffix: str, tmp_path: Path) -> None:
    rows = fleet().with_columns(timestamp=pl.col("timestamp").dt.epoch("us") / 1e6)
    renamed = rows.rename({"altitude": "height, ft", "vertical_rate": "climb"}).with_columns(altitude=pl.lit(0.0))
    path = tmp_path / f"rows.{suffix}"
    write = {"parquet": renamed.write_parquet, "csv": renamed.write_csv, "feather": renamed.write_ipc}
    write.get(suffix, renamed.write_json)(path)
    prepared = prepare(path, columns={"altitude": "height, ft", "vertical_rate": "climb"})
    # JSON and CSV write numbers out to the last digit, so that all are the same numbers.
    assert_frame_equal(prepared.frame, prepare(rows).frame)


def test_the_command_takes_names_and_says_which_are_wrong(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, out = tmp_path / "rows.parquet", tmp_path / "descents.parquet"
    fleet().rename({"altitude": "my_height"}).write_parquet(path)
    words = ["prepare", str(path), "--out", str(out)]
    assert main([*words, "--column", "altitude=my_height"]) == 0
    assert_frame_equal(read_descents(out).frame, prepare(fleet()).frame)
    assert main(words) == 2
    assert "has no column altitude" in (said := capsys.readouterr().err)
    assert "--column altitude=alt_ft" in said
    assert main([*words, "--column", "altitude=other"]) == 2
    assert "has no column other (it has" in capsys.readouterr().err
    assert main([*words, "--column", "height=my_height"]) == 2
    assert "a column for height; expected one of timestamp" in capsys.readouterr().err
    assert main([*words, "--column", "altitude=a", "--column", "altitude=b"]) == 2
    assert "each name once" in capsys.readouterr().err
    with pytest.raises(ConfigError, match="one column for several of altitude, IAS"):
        prepare(path, columns={"altitude": "x", "IAS": "x"})


def test_names_are_part_of_what_a_store_was_made_of(tmp_path: Path) -> None:
    path, out = tmp_path / "rows.parquet", tmp_path / "store"
    fleet().with_columns(other=pl.col("altitude") - 500).write_parquet(path)
    prepare(path, out=out)
    with pytest.raises(ConfigError):
        prepare(path, out=out, columns={"altitude": "other"})


def test_mach_is_computed_where_rows_have_none(tmp_path: Path) -> None:
    rows = fleet()
    whole, computed = prepare(rows), prepare(rows.drop("Mach"), out=tmp_path / "descents.parquet")
    both = whole.frame.join(computed.frame, on=["flight_id", "level_fl"], suffix="_computed")
    assert len(both) == len(whole.frame) == len(computed.frame)
    # The toys make Mach of IAS by the same standard relation; levels lie between reports.
    assert np.abs(both["Mach"] - both["Mach_computed"]).max() < 1e-4
    again = read_descents(tmp_path / "descents.parquet")
    assert (whole.computed, again.computed) == ([], ["Mach"])
    assert "values of Mach computed from IAS and altitude" in str(again.report)
    assert "Mach is computed from IAS and altitude" in str(again)
    assert "Mach" in again.frame.columns
    assert "Mach" not in again.reported.columns
    assert FlightSource(tmp_path / "descents.parquet").descents().computed == ["Mach"]


@pytest.mark.parametrize("every", [None, 10, 5])
def test_mach_is_computed_where_most_rows_lack_it(every: int | None) -> None:
    rows = fleet()
    whole, number = prepare(rows), pl.int_range(pl.len())
    has = pl.lit(False) if every is None else number % every == 0
    prepared = prepare(rows.with_columns(Mach=pl.when(has).then("Mach")))
    assert len(prepared.frame) == len(whole.frame)
    assert (prepared.frame["Mach"] - whole.frame["Mach"]).abs().max() < 1e-4
    assert prepared.computed == ["Mach"]
    kept = 0 if every is None else len(rows.gather_every(every))
    assert prepared.report.notes["values of Mach computed from IAS and altitude"] == len(rows) - kept
    some = prepare(rows.with_columns(Mach=pl.when(number % 3 > 0).then("Mach")))
    assert (some.computed, some.report.notes["rows without Mach"]) == ([], len(rows.gather_every(3)))


@pytest.mark.parametrize("empty", [False, True])
def test_ias_is_computed_where_rows_have_mach_alone(empty: bool) -> None:
    rows = fleet()
    lacking = rows.with_columns(IAS=pl.lit(None, pl.Float64)) if empty else rows.drop("IAS")
    whole, computed = prepare(rows), prepare(lacking)
    both = whole.frame.join(computed.frame, on=["flight_id", "level_fl"], suffix="_computed")
    assert len(both) == len(whole.frame) == len(computed.frame)
    assert np.abs(both["IAS"] - both["IAS_computed"]).max() < 0.05
    assert computed.report.notes["values of IAS computed from Mach and altitude"] == len(rows)
    assert "IAS is computed from Mach and altitude" in str(computed)
    assert (computed.computed, "IAS" in computed.reported.columns) == (["Mach"], True)  # one of the two is left out


@pytest.mark.parametrize("target", [None, "store"])
def test_types_that_name_no_row_are_told_with_the_addresses_of_both(target: str | None, tmp_path: Path) -> None:
    rows = pl.concat([fleet(3), fleet(1)]).unique().drop("typecode")
    types = pl.DataFrame({"icao24": ["ABC123", "abc124"], "typecode": ["A320", "B738"]})
    out = None if target is None else tmp_path / target
    with pytest.raises(DataError) as caught:
        prepare(rows, types=types, out=out)
    assert "0 of its 2 addresses (abc12" in caught.value.got
    assert f"are among the 3 of the {len(rows):,} rows" in caught.value.got
    busiest = rows["icao24"].value_counts(sort=True).row(0)
    assert f"the busiest of which are {busiest[0]} ({busiest[1]:,} rows)" in caught.value.expected
    empty = pl.DataFrame(
        {"icao24": ["4CA001"], "typecode": [None]}, schema={"icao24": pl.String, "typecode": pl.String}
    )
    with pytest.raises(DataError, match=r"1 of its 1 addresses \(4ca001\).*without a type"):
        prepare(rows, types=empty)


def test_blanks_about_names_and_values_are_none(tmp_path: Path) -> None:
    path = tmp_path / "rows.csv"
    fleet().write_csv(tmp_path / "plain.csv")
    path.write_text((tmp_path / "plain.csv").read_text().replace(",", " , "))
    assert_frame_equal(prepare(path).frame, prepare(tmp_path / "plain.csv").frame)


def test_flight_levels_in_words_are_refused_with_the_first() -> None:
    levels = (pl.col("altitude") / 100).round().cast(pl.Int64).cast(pl.String)
    rows = fleet().select(pl.exclude("altitude"), FL="FL" + levels)
    with pytest.raises(DataError, match=r"of FL cannot be read \(the first: 'FL\d+'\); expected numbers, in hun"):
        prepare(rows)


def test_columns_are_read_from_names_of_folders(tmp_path: Path) -> None:
    rows = fleet().with_columns(day=pl.lit("2024 03/01"))
    for name in ("typecode", "icao24", "day"):
        rows.write_parquet(pl.PartitionBy(tmp_path / name, key=name, include_key=False))
        assert_frame_equal(prepare(tmp_path / name).frame, prepare(rows).frame, check_row_order=False)


def test_rows_in_the_folder_of_no_type_have_none_and_a_column_counts_before_a_folder(tmp_path: Path) -> None:
    folder = tmp_path / "typecode=__HIVE_DEFAULT_PARTITION__"
    folder.mkdir()
    fleet().drop("typecode").write_parquet(folder / "0.parquet")
    with pytest.raises(DataError, match="rows without any typecode"):
        prepare(folder)
    fleet().write_parquet(folder / "0.parquet")
    assert_frame_equal(prepare(folder).frame, prepare(fleet()).frame)


def test_types_are_read_from_the_list_of_opensky(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its quotes are single, around some values only, doubled within, and lines go on inside of them."""
    monkeypatch.setattr("descentflow.surveillance.formats._tables.CSV_BYTES", 120)
    rows = fleet()
    listed = [f"'{one}','2017-09-16 01:00:00',0,'O''Brien, \"Air\"\nLtd','A320'" for one in rows["icao24"].unique()]
    path = tmp_path / "aircraft-database-complete.csv"
    path.write_text("\n".join(["'icao24','timestamp','adsb','owner','typecode'", "'000001',,0,,", *listed, ""]))
    assert_frame_equal(prepare(rows.drop("typecode"), types=path).frame, prepare(rows).frame)


FEED = {"callsign": "ACID", "icao24": "MODE_S", "timestamp": "TIME_UTC", "IAS": "IAS_KT", "Mach": "MACH"}
FEED |= {"vertical_rate": "ROCD", "track": "TRK"}


@pytest.fixture(scope="module")
def rows() -> pl.DataFrame:
    return fleet(3)


@pytest.fixture(scope="module")
def feed(rows: pl.DataFrame) -> pl.DataFrame:
    levels = (pl.col("altitude") / 100).alias("FL")
    return rows.with_columns(levels).drop("altitude").rename(FEED).with_columns(SQUAWK=pl.lit("1000"), MODE=pl.lit(3))


@pytest.mark.parametrize("ending", ["parquet", "csv", "feather", "json"])
def test_a_radar_feed_is_read_as_it_is(ending: str, feed: pl.DataFrame, rows: pl.DataFrame, tmp_path: Path) -> None:
    path = tmp_path / f"feed.{ending}"
    frame = feed.with_columns(pl.col("TIME_UTC").dt.epoch("us") / 1e6) if ending in ("json", "csv") else feed
    if ending == "json":  # recognised by the names of time and address
        frame = frame.rename({"TIME_UTC": "timestamp", "MODE_S": "icao24"})
    write = {"parquet": frame.write_parquet, "csv": frame.write_csv, "feather": frame.write_ipc}
    write.get(ending, frame.write_json)(path)
    report = DropReport()
    rows_read = read_rows([path], report)
    both = (frame_of.select(sorted(rows.columns)).with_columns(cs.float().round(6)) for frame_of in (rows_read, rows))
    assert_frame_equal(*both, check_exact=True)
    assert report.notes == {
        "rows whose columns are not used: SQUAWK, MODE": len(rows),
        "altitudes made of flight levels (column FL), times 100": len(rows),
    }


def test_surer_names_go_first_and_others_are_told(rows: pl.DataFrame) -> None:
    doubled = rows.with_columns(ROCD=pl.lit(-1.0), FL=pl.lit(1.0), time_utc=pl.lit("noon"), ALT_FT=pl.lit(0.0))
    report = DropReport()
    assert_frame_equal(read_rows([doubled], report), rows)
    assert report.notes == {"rows whose columns are not used: ROCD, FL, time_utc, ALT_FT": len(rows)}
    assert row_names(["FL", "ALT_FT"]) == {"FL": "FL", "ALT_FT": "altitude"}
    both = rows.rename({"altitude": "ALT_FT"}).with_columns(FL=pl.lit(1.0))
    assert_frame_equal(read_rows([both], DropReport()), rows)


def test_flight_levels_of_another_name_and_feet_in_their_place(rows: pl.DataFrame) -> None:
    levels = rows.with_columns(level=pl.col("altitude") / 100).drop("altitude")
    assert_frame_equal(prepare(levels, columns={"FL": "level"}).frame, prepare(rows).frame)
    wrong = rows.with_columns(altitude=pl.col("altitude") / 100)
    assert_frame_equal(prepare(wrong, columns={"FL": "altitude"}).frame, prepare(rows).frame)
    with pytest.raises(DataError, match=r"column FL holds .* which is no flight level.*--column altitude=FL"):
        prepare(rows.rename({"altitude": "FL"}))


def test_a_column_can_be_multiplied(rows: pl.DataFrame, tmp_path: Path) -> None:
    metric = rows.with_columns(alt_m=pl.col("altitude") * 0.3048, speed=pl.col("IAS") * 1.852).drop("altitude", "IAS")
    path, out = tmp_path / "rows.csv", tmp_path / "out.parquet"
    metric.write_csv(path)
    words = ["--column", "altitude=alt_m*3.28084", "--column", "IAS=speed*0.539957"]
    assert main(["prepare", str(path), "--out", str(out), *words]) == 0
    both = prepare(rows).frame.join(pl.read_parquet(out), on=["flight_id", "level_fl"], suffix="_m")
    assert len(both) == len(prepare(rows).frame)
    assert (both["IAS"] - both["IAS_m"]).abs().max() < 0.01
    with pytest.raises(ConfigError, match="timestamp times 2"):
        prepare(rows, columns={"timestamp": "timestamp*2"})
    with pytest.raises(DataError, match="has no column alt_ft"):
        prepare(rows, columns={"altitude": "alt_ft*2"})
    starred = rows.rename({"altitude": "a*2"})
    assert_frame_equal(prepare(starred, columns={"altitude": "a*2"}).frame, prepare(rows).frame)


def test_an_error_names_columns_as_the_file_has_them(feed: pl.DataFrame) -> None:
    with pytest.raises(DataError, match=r"no column altitude, IAS, Mach \(it has MODE_S, TIME_UTC, GS\)"):
        read_rows([feed.select("MODE_S", "TIME_UTC", GS=pl.lit(400.0))], DropReport())


def test_the_page_on_sources_lists_every_name() -> None:
    page = (Path(__file__).resolve().parents[2] / "docs" / "how-to" / "sources_of_rows.md").read_text()
    assert [name for name in (*COLUMNS, *ALIASES, *TRADE, *LEVEL_NAMES) if f"`{name}`" not in page] == []
