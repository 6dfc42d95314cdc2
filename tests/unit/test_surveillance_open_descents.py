"""Descents are opened from whatever holds them, and how they were cleaned is never overlooked."""

import warnings
from dataclasses import asdict
from pathlib import Path

import polars as pl
import pytest
from refusals import refuses

from descentflow.core.errors import DataError, DescentflowWarning
from descentflow.simulation.world import simulate
from descentflow.surveillance.cleaning.thresholds import Cleaning, different_settings, kept_cleaning
from descentflow.surveillance.descents.prepared_descents import Descents, read_descents, write_descents
from descentflow.surveillance.open_descents import FlightSource
from descentflow.surveillance.prepare import prepare
from descentflow.training.datamodule import DescentDataModule

STRICT = Cleaning(slowest_fpm=1200.0, transient_s=60.0)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Rows of 30 flights, prepared as a file, as a store, and strictly; and those of 30 others."""
    folder = tmp_path_factory.mktemp("open")
    for seed, name in ((0, ""), (1, "_others")):
        simulate("A320", 30, seed).rows.write_parquet(folder / f"rows{name}.parquet")
        prepare(folder / f"rows{name}.parquet", out=folder / f"descents{name}.parquet")
    prepare(folder / "rows.parquet", out=folder / "store")
    prepare(folder / "rows_others.parquet", out=folder / "strict.parquet", cleaning=STRICT)
    return folder


def without_settings(path: Path, target: Path) -> Path:
    """A prepared file that does not say how it was cleaned."""
    descents = read_descents(path)
    write_descents(Descents(descents.frame, {k: v for k, v in descents.metadata.items() if k != "settings"}), target)
    return target


def test_rows_files_stores_descents_and_tables_open_alike(folder: Path) -> None:
    expected = FlightSource(folder / "rows.parquet").descents()
    frame = read_descents(folder / "descents.parquet").frame
    for source in (str(folder / "descents.parquet"), folder / "store", [folder / "descents.parquet"], expected, frame):
        assert FlightSource(source).descents().frame.equals(expected.frame, null_equal=True)
    assert expected.cleaning == Cleaning()
    assert FlightSource(folder / "store").descents().cleaning == Cleaning()
    assert FlightSource(frame).descents().cleaning is None


def test_rows_in_memory_are_cleaned(folder: Path) -> None:
    expected = read_descents(folder / "descents.parquet").frame
    rows = pl.read_parquet(folder / "rows.parquet")
    for source in (rows, simulate("A320", 30, 0)):
        opened = FlightSource(source).descents()
        assert opened.cleaning == Cleaning()
        assert opened.frame.equals(expected)


def test_rows_are_cleaned_with_the_settings_asked_for_and_that_is_said(folder: Path) -> None:
    said: list[str] = []
    strict = FlightSource(folder / "rows_others.parquet", progress=said.append).for_model(STRICT, 150)
    assert said[0] == "cleaning rows with slowest_fpm 1200.0, transient_s 60.0"
    assert strict.cleaning == STRICT
    assert strict.frame.equals(read_descents(folder / "strict.parquet").frame)
    FlightSource(folder / "rows.parquet", progress=said.append).descents()
    assert "cleaning rows with the default settings" in said


def test_prepared_descents_of_other_settings_are_named(folder: Path) -> None:
    words = (
        r"slowest_fpm is 500 in these descents and 1200 in the model's training descents, "
        r"transient_s is 20 in these descents and 60 in"
    )
    with pytest.warns(DescentflowWarning, match=words):
        FlightSource(folder / "descents.parquet").for_model(STRICT, 150)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        FlightSource(folder / "descents.parquet").for_model(Cleaning(), 150)


def test_descents_that_do_not_say_how_they_were_cleaned(folder: Path, tmp_path: Path) -> None:
    before = without_settings(folder / "descents.parquet", tmp_path / "before.parquet")
    assert read_descents(before).cleaning is None
    with pytest.warns(DescentflowWarning, match="unknown.* prepare the rows with the model"):
        FlightSource(before).for_model(Cleaning(), 150)
    data = DescentDataModule(before)
    with pytest.warns(DescentflowWarning, match="unknown.* prepare the rows again"):
        data.setup()
    assert data.representation.cleaning is None
    with pytest.warns(DescentflowWarning, match="fit the model again"):
        again = FlightSource(folder / "rows.parquet").for_model(data.representation.cleaning, 150)
    assert again.cleaning == Cleaning(bottom_fl=150)


def test_prepared_files_of_one_cleaning_join(folder: Path, tmp_path: Path) -> None:
    (tmp_path / "a.parquet").write_bytes((folder / "descents.parquet").read_bytes())
    (tmp_path / "b.parquet").write_bytes((folder / "descents_others.parquet").read_bytes())
    of_folder = FlightSource(tmp_path).without_rows()
    parts = [read_descents(tmp_path / name) for name in ("a.parquet", "b.parquet")]
    assert of_folder.frame["flight_id"].n_unique() == sum(part.frame["flight_id"].n_unique() for part in parts)
    assert of_folder.cleaning == Cleaning()
    assert len(of_folder.metadata["inputs"]) == 2
    assert of_folder.metadata["report"]["steps"][0]["rows_left"] == sum(
        part.metadata["report"]["steps"][0]["rows_left"] for part in parts
    )
    refuses(
        DataError, "in two of", lambda: FlightSource([tmp_path / "a.parquet", tmp_path / "a.parquet"]).without_rows()
    )


def test_descents_of_mixed_settings_are_refused(folder: Path, tmp_path: Path) -> None:
    (tmp_path / "a.parquet").write_bytes((folder / "descents.parquet").read_bytes())
    (tmp_path / "b.parquet").write_bytes((folder / "strict.parquet").read_bytes())
    for source in (tmp_path, [tmp_path / "a.parquet", tmp_path / "b.parquet"]):
        with pytest.raises(DataError, match=r"slowest_fpm is 1200 in .*b.parquet and 500 in .*a.parquet, transient_s"):
            DescentDataModule(source).setup()


def test_rows_and_prepared_descents_do_not_mix(folder: Path, tmp_path: Path) -> None:
    refuses(
        DataError,
        "together",
        lambda: FlightSource([folder / "rows_others.parquet", folder / "descents.parquet"]).descents(),
    )
    refuses(DataError, "no file", lambda: FlightSource(tmp_path / "absent.parquet").descents())
    refuses(DataError, "an object of type int for descents", lambda: FlightSource(3).descents())
    refuses(DataError, "not prepared descents", lambda: FlightSource(folder / "rows.parquet").without_rows())
    with pytest.raises(DataError, match="rows that are not prepared"):
        FlightSource(pl.read_parquet(folder / "rows.parquet")).without_rows()
    with pytest.raises(DataError, match="a table of descents: no column Mach"):
        FlightSource(read_descents(folder / "descents.parquet").frame.drop("Mach")).descents()


def test_settings_of_another_version_are_unknown() -> None:
    settings = asdict(Cleaning())
    assert kept_cleaning(settings) == Cleaning()
    assert kept_cleaning(settings | {"a_new_one": 1.0}) is None
    assert kept_cleaning(settings | {"one_that_is_gone_and_was_off": None}) == Cleaning()
    assert kept_cleaning({name: value for name, value in settings.items() if name != "transient_s"}) is None
    assert kept_cleaning(settings | {"transient_s": "long"}) is None
    assert kept_cleaning(None) is None
    without = Cleaning(cleared_speed_after_s=None)
    assert different_settings(Cleaning(), without) == {"cleared_speed_after_s": (30.0, None)}


def test_an_error_names_the_flights_that_it_is_of(folder: Path, tmp_path: Path) -> None:
    rows = pl.read_parquet(folder / "rows.parquet")
    rows.drop("typecode").write_parquet(tmp_path / "flown.parquet")
    simulator = FlightSource(tmp_path / "flown.parquet")
    with pytest.raises(DataError, match=r"^flown\.parquet: rows without any typecode .* add a column typecode"):
        FlightSource(folder / "rows.parquet").beside(simulator)
    rows.drop("altitude").write_parquet(tmp_path / "flown.parquet")
    with pytest.raises(DataError, match=r"^/.*/flown\.parquet has no column altitude"):  # named already
        simulator.descents()
