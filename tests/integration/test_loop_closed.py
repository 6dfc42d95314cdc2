"""The owner adds what was named and flies again: predicted against achieved, what remains, reports that do not fit."""

import json
import re
import shlex
import shutil
from importlib import import_module
from pathlib import Path

import pytest

from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
from descentflow.cli.entry import main
from descentflow.core.errors import DataError
from descentflow.diagnosis.diagnose import diagnose
from descentflow.diagnosis.findings.read_gap import read_gap
from descentflow.diagnosis.report.gap_report import GapReport
from descentflow.effects import EFFECTS
from descentflow.simulation.world import simulate
from descentflow.simulation.world_config import WorldConfig
from descentflow.surveillance.descents.prepared_descents import write_descents
from descentflow.surveillance.prepare import prepare

PAGE = Path(__file__).resolve().parents[2] / "docs" / "how-to" / "any_simulator.md"
SMALL = {name: EFFECTS[name] for name in ("temperature", "mass", "speed_schedule")}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Real flights in air 10 K warmer; a simulator in standard air, in 10 K, and in 5 K; another typecode."""
    place = tmp_path_factory.mktemp("loop")
    for name, n, seed, kelvin in (
        ("real", 120, 1, 10.0),
        ("plain", 150, 0, 0.0),
        ("added", 150, 3, 10.0),
        ("half", 150, 4, 5.0),
    ):
        config = WorldConfig(deviation_mean_k=kelvin)
        write_descents(prepare(simulate(open_aircraft("A320"), n, seed, config).rows), place / f"{name}.parquet")
    return place


@pytest.fixture(scope="module")
def first(folder: Path) -> GapReport:
    return diagnose(folder / "real.parquet", folder / "plain.parquet", catalogue=SMALL, out=folder / "gap")


def again(folder: Path, name: str) -> GapReport:
    real = folder / "real.parquet"
    return diagnose(real, folder / f"{name}.parquet", catalogue=SMALL, previous=folder / "gap" / "gap.json")


def test_what_was_added_closes_what_was_predicted(folder: Path, first: GapReport) -> None:
    report = again(folder, "added")
    previous = report.previous
    assert previous.causes == ["temperature"]
    assert previous.predicted == first.causes[0].closure.marginal
    assert previous.gap_before == pytest.approx(first.gap_before, rel=1e-9)
    assert previous.achieved.low < previous.achieved.estimate < previous.achieved.high
    assert previous.achieved.estimate == pytest.approx(previous.predicted.estimate, abs=0.15)
    assert previous.judged == "as"
    assert re.search(r"Now .* is closed, as predicted. Nothing is left to change.", str(report))


def test_half_of_it_closes_less_and_the_rest_is_next(folder: Path, first: GapReport) -> None:
    report = again(folder, "half")
    previous = report.previous
    assert 0.3 < previous.achieved.estimate < 0.75
    assert previous.achieved.high < previous.predicted.low
    assert previous.judged == "less"
    assert "The round before named temperature, to close " in str(report)
    assert "less than predicted. If you entered temperature, change what you entered by the size given" in str(report)
    assert report.causes[0].effect == "temperature"
    assert report.causes[0].parameters["deviation_k"].estimate == pytest.approx(5.0, abs=1.5)


def test_the_commands_of_the_page_run(folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As they are printed: rows in a folder, then flights flown again, which are prepared."""
    monkeypatch.setattr(import_module("descentflow.diagnosis.diagnose"), "EFFECTS", SMALL)
    (tmp_path / "flown").mkdir()
    simulate(open_aircraft("A320"), 150, 0, WorldConfig()).rows.write_csv(tmp_path / "flown" / "log.csv")
    shutil.copy(folder / "real.parquet", tmp_path / "radar.parquet")
    shutil.copy(folder / "added.parquet", tmp_path / "flown_again.parquet")
    monkeypatch.chdir(tmp_path)
    blocks = re.findall(r"<!-- commands -->\n```sh\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    lines = [line for block in blocks for line in block.splitlines()]
    assert len(lines) == 2
    for line in lines:
        program, *words = shlex.split(line)
        assert program == "descentflow"
        assert main(words) == 0
    assert Path("gap/corrected.parquet").exists()
    written = read_gap("gap_2/gap.json").previous
    assert written.report == "gap/gap.json"
    assert written.causes == ["temperature"]
    assert written.achieved.estimate > 0.8


def test_reports_that_do_not_fit_are_refused(folder: Path, first: GapReport, tmp_path: Path) -> None:
    previous = folder / "gap" / "gap.json"
    real, added = folder / "real.parquet", folder / "added.parquet"
    with pytest.raises(DataError, match=r"other real flights \(real.parquet\)"):
        diagnose(folder / "half.parquet", added, previous=previous)
    with pytest.raises(DataError, match="is of the very flights of the simulator"):
        diagnose(real, folder / "plain.parquet", previous=previous)
    with pytest.raises(DataError, match="signatures of aircraft type A320, and B738 now"):
        diagnose(real, added, typecode="B738", previous=previous)
    content = json.loads(previous.read_text())
    for change, message in (
        ({"schema_version": 1}, "schema version 1"),
        ({"provenance": {**content["provenance"], "versions": {"descentflow": "9"}}}, "of version 9, and"),
        ({"provenance": None}, "provenance: NoneType; expected an object"),
        ({"details": {**content["details"], "measured_over": []}}, "does not say what its gap was measured over"),
    ):
        other = tmp_path / "gap.json"
        other.write_text(json.dumps({**content, **change}))
        with pytest.raises(DataError, match=message):
            diagnose(real, added, previous=other)
    entries = content["details"]["measured_over"]
    elsewhere = [{**entry, "low_fl": entry["low_fl"] + 7, "high_fl": entry["high_fl"] + 7} for entry in entries]
    other.write_text(json.dumps({**content, "details": {**content["details"], "measured_over": elsewhere}}))
    with pytest.raises(DataError, match=r"bands and quantities .* are measured now"):
        diagnose(real, added, catalogue=SMALL, previous=other)
    with pytest.raises(DataError, match="No such file"):
        diagnose(real, added, previous=tmp_path / "nothing.json")
