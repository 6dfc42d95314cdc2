"""Repair: planted wrong files, files that others read back, and inputs that tell nothing."""

import importlib
import json
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl
import pytest

import descentflow as df
from descentflow.aircraft_types.bada3.apf_file import write_apf
from descentflow.aircraft_types.bada3.opf_file import read_opf, write_opf
from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
from descentflow.cli.entry import main
from descentflow.core.errors import ConfigError, DataError
from descentflow.diagnosis.sides.two_sides import compare
from descentflow.measurements.quantities import CHANNELS, quantities_of
from descentflow.repairs.held_out import HeldOut, _error
from descentflow.repairs.repair_found import Repair
from descentflow.surveillance.descents.prepared_descents import Descents, write_descents

# pyBADA warns of its own.
pytestmark = pytest.mark.filterwarnings("ignore:::pyBADA")
TRUE = open_aircraft("A320")
WRONG = replace(
    TRUE, cd0_cr=round(1.25 * TRUE.cd0_cr, 5), ct_des_low=0.7 * TRUE.ct_des_low, ct_des_high=0.7 * TRUE.ct_des_high
)


@pytest.fixture(scope="module")
def bada(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A licence holder's folder with a wrong file."""
    folder = tmp_path_factory.mktemp("bada")
    write_opf(replace(WRONG, source="a licence holder's own"), folder / "A320__.OPF")
    write_apf(WRONG, folder / "A320__.APF")
    return folder


@pytest.fixture(scope="module")
def descents() -> Descents:
    """Flights of the true type; one in two has brakes out between FL210 and FL260."""
    brakes = {"speed_brake": {"factor": 1.6, "share": 0.5, "low_fl": 210.0, "high_fl": 260.0}}
    return df.prepare(df.simulate(TRUE, 60, seed=5, plant=brakes))


@pytest.fixture(scope="module")
def out(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("repaired") / "A320.toml"


@pytest.fixture(scope="module")
def mended(bada: Path, descents: Descents, out: Path) -> Repair:
    return df.repair(descents, aircraft="A320", bada_dir=bada, out=out)


def test_a_planted_error_is_mended_on_aircraft_that_were_not_used(mended: Repair) -> None:
    time = mended.held_out.time
    assert mended.changed
    assert time.before < -8.0
    assert abs(time.after) <= max(1.2 * time.floor, 1.0)
    assert all(abs(level.rate.after) < abs(level.rate.before) for level in mended.held_out.levels)


def test_brakes_of_some_flights_are_set_apart_and_not_averaged_in(mended: Repair, bada: Path) -> None:
    assert mended.counts["share_with_speed_brake"] == pytest.approx(0.4, abs=0.2)
    without = df.repair(df.prepare(df.simulate(TRUE, 60, seed=5)), aircraft="A320", bada_dir=bada)
    for mine, theirs in zip(mended.estimates[:2], without.estimates[:2], strict=True):
        assert mine.low < theirs.after < mine.high


def test_files_are_read_back_by_us_and_by_pybada(mended: Repair, bada: Path, out: Path) -> None:
    back, after = df.aircraft("A320", bada_dir=out.parent), mended.after
    for name in TRUE.repaired_numbers():
        assert getattr(back, name) == getattr(after, name)
    for name in ("des_mach", "des_cas_high_kt", "des_cas_low_kt"):
        assert getattr(back, name) == pytest.approx(getattr(after, name))
    theirs = importlib.import_module("pyBADA.bada3").Parser
    read = theirs.combineOPF_APF(
        theirs.parseOPF(str(out.parent), "A320__"), theirs.parseAPF(str(out.parent), "A320__")
    ).iloc[0]
    assert (read["CD0"]["CR"], read["CD2"]["CR"]) == (after.cd0_cr, after.cd2_cr)
    assert (read["CTdeslow"], read["CTdeshigh"], read["M"]["des"]) == (
        after.ct_des_low,
        after.ct_des_high,
        after.des_mach,
    )
    assert read["V2"]["des"] == pytest.approx(after.des_cas_high_kt * 0.514444)
    # A licence holder's file is changed where it was repaired, and nowhere else.
    before, now = (read_opf(folder / "A320__.OPF") for folder in (bada, out.parent))
    assert {name for name in now.numbers if now.numbers[name] != before.numbers[name]} == set(TRUE.repaired_numbers())
    assert "a licence holder's own" in (out.parent / "A320__.OPF").read_text()
    entries = tomllib.loads(out.read_text())["coefficients"]
    assert entries["cd0_cr"]["value"] == after.cd0_cr
    assert entries["cd0_cr"]["interval"][0] < after.cd0_cr < entries["cd0_cr"]["interval"][1]
    assert "interval" not in entries["wing_area_m2"]
    profile = json.loads(out.with_name("A320_bluebird_profile.json").read_text())["aircraft"]["A320"]
    assert np.diff(profile["flight_level"]).min() > 0
    assert min(profile["rocd_des"]) > 500


def test_files_name_who_repaired_what(
    mended: Repair, descents: Descents, out: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A licence holder's file, an open type of which a file was made, and a file that stays."""
    assert (
        df.aircraft("A320", bada_dir=out.parent).source == "BADA 3 files A320 of Mar 08 2024, repaired by descentflow"
    )
    by = f"repaired by {mended.held_out.flights} flights of {mended.held_out.aircraft} aircraft; "
    assert tomllib.loads(out.read_text())["summary"] == f"{by}{mended.before.source}"
    few = descents.frame.filter(pl.col("flight_id").is_in(descents.frame["flight_id"].unique().sort().head(24)))
    source = "open coefficients, not BADA, in files A320 of Mar 0"
    for taken in (True, False):
        monkeypatch.setattr(HeldOut, "better", property(lambda _, taken=taken: taken))
        df.repair(few, aircraft="A320", out=tmp_path / "A320.toml")
        back = df.aircraft("A320", bada_dir=tmp_path).source
        assert back.startswith(source)
        assert back.endswith(", repaired by descentflow") == taken
        text = (tmp_path / "A320.toml").read_text()
        assert ("repaired" in text) == taken
        assert tomllib.loads(text)["summary"].endswith(open_aircraft("A320").source)
        assert ("stay as they are" in (tmp_path / "A320.html").read_text()) != taken


def test_a_change_that_makes_the_time_worse_is_refused(mended: Repair) -> None:
    judged = mended.held_out
    assert judged.better
    for name, worse in (
        ("time", replace(judged.time, after=-judged.time.before + 0.01)),
        ("absolute", (judged.absolute[0], judged.absolute[0] + 0.01)),
        ("gain", 0.0),
    ):
        assert not replace(judged, **{name: worse}).better


def test_errors_of_the_time_are_seconds_over_seconds() -> None:
    """A flight with one band weighs as little as it flies: the mean is that of all seconds, not of flights."""
    tails, seconds = np.array([0, 1, 2, 2]), np.array([1000.0, 900.0, 50.0, 50.0])
    before, after = np.array([2.0, -1.0, 80.0, 60.0]), np.array([1.0, 0.0, 40.0, 30.0])
    error = _error(tails, before, after, seconds)
    assert error.before == pytest.approx((before * seconds).sum() / 2000)
    assert error.after == pytest.approx((after * seconds).sum() / 2000)
    assert error.low < error.after < error.high


def test_the_page_shows_both_and_the_command_writes_the_same(
    mended: Repair, bada: Path, descents: Descents, out: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    page = out.with_suffix(".html").read_text()
    assert "on aircraft that were not used" in page
    rows = tmp_path / "prepared.parquet"
    write_descents(descents, rows)
    again = tmp_path / "again.toml"
    assert main(["repair", str(rows), "--aircraft", "a320", "--bada-dir", str(bada), "--out", str(again)]) == 0
    assert again.read_text() == out.read_text()
    assert "flights do not tell the mass" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("change", "aircraft", "words"),
    [
        (lambda frame: frame.filter(pl.col("flight_id") < "A320-5-00010"), "A320", "at least 20 flights"),
        (lambda frame: frame, "A321", "no flight of A321 among A320"),
        (lambda frame: frame.filter(pl.col("level_fl") < 155), "A320", "no free descent of A320"),
        (lambda frame: frame.drop("IAS"), "A320", "IAS"),
    ],
)
def test_flights_that_tell_nothing_are_refused(change: object, aircraft: str, words: str, descents: Descents) -> None:
    with pytest.raises(DataError, match=words):
        df.repair(change(descents.frame), aircraft=aircraft)  # type: ignore[operator]


def test_nothing_is_compared_where_no_band_has_five_flights(descents: Descents) -> None:
    few = descents.frame.filter(pl.col("flight_id").is_in(descents.frame["flight_id"].unique().sort().head(4)))
    with pytest.raises(DataError, match="at least 5 flights"):
        compare(None, quantities_of(few, 150, 340, CHANNELS), TRUE)


def test_the_files_that_are_repaired_are_not_written_over(descents: Descents, bada: Path) -> None:
    with pytest.raises(ConfigError, match="written over"):
        df.repair(descents, aircraft="A320", bada_dir=bada, out=bada / "A320.toml")
    with pytest.raises(ConfigError, match=r"ends in \.toml"):
        df.repair(descents, aircraft="A320", out=bada / "A320.json")


def test_sisters_of_other_levels_share_a_prior() -> None:
    """Few flights of a type take a place beside its sister's, which are of other levels."""
    few, many = df.simulate(open_aircraft("A319"), 25, seed=3), df.simulate(TRUE, 40, seed=4)
    both = pl.concat([df.prepare(few, bottom_fl=180).frame, df.prepare(many).frame])
    repair = df.repair(both, aircraft="A319")
    assert tuple(repair.flights) == ("A319", "A320")
    assert abs(repair.held_out.time.after) <= max(1.2 * repair.held_out.time.floor, 1.5)


def test_one_held_path_does_not_keep_a_wrong_file(tmp_path: Path) -> None:
    """Of 17 aircraft one holds a path unseen; its log density alone falls by more than all others' rise."""
    true = open_aircraft("E190")
    write_opf(replace(true, cd0_cr=0.85 * true.cd0_cr), tmp_path / "E190__.OPF")
    write_apf(true, tmp_path / "E190__.APF")
    world = df.simulate(true, 81, seed=575260753, plant={"temperature": {"deviation_k": 2.2, "spread_k": 2.0}})
    repair = df.repair(df.prepare(world), aircraft="E190", bada_dir=tmp_path)
    assert repair.changed
    assert repair.held_out.gain > 2.0


def test_a_right_file_keeps_its_place() -> None:
    """At the world's own mean mass, coefficients that made the flights stay within their intervals."""
    world = df.simulate(TRUE, 60, seed=10)
    gauge = world.flights["mass_kg"].to_numpy().mean() / TRUE.mass_reference_kg
    truth = {"cd0_cr": TRUE.cd0_cr / gauge, "cd2_cr": TRUE.cd2_cr * gauge, "ct_des_high": TRUE.ct_des_high / gauge}
    estimates = {estimate.name: estimate for estimate in df.repair(df.prepare(world), aircraft="A320").estimates}
    assert all(estimates[name].low < value < estimates[name].high for name, value in truth.items())
