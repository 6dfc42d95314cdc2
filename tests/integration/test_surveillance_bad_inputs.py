"""Bad inputs to `descentflow prepare`: each ends in a clear message (status 2) or a counted drop, no traceback."""

import json
from collections.abc import Callable
from pathlib import Path

import polars as pl
import pytest
from surveillance_toys import fleet, flight, written

from descentflow.cli.entry import main


@pytest.fixture(scope="module")
def good() -> pl.DataFrame:
    return fleet(3)


class Prepared:
    """One call of the command."""

    def __init__(self, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
        self.folder, self.capsys = folder, capsys
        self.out = folder / "out" / "descents.parquet"
        self.out.parent.mkdir()

    def __call__(self, *words: object, out: Path | None = None) -> int:
        report = self.out.with_suffix(".json")
        status = main(["prepare", *map(str, words), "--out", str(out or self.out), "--report", str(report)])
        self.error = self.capsys.readouterr().err
        self.report = json.loads(report.read_text())["report"] if report.exists() else None
        return status

    def refuses(self, *words: object, saying: str, out: Path | None = None) -> None:
        assert self(*words, out=out) == 2
        assert saying in self.error
        assert "Traceback" not in self.error
        assert "to mend it" in self.error
        assert not list(self.out.parent.iterdir()), "a failed run must leave nothing behind"

    def dropped(self, step: str) -> int:
        return next(s["rows_dropped"] for s in self.report["steps"] if s["step"] == step)


@pytest.fixture
def prepare(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Prepared:
    return Prepared(tmp_path, capsys)


Change = Callable[[pl.DataFrame], pl.DataFrame]
REFUSED_TABLES: dict[str, tuple[Change, str]] = {
    "header only": (lambda f: f.clear(), "no row in"),
    "geoaltitude in metres": (
        lambda f: f.with_columns(geoaltitude=pl.col("altitude") * 0.3048 + 300),
        "geoaltitude seems to be in metres",
    ),
    "temperature in Celsius": (
        lambda f: f.with_columns(temperature=15 - pl.col("altitude") * 0.00198),
        "temperature seems to be in degrees Celsius",
    ),
    "rate in hundreds": (
        lambda f: f.with_columns(pl.col("vertical_rate") / 100),
        "vertical_rate seems to be in hundreds of ft/min",
    ),
    "times cut to the minute": (
        lambda f: f.with_columns(pl.col("timestamp").dt.truncate("1m")),
        "times are cut to the minute",
    ),
    "all of one time": (lambda f: f.with_columns(pl.col("timestamp").first()), "the time of another row"),
    "no IAS": (lambda f: f.drop("IAS", "Mach"), "no column IAS"),
    "no time": (lambda f: f.drop("timestamp"), "no column timestamp"),
    "two columns for one": (
        lambda f: f.rename({"IAS": "ias"}).with_columns(indicated_airspeed=pl.col("ias")),
        "two columns for IAS",
    ),
    "no descents": (lambda f: f.with_columns(altitude=pl.lit(11e3), vertical_rate=pl.lit(0.0)), "IAS"),
    "level flight": (lambda f: f.filter(pl.col("vertical_rate") == 0), "no free descent"),
    "climbs": (lambda f: f.reverse().with_columns(f["timestamp"], -pl.col("vertical_rate")), "no free descent"),
    "no types": (lambda f: f.drop("typecode"), "rows without any typecode"),
    "text for every number": (lambda f: f.with_columns(IAS=pl.lit("fast")), "values of IAS cannot be read"),
    "text for every time": (lambda f: f.with_columns(timestamp=pl.lit("noon")), "values of timestamp cannot be read"),
    "all airspeeds NaN": (
        lambda f: f.with_columns(IAS=pl.lit(float("nan")), Mach=pl.lit(float("nan"))),
        "rows lack a value (IAS in",
    ),
    "huge altitudes": (lambda f: f.with_columns(altitude=pl.lit(1e308)), "a value of altitude outside"),
    "huge times": (lambda f: f.with_columns(timestamp=pl.lit(1e300)), "values of timestamp cannot be read"),
}


@pytest.mark.parametrize("ending", ["csv", "parquet"])
@pytest.mark.parametrize("kind", REFUSED_TABLES)
def test_tables_that_cannot_be_used_are_refused(kind: str, ending: str, good: pl.DataFrame, prepare: Prepared) -> None:
    change, words = REFUSED_TABLES[kind]
    prepare.refuses(written(change(good), prepare.folder / f"rows.{ending}"), saying=words)


@pytest.mark.parametrize(
    ("column", "value", "words"),
    [
        ("altitude", pl.Series([[1.0]]), "of type List"),
        ("altitude", pl.Series([{"feet": 1.0}]), "of type Struct"),
        ("icao24", pl.Series([b"\xff\xfe"]), "of type Binary"),
        ("timestamp", pl.Series(["2024-03-01"]).str.to_date(), "of type Date"),
    ],
)
def test_columns_of_types_that_hold_no_number_are_refused(column, value, words, good, prepare) -> None:
    frame = good.with_columns(pl.lit(value).first().alias(column))
    prepare.refuses(written(frame, prepare.folder / "rows.parquet"), saying=words)


BYTES: dict[str, tuple[str, bytes, str]] = {
    "empty file": ("rows.csv", b"", "take it out of what is read"),
    "blanks": ("rows.csv", b"\n \n", "holds no text"),
    "corrupt gzip": ("rows.csv.gz", b"\x1f\x8b\x08\x00" + bytes(range(90)), "invalid block type"),
    "not UTF-8": ("rows.csv", "timestamp,icao24,altitude\n1,ä,3\n".encode("latin-1"), "not UTF-8 at byte 28"),
    "binary": ("rows.bin", bytes(range(256)), "neither text nor"),
    "semicolons": ("rows.csv", b"timestamp;icao24\n1;a\n", "without commas"),
    "other JSON": ("rows.json", b'{"states": [[1, 2]]}', "JSON of no known kind"),
    "deep JSON": ("rows.json", b"[" * 200_000, "nested too deeply"),
    "broken JSON line": ("rows.json", b'{"now": 1, "aircraft": []}\n{"now": 2, "aircr\n', "line 2: not JSON"),
    "cut JSON": ("rows.json", b'{"now": 1, "aircraft": [', "line 1: not JSON"),
    "long number in JSON": ("rows.json", b'{"now": 1' + b"0" * 5000 + b', "aircraft": []}', "digits"),
    "false Parquet": ("rows.parquet", b"PAR1 and nothing more", "whole, readable file"),
    "ragged CSV": (
        "rows.csv",
        b"timestamp,icao24,altitude,IAS,Mach\n1,a,30000,270,0.7\n2,a,29000,270,0.7,9,9\n",
        "no more fields than the first names",
    ),
    "open quote": ("rows.csv", b'timestamp,icao24,altitude,IAS,Mach\n1,"a,30000,270,0.7\n2,a,2,2,2\n', "prepare"),
}


@pytest.mark.parametrize("kind", BYTES)
def test_files_that_cannot_be_read_are_refused(kind: str, prepare: Prepared) -> None:
    name, content, words = BYTES[kind]
    path = prepare.folder / name
    path.write_bytes(content)
    prepare.refuses(path, saying=words)


def test_paths_that_lead_nowhere_are_refused(good: pl.DataFrame, prepare: Prepared) -> None:
    rows = written(good, prepare.folder / "rows.parquet")
    (prepare.folder / "bare").mkdir()
    prepare.refuses(prepare.folder / "absent.parquet", saying="no file or folder")
    prepare.refuses(prepare.folder / "bare", saying="no file in the folders given")
    prepare.refuses(rows, saying="folder that does not exist", out=prepare.folder / "absent" / "d.parquet")
    (prepare.folder / "folder.parquet").mkdir()
    prepare.refuses(rows, saying="is a folder", out=prepare.folder / "folder.parquet")
    prepare.refuses(rows, saying="also an input", out=rows)
    prepare.refuses(saying="no rows")
    assert pl.read_parquet(rows).equals(good), "the input must survive"


def test_types_that_do_not_fit_are_refused(good: pl.DataFrame, prepare: Prepared) -> None:
    rows = written(good, prepare.folder / "rows.parquet")
    untyped = written(good.drop("typecode"), prepare.folder / "untyped.parquet")
    types = prepare.folder / "types.csv"
    types.write_text("aircraft,kind\n4ca000,A320\n")
    prepare.refuses(untyped, "--types", types, saying="types.csv: a types table without icao24, typecode")
    prepare.refuses(untyped, "--typecode", "A320", saying="it only selects among those")
    types.write_text("icao24,typecode\nffffff,A320\n")
    prepare.refuses(untyped, "--types", types, saying="a types table that names the type of no row")
    prepare.refuses(untyped, "--types", prepare.folder / "absent.csv", saying="absent.csv")
    prepare.refuses(rows, "--typecode", "B738", saying="no row of type B738; expected one of A320")


def test_single_bad_values_are_counted_and_cost_no_flight(good: pl.DataFrame, prepare: Prepared) -> None:
    text = good.with_columns(pl.col("IAS", "Mach", "altitude", "vertical_rate").cast(pl.String))
    index = pl.int_range(pl.len())
    broken = text.with_columns(
        IAS=pl.when(index == 90).then(pl.lit("n/a")).when(index == 92).then(pl.lit("NaN")).otherwise("IAS"),
        Mach=pl.when(index == 94).then(pl.lit("1e308")).when(index == 96).then(pl.lit("-inf")).otherwise("Mach"),
        altitude=pl.when(index == 98).then(pl.lit("1e6")).otherwise("altitude"),
        vertical_rate=pl.when(index == 100).then(pl.lit("1e300")).otherwise("vertical_rate"),
    )
    assert prepare(written(broken, prepare.folder / "rows.csv")) == 0
    assert prepare.dropped("missing_value") == 3
    assert prepare.dropped("impossible_Mach") == 1
    assert prepare.dropped("impossible_altitude") == 1
    assert prepare.report["notes"]["values of IAS that could not be read"] == 1
    assert prepare.report["notes"]["impossible values of vertical_rate set to missing"] == 1
    assert prepare.report["steps"][-1]["flights_left"] == 3


def test_a_clock_that_jumps_cannot_bend_a_descent(prepare: Prepared) -> None:
    plain = flight()
    assert prepare(written(plain, prepare.folder / "plain.parquet")) == 0
    expected = pl.read_parquet(prepare.out)
    jumped = plain.with_columns(
        timestamp=pl.when(pl.int_range(pl.len()) == 60)
        .then(pl.col("timestamp") + pl.duration(days=3))
        .otherwise("timestamp")
    )
    assert prepare(written(jumped, prepare.folder / "rows.parquet")) == 0
    table = pl.read_parquet(prepare.out)
    both = table.join(expected, on="level_fl", suffix="_expected")
    assert len(both) > 0.95 * len(expected)
    # The row that left is bridged over 10 s, in which the rate hardly curves the path.
    assert (both["time_s"] - both["time_s_expected"]).abs().max() < 0.5


def test_one_file_in_metres_among_others_is_named(good: pl.DataFrame, prepare: Prepared) -> None:
    feet = written(pl.concat([good, fleet(8)]), prepare.folder / "feet.parquet")
    metres = written(good.with_columns(pl.col("altitude") * 0.3048), prepare.folder / "metres.csv")
    prepare.refuses(feet, metres, saying="metres.csv: altitude seems to be in metres")
