"""Every kind of file gives the same rows."""

import errno
import os
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import polars as pl
import pytest
from polars.testing import assert_frame_equal
from refusals import refuses
from surveillance_toys import fleet, flight, written

from descentflow.core.errors import ConfigError, DataError
from descentflow.surveillance.descents.prepared_descents import read_descents
from descentflow.surveillance.formats import aircraft_json
from descentflow.surveillance.prepare import prepare
from descentflow.surveillance.read_rows import read_rows
from descentflow.surveillance.rows._normalise import normalise
from descentflow.surveillance.rows.drop_report import DropReport
from descentflow.surveillance.rows.schema import TIMESTAMP
from descentflow.surveillance.unpacking import files_of

NOON = datetime(2024, 3, 1, 12, 0, 0, 250_000, tzinfo=UTC)
ROW = {"icao24": "4ca001", "altitude": 30_000.0, "IAS": 270.0, "Mach": 0.7}


def normal(**columns: object) -> pl.DataFrame:
    return normalise(pl.DataFrame(columns), Path("rows.csv"), DropReport())


def test_folders_are_read_whole_and_files_of_other_columns_side_by_side(tmp_path: Path) -> None:
    (tmp_path / "day").mkdir()
    written(flight("4ca001"), tmp_path / "day" / "a.parquet")
    written(flight("4ca002").drop("track"), tmp_path / "b.csv")
    (tmp_path / ".hidden").write_text("not rows")
    assert [p.name for p in files_of([tmp_path])] == ["b.csv", "a.parquet"]
    assert files_of([str(tmp_path)]) == files_of(str(tmp_path)) == files_of([tmp_path])
    rows = read_rows([tmp_path], DropReport())
    assert rows.filter(icao24="4ca002")["track"].null_count() == len(flight())
    assert rows["icao24"].n_unique() == 2


def test_a_list_of_types_in_a_folder_of_rows_is_counted_and_left_out(tmp_path: Path) -> None:
    written(flight("4ca001"), tmp_path / "rows.parquet")
    listed = tmp_path / "types.csv"
    listed.write_text("icao24,registration,typecode\n4ca001,EI-DEA,A320\n4ca002,EI-DEB,A320\n")
    report = DropReport()
    assert len(read_rows([tmp_path], report)) == len(flight())
    assert report.notes["rows of lists of types (icao24, typecode), which are no surveillance rows"] == 2
    with pytest.raises(DataError, match=r"but a list of types .*pass the rows, and the list as --types"):
        read_rows([listed], DropReport())


@pytest.mark.parametrize(
    "stamps",
    [
        ["2024-03-01T12:00:00.250Z"],
        ["2024-03-01T13:00:00.250+01:00"],
        ["2024-03-01 12:00:00.250+00:00"],
        ["2024-03-01 12:00:00.250000+00:00"],
        ["2024-03-01 12:00:00.250"],
        ["2024-03-01T12:00:00.250"],
        [" 2024-03-01T12:00:00.250Z "],
        ["1709294400.25"],
        [1709294400.25],
        [1709294400250],
        [1709294400250000],
        [1709294400250000000],
        pl.Series([NOON]).cast(pl.Datetime("ms", "UTC")),
        pl.Series([NOON]).cast(pl.Datetime("ns", "UTC")),
        pl.Series([NOON]).dt.convert_time_zone("Asia/Kolkata"),
        pl.Series([NOON.replace(tzinfo=None)]),
        pl.Series(["2024-03-01T12:00:00.250Z"], dtype=pl.Categorical),
    ],
)
def test_every_way_of_writing_a_time(stamps: object) -> None:
    rows = normal(timestamp=stamps, **ROW)
    assert rows["timestamp"].dtype == TIMESTAMP
    assert rows["timestamp"][0] == NOON


def test_dates_of_several_forms_in_one_column() -> None:
    rows = normal(timestamp=["2024-03-01T12:00:00.25Z", "2024-03-01 12:00:00.25", "2024-03-01 12:00:00.25+00"], **ROW)
    assert rows["timestamp"].to_list() == [NOON] * 3


def test_names_of_other_sources_and_letters_of_any_case() -> None:
    rows = normal(
        ts=[1709294400.25], hex=[" ~ABCDEF "], alt_baro=[3e4], ias=[270], MACH=[0.7], GS=[400], mag_heading=[5]
    )
    assert rows.columns == ["timestamp", "icao24", "altitude", "IAS", "Mach", "groundspeed", "heading"]
    assert rows["icao24"][0] == "abcdef"


def test_snapshots_are_timed_at_the_last_message_and_ground_is_no_altitude() -> None:
    craft = {"hex": "~4CA001", "flight": "TST1  ", "t": "A320", "alt_baro": "ground", "ias": 120, "mach": 0.2}
    air = craft | {"alt_baro": 30_000, "seen": 2.5, "mag_heading": 90.5, "oat": -40, "baro_rate": -1984, "gs": [3]}
    snapshots = [{"now": 1709294400.0, "aircraft": [craft, air]}]
    rows = pl.concat(aircraft_json.rows(snapshots, "aircraft.json", DropReport(), 100))
    assert rows["timestamp"].to_list() == [1709294400.0, 1709294397.5]
    assert rows["altitude"].to_list() == [None, 30_000.0]
    assert rows["callsign"][0] == "TST1"
    assert rows["temperature"][1] == pytest.approx(233.15)
    assert rows["groundspeed"][1] is None
    assert rows["heading"][1] == 90.5


def test_rows_in_memory_are_prepared_like_those_of_a_file(tmp_path: Path) -> None:
    rows = fleet(3)
    path = written(rows, tmp_path / "rows.parquet")
    pandas = pytest.importorskip("pandas")
    arrow = pytest.importorskip("arro3.core")
    whole = prepare(path)
    table = pandas.DataFrame({name: rows[name].to_list() for name in rows.columns})
    for source in (rows, rows.lazy(), table, arrow.Table.from_arrow(rows), [rows.head(1000), rows.tail(-1000)]):
        prepared = prepare(source)
        assert_frame_equal(prepared.frame, whole.frame, check_exact=True)
        assert prepared.report.as_dict() == whole.report.as_dict()
    described = prepare(rows).metadata["inputs"]
    assert described == prepare(rows, out=tmp_path / "d.parquet").metadata["inputs"]
    assert described != prepare(rows.tail(-1)).metadata["inputs"]
    assert_frame_equal(read_descents(tmp_path / "d.parquet").frame, whole.frame, check_exact=True)


def test_tables_that_are_no_rows_are_refused() -> None:
    refuses(ConfigError, "rows of type int", prepare, 3)
    refuses(DataError, "a table in memory has no column timestamp", prepare, pl.DataFrame({"IAS": [250.0]}))
    with pytest.raises(DataError, match="a table in memory: IAS seems to be in m/s"):
        prepare(fleet(3).with_columns(pl.col("IAS") * 0.514444))
    refuses(DataError, "no row in a table in memory", prepare, fleet(1).clear())


def test_samples_are_told_what_takes_flights() -> None:
    table = pl.DataFrame({"sample_id": [0], "level_fl": [330], "CAS": [270.0], "Mach": [0.7]})
    with pytest.raises(DataError, match=r"pass the checkpoint itself.*descentflow export --to traffic"):
        normalise(table, "samples.parquet", DropReport())


def test_empty_files_beside_others_are_left_out_and_counted(tmp_path: Path) -> None:
    written(fleet(1), tmp_path / "rows.parquet")
    for name in ("_SUCCESS", "_committed_123", "day.parquet"):
        (tmp_path / name).touch()
    assert [file.name for file in files_of([tmp_path])] == ["day.parquet", "rows.parquet"]
    prepared = prepare(tmp_path)
    assert prepared.flights == {"A320": 1}
    assert prepared.report.notes["empty files (0 bytes) besides others, left out"] == 1
    refuses(DataError, r"day.parquet is empty.*take it out", prepare, tmp_path / "day.parquet")
    (tmp_path / "rows.parquet").unlink()
    (tmp_path / "other.parquet").touch()
    refuses(DataError, "no row in", prepare, tmp_path)


def test_a_folder_that_may_not_be_listed_is_an_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its rows went missing without a count. A test may run as a user whom no permission stops."""
    (tmp_path / "locked").mkdir()
    written(flight("4ca001"), tmp_path / "a.parquet")
    scandir = os.scandir

    def refused(path: str) -> Any:
        if Path(path).name == "locked":
            raise PermissionError(errno.EACCES, "Permission denied", str(path))
        return scandir(path)

    monkeypatch.setattr(os, "scandir", refused)
    refuses(DataError, r"/locked: Permission denied; expected a folder whose files may be listed", files_of, [tmp_path])
