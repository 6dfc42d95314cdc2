"""Runs of real flights against flights of known truth, and the page and pictures of the open aircraft."""

import runpy
import sys
from pathlib import Path

import matplotlib
import numpy as np
import pytest

import descentflow as df
from benchmarks.real_rivals import bluesky, first_speed
from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
from descentflow.core.units import KT_MPS
from descentflow.surveillance.formats.aircraft_json import embedded_rows, embedded_types
from studies.aircraft.real_runs import Run, before, own_speed_error, runs_of


@pytest.fixture(scope="module")
def runs() -> list[Run]:
    return runs_of(df.prepare(df.simulate("A320", 12, seed=2)).frame, "world")


def test_a_predictor_knows_the_first_speed_alone(runs: list[Run]) -> None:
    """From above the crossover its Mach number and the type's CAS; from below it the CAS of its first level."""
    schedule = open_aircraft("A320")
    for run in runs:
        first, level = first_speed(run), float(run.levels_fl[-1])
        assert first.by_mach == (level * 30.48 > float(schedule.transition_altitude_m()))
        held = schedule.des_cas_high_kt * KT_MPS if first.by_mach else float(run.cas_mps[-1])
        assert first.cas_mps == pytest.approx(held)
        assert 0.3 < first.mach < 0.85


@pytest.mark.filterwarnings("ignore")  # its own, at import
def test_bluesky_descends_at_its_own_rate(runs: list[Run]) -> None:
    """1,500 ft/min; 2 % for the rate that it ramps up."""
    pytest.importorskip("bluesky", reason="pip install '.[bluesky]'", exc_type=ImportError)
    for run, error in zip(runs, bluesky(runs), strict=True):
        height_ft = 100.0 * float(run.levels_fl[-1] - run.levels_fl[0])
        assert (1 + error) * run.seconds == pytest.approx(60 * height_ft / 1500.0, rel=0.02)


def test_flights_of_an_aircraft_take_its_own_time() -> None:
    world = df.simulate("A320", 30, seed=2)
    mean_kg = world.flights["mass_kg"].to_numpy().mean()
    runs = runs_of(df.prepare(world).frame, "world")
    errors = [own_speed_error(run, open_aircraft("A320").at_mass(mean_kg)) for run in runs]
    assert len(runs) >= 30
    assert abs(np.median(errors)) < 0.02


@pytest.mark.parametrize("typecode", ["A20N", "A21N", "AT76"])
def test_repaired_types_take_the_time_of_the_embedded_flights(typecode: str) -> None:
    frame = df.prepare(embedded_rows(), types=embedded_types(), typecode=typecode, bottom_fl=60).frame
    runs = runs_of(frame, "bengaluru")
    kinds = (open_aircraft(typecode), before(typecode))
    now, was = (np.median([own_speed_error(run, kind) for run in runs]) for kind in kinds)
    assert abs(now) < 0.06 < abs(was)


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
