"""Columns that a radar feed names, flight levels, factors, and the report on unused columns."""

from pathlib import Path

import polars as pl
import polars.selectors as cs
import pytest
from polars.testing import assert_frame_equal
from surveillance_toys import fleet

from descentflow.cli.entry import main
from descentflow.core.errors import ConfigError, DataError
from descentflow.surveillance.prepare import prepare
from descentflow.surveillance.read_rows import read_rows
from descentflow.surveillance.rows._column_names import LEVEL_NAMES, row_names
from descentflow.surveillance.rows.drop_report import DropReport
from descentflow.surveillance.rows.schema import ALIASES, COLUMNS, TRADE

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
    both = (one.select(sorted(rows.columns)).with_columns(cs.float().round(6)) for one in (rows_read, rows))
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
