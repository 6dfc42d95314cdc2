"""Any memory, any number of partitions, file or store: the same descents and the same account."""

import json
from dataclasses import asdict
from pathlib import Path

import polars as pl
import pytest
from polars.testing import assert_frame_equal
from refusals import refuses
from surveillance_toys import fleet, written

from descentflow.core.errors import ConfigError, DataError
from descentflow.surveillance.cleaning import chain
from descentflow.surveillance.descents import store
from descentflow.surveillance.descents.prepared_descents import Descents, read_descents
from descentflow.surveillance.out_of_core import _groups
from descentflow.surveillance.prepare import Cleaning, prepare


@pytest.fixture(scope="module")
def inputs(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Two files that share aircraft and differ in columns, their rows braided in time: something of everything."""
    rows = fleet(12).with_columns(
        icao24=pl.concat_str(pl.lit("4ca00"), pl.col("icao24").str.slice(5).str.to_integer(strict=False) % 5),
        typecode=pl.when(pl.col("icao24") < "4ca006").then(pl.lit("A320")).otherwise(pl.lit("B738")),
    )
    at = pl.int_range(pl.len())
    rows = rows.with_columns(
        altitude=pl.when(at % 97 == 50).then(pl.col("altitude") + 4000).otherwise("altitude"),
        IAS=pl.when(at % 89 == 3).then(None).otherwise("IAS"),
        vertical_rate=pl.when(at % 3 == 0).then("vertical_rate"),
    )
    folder = tmp_path_factory.mktemp("inputs")
    mixed = rows.sample(fraction=1.0, shuffle=True, seed=1)
    first = mixed.head(len(mixed) // 2).drop("track").with_columns(flight_id=pl.lit("AB12"))
    second = pl.concat([mixed.tail(-(len(mixed) // 2)), mixed.tail(40)])
    return [written(first, folder / "a.parquet"), written(second, folder / "b.parquet")]


@pytest.fixture(scope="module")
def whole(inputs: list[Path]) -> Descents:
    descents = prepare(inputs, cleaning=Cleaning(bottom_fl=100))
    assert descents.frame["flight_id"].n_unique() > 8
    assert all(step.flights_left is None or step.flights_left for step in descents.report.steps)
    return descents


def same(parted: Descents, whole: Descents) -> None:
    assert_frame_equal(parted.frame, whole.frame, check_exact=True)
    described = {key: value for key, value in parted.metadata.items() if key != "fingerprint"}
    assert described == whole.metadata


@pytest.mark.parametrize("out", ["d.parquet", "store"])
@pytest.mark.parametrize(
    ("memory", "workers", "number"), [(10**9, 2, 1), (800_000, 1, 2), (500_000, 1, 3), (800_000, 5, 5)]
)
def test_descents_do_not_depend_on_memory_or_form(
    memory: int,
    workers: int,
    number: int,
    out: str,
    inputs: list[Path],
    whole: Descents,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(_groups, "GROUP_BYTES", 1)
    monkeypatch.setattr(chain, "BATCH_ROWS", 300)
    monkeypatch.setattr(store, "CHUNK_ROWS", 300)
    monkeypatch.setattr(store, "FILE_ROWS", 600)
    said: list[str] = []
    prepared = prepare(
        inputs,
        cleaning=Cleaning(bottom_fl=100),
        out=tmp_path / out,
        memory_bytes=memory,
        workers=workers,
        progress=said.append,
    )
    partitions = [int(words.split()[-1]) for words in said if words.startswith("cleaning rows")]
    assert max(partitions) == 1 if number == 1 else max(partitions) >= number
    descents = read_descents(tmp_path / out)
    same(descents, whole)
    assert prepared.flights == dict(
        whole.frame.group_by("typecode").agg(pl.col("flight_id").n_unique()).sort("typecode").iter_rows()
    )
    assert [path.name for path in tmp_path.iterdir()] == [out]


def test_a_store_is_partitioned_by_type_and_says_how_it_was_made(
    inputs: list[Path], whole: Descents, tmp_path: Path
) -> None:
    rules = Cleaning(bottom_fl=100)
    prepare(inputs, cleaning=rules, out=tmp_path / "s")
    hive = pl.scan_parquet(tmp_path / "s" / "**" / "*.parquet", hive_partitioning=True).collect()
    assert_frame_equal(hive.select(whole.frame.columns).sort("flight_id", maintain_order=True), whole.frame)
    assert {p.name for p in (tmp_path / "s").iterdir()} == {"typecode=A320", "typecode=B738", "_descentflow.json"}
    manifest = json.loads((tmp_path / "s" / "_descentflow.json").read_text())
    assert manifest["schema_version"] == 1
    assert manifest["settings"] == asdict(rules)
    assert [len(file["sha256"]) for file in manifest["inputs"]] == [64, 64]
    assert manifest["report"]["steps"][-1]["flights_left"] == whole.frame["flight_id"].n_unique()


def test_types_of_any_name_stay_inside_the_store(tmp_path: Path) -> None:
    names = ["../A3 20", "..", "A/B", "Ü%2F"]
    rows = pl.concat(
        fleet(4).filter(icao24=f"4ca{n:03d}").with_columns(typecode=pl.lit(name)) for n, name in enumerate(names)
    )
    path = written(rows, tmp_path / "rows.parquet")
    prepare([path], out=tmp_path / "s")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["rows.parquet", "s"]
    descents = read_descents(tmp_path / "s").frame
    assert_frame_equal(descents, prepare([path]).frame)
    assert set(descents["typecode"]) == {name.upper() for name in names}


def test_a_finished_store_is_left_alone_and_another_refused(inputs: list[Path], tmp_path: Path) -> None:
    out = tmp_path / "s"
    first = prepare(inputs, out=out)
    times = {path: path.stat().st_mtime_ns for path in out.rglob("*")}
    again = prepare(inputs, out=out)
    assert again.flights == first.flights
    assert again.report.as_dict() == first.report.as_dict()
    assert {path: path.stat().st_mtime_ns for path in out.rglob("*")} == times
    refuses(ConfigError, "other inputs or settings", prepare, inputs, cleaning=Cleaning(bottom_fl=100), out=out)
    refuses(ConfigError, "other inputs or settings", prepare, inputs[:1], out=out)
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.tex").write_text("x")
    refuses(ConfigError, "no prepared store", prepare, inputs, out=tmp_path / "mine")


@pytest.mark.parametrize("out", ["s", "d.parquet"])
def test_an_output_among_the_inputs_is_none_of_them(out: str, inputs: list[Path], tmp_path: Path) -> None:
    for path in inputs:
        (tmp_path / path.name).write_bytes(path.read_bytes())
    first = prepare([tmp_path], out=tmp_path / out)
    (tmp_path / f"{out}.work").mkdir()
    (tmp_path / f"{out}.work" / "left.arrow").write_bytes(b"a killed run left this")
    said: list[str] = []
    again = prepare([tmp_path], out=tmp_path / out, progress=said.append)
    assert again.metadata["inputs"] == first.metadata["inputs"]
    assert ("found finished" not in said) == (out == "d.parquet")


def test_damaged_stores_are_refused(inputs: list[Path], tmp_path: Path) -> None:
    out = tmp_path / "s"
    prepare(inputs, out=out)
    manifest = out / "_descentflow.json"
    good = manifest.read_text()
    for bad, words in (
        ("{", "damaged description"),
        ("[]", "damaged description"),
        ("{}", "its list of files"),
        (good.replace('"schema_version": 1', '"schema_version": 9'), "version 1"),
        (good.replace('"rows": ', '"rows": 1'), "rows; expected"),
        (good.replace("part-00000", "part-77777"), "a store as it was written"),
    ):
        manifest.write_text(bad)
        refuses(DataError, words, read_descents, out)
    manifest.unlink()
    refuses(DataError, r"without a readable _descentflow.json", read_descents, out)


def test_an_aircraft_that_does_not_fit_is_named(tmp_path: Path) -> None:
    path = written(fleet(2).with_columns(icao24=pl.lit("4ca009")), tmp_path / "rows.parquet")
    with pytest.raises(DataError, match=r"rows .* of 1 aircraft, such as 4ca009, .* raise --memory"):
        prepare([path], out=tmp_path / "d.parquet", memory_bytes=50_000)
    assert [p.name for p in tmp_path.iterdir()] == ["rows.parquet"]
