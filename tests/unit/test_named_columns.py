"""Columns of other names, Mach where rows have none, and tables of types that fit no row."""

from pathlib import Path

import numpy as np
import polars as pl
import pytest
from polars.testing import assert_frame_equal
from surveillance_toys import fleet

from descentflow.cli.entry import main
from descentflow.core.errors import ConfigError, DataError
from descentflow.surveillance.descents.prepared_descents import read_descents
from descentflow.surveillance.open_descents import FlightSource
from descentflow.surveillance.prepare import prepare


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
