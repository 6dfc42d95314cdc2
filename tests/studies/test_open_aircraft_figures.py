"""Pictures and page of the open aircraft show what the model computes and what others published."""

import runpy
import sys
from pathlib import Path

import matplotlib
import numpy as np
import pytest
import torch

from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
from descentflow.core.units import FPM_MPS
from descentflow.physics.nominal_descent import nominal_descent
from studies.aircraft.open_aircraft_figures import open_aircraft_figure

SCRIPT = Path(__file__).resolve().parents[2] / "scripts" / "open_aircraft_page.py"


@pytest.fixture(scope="module", autouse=True)
def _no_window() -> None:
    matplotlib.use("agg")


def test_lines_are_the_nominal_descent() -> None:
    figure = open_aircraft_figure("B738")
    line = next(x for x in figure.axes[0].lines if x.get_label().startswith("reference mass"))
    level = np.asarray(line.get_ydata())
    descent = nominal_descent(open_aircraft("B738"), torch.as_tensor(level))
    np.testing.assert_allclose(line.get_xdata(), -descent.rate_mps.numpy() / FPM_MPS, rtol=1e-6)  # one mass, same grid


def test_the_page_holds_everything_in_one_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    page = tmp_path / "page.html"
    monkeypatch.setattr(sys, "argv", [str(SCRIPT), str(page), "A20N", "BE20"])
    runpy.run_path(str(SCRIPT), run_name="__main__")
    text = page.read_text(encoding="utf-8")
    assert text.count("data:image/png;base64,") == 2
    assert "http-equiv" not in text
    assert 'src="http' not in text
    assert "Made from A320" in text
    assert "not EUROCONTROL" in text
    assert text.count("Known to be off.") == 2
    assert list(tmp_path.iterdir()) == [page]
    assert "2 types" in capsys.readouterr().out
