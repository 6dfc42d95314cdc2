"""Diagnoses of few flights, of a simulator that has sizes itself, without a process, and folders of another report."""

import multiprocessing
import os
import re
import subprocess
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import gap_toys
import polars as pl
import pytest
import torch

import descentflow as df
from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
from descentflow.core.errors import DataError
from descentflow.diagnosis.diagnose import diagnose
from descentflow.diagnosis.findings.read_gap import read_gap
from descentflow.diagnosis.report.gap_report import GapReport
from descentflow.diagnosis.report.page import page, summary
from descentflow.effects import EFFECTS
from descentflow.simulation.world import simulate
from descentflow.simulation.world_config import WorldConfig
from descentflow.surveillance.descents.prepared_descents import Descents, read_descents, write_descents
from descentflow.surveillance.prepare import prepare

CATALOGUE = {name: EFFECTS[name] for name in ("temperature", "mass")}
NONE = {"rate_noise_fpm": 0.0, "cas_noise_kt": 0.0, "mach_noise": 0.0, "tas_noise_kt": 0.0, "altitude_noise_ft": 0.0}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Real flights with noise in ISA+10; a simulator without noise in ISA+0, and one with noise in ISA+5."""
    place = tmp_path_factory.mktemp("sides")
    for name, n, seed, config in (
        ("real", 120, 1, WorldConfig(deviation_mean_k=10.0, cas_noise_kt=0.9, rate_noise_fpm=60.0)),
        ("quiet", 150, 0, WorldConfig(**NONE)),
        ("half", 150, 4, WorldConfig(deviation_mean_k=5.0, cas_noise_kt=0.9, rate_noise_fpm=60.0)),
    ):
        write_descents(prepare(simulate(open_aircraft("A320"), n, seed, config).rows), place / f"{name}.parquet")
    return place


@pytest.fixture(scope="module")
def first(folder: Path) -> GapReport:
    return diagnose(folder / "real.parquet", folder / "quiet.parquet", catalogue=CATALOGUE, out=folder / "gap")


def test_what_the_simulator_has_itself_is_told_beside_the_size(folder: Path) -> None:
    report = diagnose(folder / "real.parquet", folder / "half.parquet", catalogue=CATALOGUE)
    (cause,) = report.causes
    assert cause.text == "air warmer than that of the simulator's flights"
    assert re.search(r"temperature \+\S+ K \(.*\): ISA \+\S+ K against the simulator's ISA \+\S+ K", str(report))
    assert "Each number is a change of what its flights have now." in str(report)
    (sides,) = cause.on_both_sides
    assert sides.simulator == pytest.approx(5.0, abs=0.7)
    assert sides.flights - sides.simulator == pytest.approx(cause.sizes[0].value.estimate, abs=0.7)
    # To add, and not what the real air has.
    assert report.recipe[0].numbers[0].value.estimate == pytest.approx(5.0, abs=1.0)


def test_noise_of_reports_is_no_cause_and_stands_by_itself(first: GapReport) -> None:
    (air,) = first.causes
    assert air.effect == "temperature"
    assert air.sizes[0].text.startswith("ISA +")  # the simulator's own air is standard
    lacks = {lack.quantity: lack.size for lack in first.details.lacks}
    assert lacks["noise_rate"] > 0.5
    assert lacks["noise_cas"] > 0.2
    assert "The simulator lacks besides: noise of " in str(first)
    assert "noise of IAS (x " in page(first)


def test_a_folder_with_the_report_of_other_inputs_is_not_written_over(folder: Path, first: GapReport) -> None:
    real, out = folder / "real.parquet", folder / "gap"
    before = (out / "gap.json").read_bytes()
    with pytest.raises(DataError, match=r"of another simulator \(quiet.parquet\); expected a new folder"):
        diagnose(real, folder / "half.parquet", catalogue=CATALOGUE, out=out)
    with pytest.raises(DataError, match=r"of other real flights \(real.parquet\)"):
        diagnose(folder / "half.parquet", folder / "quiet.parquet", catalogue=CATALOGUE, out=out)
    with pytest.raises(DataError, match="is the folder of the round before"):
        diagnose(real, folder / "half.parquet", catalogue=CATALOGUE, out=out, previous=out / "gap.json")
    with pytest.raises(DataError, match=r"to mend it, name .*gap.json"):
        diagnose(real, folder / "half.parquet", catalogue=CATALOGUE, previous=out)
    assert (out / "gap.json").read_bytes() == before
    # The same once more, as after a kill.
    diagnose(real, folder / "quiet.parquet", catalogue=CATALOGUE, out=out)
    assert read_gap(out / "gap.json").verdict == first.verdict


def test_the_same_flights_on_both_sides_are_said_to_be_so(folder: Path) -> None:
    report = diagnose(folder / "real.parquet", folder / "real.parquet", catalogue={"mass": EFFECTS["mass"]})
    assert report.verdict == "none"
    assert "The flights of both sides are the same" in str(report)
    assert "Next: " not in str(report)


def test_flights_are_called_by_their_own_type_and_not_that_of_the_coefficients(folder: Path) -> None:
    mass = {"mass": EFFECTS["mass"]}
    report = diagnose(folder / "real.parquet", folder / "quiet.parquet", typecode="B738", catalogue=mass)
    assert "120 real A320 flights" in str(report)
    assert "real B738 flights" not in page(report)


def some(descents: Path, count: int) -> Descents:
    """Flights of as many aircraft."""
    flights = read_descents(descents)
    first = flights.frame.unique("icao24", keep="first", maintain_order=True).head(count)
    return Descents(flights.frame.filter(pl.col("flight_id").is_in(first["flight_id"].implode())), flights.metadata)


def test_seven_flights_of_the_simulator_itself_show_no_certain_difference(descents: Path, tmp_path: Path) -> None:
    report = diagnose(some(descents, 7), gap_toys.flights(tmp_path, 60, seed=9))
    assert (report.verdict, report.causes) == ("none", [])
    assert report.is_few
    assert "No certain difference" in summary(replace(report, p_value=0.3))
    assert "at least 13 more are needed" in " ".join(summary(report).split())


def test_seven_flights_show_a_wrong_polar_as_time_and_name_no_cause(descents: Path) -> None:
    report = diagnose(some(descents, 7), "A320")  # nominal coefficients, which the world does not fly
    assert report.verdict in ("none", "unknown")
    assert report.causes == []
    time = next(cost for cost in report.costs if cost.name == "time_at_speed")
    assert time.before.ends


@pytest.fixture(autouse=True)
def two_threads() -> Iterator[None]:
    """Two threads of torch, as users have: with one, no version of the diagnosis would begin a process."""
    before = torch.get_num_threads()
    torch.set_num_threads(2)
    yield
    torch.set_num_threads(before)


def test_a_diagnosis_begins_no_process(descents: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(*_: object, **__: object) -> None:
        raise AssertionError("a process was begun")

    for owner, name in ((os, "fork"), (subprocess, "Popen"), (multiprocessing.Process, "start")):
        monkeypatch.setattr(owner, name, refused)
    few = {name: EFFECTS[name] for name in ("mass", "temperature")}
    df.diagnose(real=descents, simulator="A320", catalogue=few, out=tmp_path / "gap")
    assert (tmp_path / "gap" / "gap.html").is_file()
