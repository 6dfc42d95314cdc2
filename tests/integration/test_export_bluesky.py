"""Samples flown by BlueSky itself, headless; needs the extra `bluesky`."""

import importlib.util
import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from export_toys import WHERE
from pyproj import Geod

import descentflow as df
from descentflow.core.errors import ConfigError
from descentflow.exports.bluesky_rates import STEEPEST_FPM, STEP_S, commanded_rates
from descentflow.exports.export import export

N = 40
FLYER = Path(__file__).resolve().parents[1] / "fly_in_bluesky.py"
PLACES = {name: value for name, value in WHERE.items() if name != "end_time"}


def flown(source: Path) -> dict[str, np.ndarray]:
    """States of every flight: columns time, altitude, latitude, longitude, CAS."""
    if importlib.util.find_spec("bluesky") is None:
        pytest.skip("BlueSky is an extra: pip install '.[bluesky]'")
    out = source.parent / "flown.json"
    words = [sys.executable, "-W", "ignore", str(FLYER), str(source), str(out)]
    done = subprocess.run(words, capture_output=True, text=True, env=dict(os.environ), check=False)
    assert done.returncode == 0, done.stderr[-2000:]
    return {name: np.array(rows) for name, rows in json.loads(out.read_text()).items()}


def passed(state: np.ndarray, altitude_ft: float, column: int = 0) -> float:
    """What a column was when the flight passed an altitude."""
    below = int(np.argmax(state[:, 1] <= altitude_ft))
    return float(np.interp(-altitude_ft, -state[below - 1 : below + 1, 1], state[below - 1 : below + 1, column]))


def time_errors(states: dict[str, np.ndarray], samples: pl.DataFrame, low_ft: float) -> np.ndarray:
    """Seconds from FL350, or the first whole 1,000 ft below the entry, to the bottom: BlueSky's minus the sample's."""
    errors = []
    for number, state in enumerate(states[f"DF{i:05d}"] for i in range(N)):
        own = samples.filter(sample_id=number)
        top_ft = min(35_000.0, 1000.0 * ((own["altitude_ft"][0] - 1) // 1000))
        times = np.interp([-top_ft, -low_ft], -own["altitude_ft"].to_numpy(), own["time_s"].to_numpy())
        errors.append(passed(state, low_ft) - passed(state, top_ft) - (times[1] - times[0]))
    return np.array(errors)


def test_the_plugin_flies_the_samples(a320: Path, tmp_path: Path) -> None:
    """The aim is 2 s of mean and 8 s of spread; at every step of 0.5 s a tenth of that is left."""
    source, _ = export(a320, "bluesky", tmp_path / "descents.py", n=N, seed=2)
    samples = df.sample(a320, N, seed=2).to_polars()
    states = flown(source)
    errors = time_errors(states, samples, 15_000.0)
    assert abs(errors.mean()) < 0.2
    assert errors.std() < 0.8
    assert all(state[-1, 1] < 13_100 for state in states.values()), "and on, below the samples, to what was selected"
    for number in (0, 7, 21):
        own = samples.filter(sample_id=number)
        cas = np.interp(-25_000.0, -own["altitude_ft"].to_numpy(), own["CAS"].to_numpy())
        assert passed(states[f"DF{number:05d}"], 25_000.0, column=4) == pytest.approx(cas, abs=2.0)


def test_the_scenario_flies_the_samples_to_their_end_point(a320: Path, tmp_path: Path) -> None:
    """Commands every 4 s: times within the aim of 2 s and 8 s, places within 2 NM after some 60 NM in a wind."""
    (source,) = export(a320, "bluesky", tmp_path / "descents.scn", n=N, seed=2, every_s=20.0, **PLACES)
    samples = df.sample(a320, N, seed=2).placed(**PLACES).to_polars()
    states = flown(source)
    errors = time_errors(states, samples, 15_050.0)
    assert abs(errors.mean()) < 1
    assert errors.std() < 2
    arrivals = np.array([passed(states[f"DF{i:05d}"], 15_050.0) for i in range(N)])
    assert np.diff(arrivals) == pytest.approx(20.0, abs=6.0), "one flight after the other"
    off = []
    for number in range(N):
        own = samples.filter(sample_id=number, level_fl=150).row(0, named=True)
        state = states[f"DF{number:05d}"]
        at = [passed(state, 15_050.0, column=k) for k in (3, 2)]
        off.append(Geod(ellps="WGS84").inv(*at, own["longitude"], own["latitude"])[2] / 1852)
    assert np.median(off) < 0.2
    assert max(off) < 2


def test_commands_stay_within_what_bluesky_flies() -> None:
    steep = np.linspace(0.0, 100.0, 50), np.linspace(35_000.0, 27_000.0, 50)
    gentle = np.linspace(105.0, 500.0, 50), np.linspace(26_900.0, 15_000.0, 50)
    time_s, altitude_ft = (np.concatenate(pair) for pair in zip(steep, gentle, strict=True))
    rates, altitudes = commanded_rates(time_s, altitude_ft)
    assert rates.min() == -STEEPEST_FPM
    assert rates.max() < 0
    kept_back = altitudes - np.interp(STEP_S * np.arange(len(rates)), time_s, altitude_ft)
    assert kept_back.max() > 1000, "4,800 ft/min cannot be flown"
    assert abs(kept_back[-1]) < 20, "and is caught up with"


def test_a_scenario_needs_places_and_a_wind_by_level(a320: Path, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="a scenario without places"):
        export(a320, "bluesky", tmp_path / "d.scn", n=2)

    class Calm:
        def at(self, level_fl: float, latitude: np.ndarray, *_: object) -> tuple[np.ndarray, np.ndarray]:
            return np.zeros_like(latitude), np.zeros_like(latitude)

    with pytest.raises(ConfigError, match="a field of wind in a scenario"):
        export(a320, "bluesky", tmp_path / "d.scn", n=2, end=(52.0, 4.0), track=90.0, wind=Calm())
    assert list(tmp_path.iterdir()) == []
