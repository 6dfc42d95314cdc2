"""An effect of the user's own is found, printed and reported like the package's."""

import inspect
import json
from pathlib import Path

import gap_toys
import polars as pl
import pytest
from torch import Tensor

from descentflow.cli.entry import main
from descentflow.diagnosis.diagnose import diagnose
from descentflow.diagnosis.findings.read_gap import read_gap
from descentflow.diagnosis.report.gap_report import GapReport
from descentflow.effects import EFFECTS, Effect, Parameter, Shift
from descentflow.effects.flight_state import FlightState
from descentflow.surveillance.descents.prepared_descents import Descents, read_descents, write_descents


class StretchedHeight(Effect):
    """Geometric altitudes that grow too fast, as of a receiver with a wrong scale."""

    name = "stretched_height"
    label = "stretched height"
    description = "geometric altitudes of a wrong scale"
    directions = ("geometric altitudes that grow too fast", "geometric altitudes that grow too slowly")
    parameters = (Parameter("stretch", -0.2, 0.2, "1", 0.01, label="stretch of the height"),)
    sensor = True
    needs = ("geoaltitude",)

    def shift(self, state: FlightState, theta: Tensor) -> Shift:
        """Height about each flight's mean."""
        return {"height": state.centred(theta[0] * state.altitude_m + 0.0 * state.cas_mps)}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A simulator, and flights whose geometric altitude was stretched by three per cent."""
    folder = tmp_path_factory.mktemp("own")
    gap_toys.simulator(folder, gap_toys.flights(folder, 220, seed=0))
    plain = read_descents(gap_toys.flights(folder, 120, seed=1))
    stretched = Descents(plain.frame.with_columns(geoaltitude=1.03 * pl.col("geoaltitude")), plain.metadata)
    write_descents(stretched, folder / "stretched.parquet")
    return folder


@pytest.fixture(scope="module")
def report(folder: Path) -> GapReport:
    catalogue = {**EFFECTS, "stretched_height": StretchedHeight()}
    return diagnose(folder / "stretched.parquet", folder / "simulator.ckpt", catalogue=catalogue)


def test_a_file_of_effects_is_run_and_named_from_the_command_line(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    own = tmp_path / "own_effects.py"
    own.write_text(
        "from descentflow.effects import Effect, Parameter\n"
        + inspect.getsource(StretchedHeight).replace("state: FlightState, theta: Tensor) -> Shift", "state, theta)")
    )
    out = tmp_path / "gap"
    command = ["diagnose", "--real", str(folder / "stretched.parquet"), "--simulator", str(folder / "simulator.ckpt")]
    assert main([*command, "--out", str(out), "--catalogue", str(own)]) == 0
    said = capsys.readouterr()
    assert f"runs {own}" in said.err
    assert "stretched height: in what is reported: stretch of the height +0.0" in said.out
    assert read_gap(out / "gap.json").provenance.user_files == ["own_effects.py"]
    assert "Effects were taken from own_effects.py, and its code was run" in (out / "gap.html").read_text()
    own.write_text("1 / 0\n")
    assert main([*command, "--out", str(out), "--catalogue", str(own)]) == 2
    assert "own_effects.py, line 1: ZeroDivisionError" in capsys.readouterr().err


def test_it_is_named_with_its_size(report: GapReport) -> None:
    assert [cause.effect for cause in report.causes] == ["stretched_height"]
    size = report.causes[0].parameters["stretch"]
    assert size.low is not None
    assert size.low - 0.002 < 0.03 < size.high + 0.002
    assert report.causes[0].closure.marginal.estimate > 0.8


def test_terminal_page_and_json_speak_of_it_in_its_own_words(report: GapReport, tmp_path: Path) -> None:
    assert "stretched height: in what is reported: stretch of the height +0.0" in str(report)
    report.write(tmp_path)
    page = (tmp_path / "gap.html").read_text()
    assert "geometric altitudes that grow too fast" in page
    assert "stretch of the height +0.0" in page
    # A checkpoint that names code outside the package would not load: none is written, and the page says so.
    assert sorted(path.name for path in tmp_path.iterdir()) == ["gap.html", "gap.json"]
    assert "There is no corrected checkpoint: none can hold an effect of your own." in page
    written = json.loads((tmp_path / "gap.json").read_text())
    assert written["causes"][0]["effect"] == "stretched_height"
    assert set(written["causes"][0]["parameters"]["stretch"]) == {"estimate", "low", "high", "unit", "label"}
    assert written["details"]["contest"][0]["effect"] == "stretched_height"
