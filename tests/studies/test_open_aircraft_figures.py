"""Pictures and page of the open aircraft show what the model computes and what others published."""

import runpy
import sys
from pathlib import Path

import matplotlib
import pytest

SCRIPT = Path(__file__).resolve().parents[2] / "scripts" / "open_aircraft_page.py"


@pytest.fixture(scope="module", autouse=True)
def _no_window() -> None:
    matplotlib.use("agg")


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
