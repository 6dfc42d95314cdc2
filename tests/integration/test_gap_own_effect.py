"""An effect of the user's own is found, printed and reported like the package's."""

import json
from pathlib import Path

import gap_toys
import polars as pl
import pytest
from torch import Tensor

from descentflow.diagnosis.diagnose import diagnose
from descentflow.diagnosis.report.gap_report import GapReport
from descentflow.effects import EFFECTS, Effect, Parameter, Shift
from descentflow.effects.flight_state import FlightState
from descentflow.surveillance.descents.prepared_descents import Descents, read_descents


class StretchedHeight(Effect):
    """Geometric altitudes that grow too fast, as of a receiver with a wrong scale."""

    name = "stretched_height"
    label = "stretched height"
    says = "geometric altitudes of a wrong scale"
    directions = ("geometric altitudes that grow too fast", "geometric altitudes that grow too slowly")
    parameters = (Parameter("stretch", -0.2, 0.2, "1", 0.01, label="stretch of the height"),)
    sensor = True
    needs = ("geoaltitude",)

    def shift(self, state: FlightState, theta: Tensor) -> Shift:
        """Height about each flight's mean."""
        return {"height": state.centred(theta[0] * state.altitude_m + 0.0 * state.cas_mps)}


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> GapReport:
    """Flights whose geometric altitude was stretched by three per cent."""
    folder = tmp_path_factory.mktemp("own")
    checkpoint = gap_toys.simulator(folder, gap_toys.flights(folder, 220, seed=0))
    plain = read_descents(gap_toys.flights(folder, 120, seed=1))
    stretched = Descents(plain.frame.with_columns(geoaltitude=1.03 * pl.col("geoaltitude")), plain.metadata)
    return diagnose(stretched, checkpoint, catalogue={**EFFECTS, "stretched_height": StretchedHeight()})


def test_it_is_named_with_its_size(report: GapReport) -> None:
    assert [cause.effect for cause in report.causes] == ["stretched_height"]
    size = report.causes[0].parameters["stretch"]
    assert size.low is not None
    assert size.low - 0.002 < 0.03 < size.high + 0.002
    assert report.causes[0].closure.marginal.estimate > 0.8


def test_terminal_page_and_json_speak_of_it_in_its_own_words(report: GapReport, tmp_path: Path) -> None:
    assert "The cause is geometric altitudes that grow too fast" in str(report)
    assert "stretched height: stretch of the height +0.0" in str(report)
    report.write(tmp_path)
    page = (tmp_path / "gap.html").read_text()
    assert "geometric altitudes that grow too fast" in page
    assert "stretch of the height +0.0" in page
    # A checkpoint that names code outside the package would not load: none is written, and the page says so.
    assert sorted(path.name for path in tmp_path.iterdir()) == ["gap.html", "gap.json"]
    assert "no corrected checkpoint: stretched height" in page
    written = json.loads((tmp_path / "gap.json").read_text())
    assert written["causes"][0]["effect"] == "stretched_height"
    assert set(written["causes"][0]["parameters"]["stretch"]) == {"estimate", "low", "high", "unit", "label"}
    assert written["details"]["contest"][0]["effect"] == "stretched_height"
