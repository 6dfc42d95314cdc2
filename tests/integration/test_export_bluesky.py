"""Samples flown by BlueSky itself, headless; needs the extra `bluesky`."""

import importlib.util
import json
import os
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np
import polars as pl
import pytest
from export_toys import WHERE
from pyproj import Geod

import descentflow as df
from descentflow.core.errors import ConfigError
from descentflow.exports.bluesky_export import STEEPEST_FPM, STEP_S, commanded_rates
from descentflow.exports.export import export

N = 40
BELOW_FT = 13_000
STEPS = (0.5, pytest.param(0.05, marks=pytest.mark.slow))
"""BlueSky's own step is the second."""
FLYER = Path(__file__).resolve().parents[1] / "fly_in_bluesky.py"


class Flown(NamedTuple):
    """``states``: columns time, altitude, latitude, longitude, CAS, vertical rate, of each callsign."""

    states: dict[str, np.ndarray]
    left: list[str]
    echoed: list[str]
    printed: str


PLACES = {name: value for name, value in WHERE.items() if name != "end_time"}


def fly(
    folder: Path,
    *files: Path,
    commands: list[tuple[float, str]] | None = None,
    step_s: float = 0.5,
    until_s: float = 7200,
) -> Flown:
    """Fly scenarios or plugins."""
    if importlib.util.find_spec("bluesky") is None:
        pytest.skip("BlueSky is an extra: pip install '.[bluesky]'")
    plan, out = folder / "plan.json", folder / "flown.json"
    both = [*files, *(file.with_suffix(".json") for file in files if file.suffix == ".py")]
    said = {"files": [str(file) for file in both], "commands": commands or [], "step_s": step_s, "until_s": until_s}
    plan.write_text(json.dumps(said))
    words = [sys.executable, "-W", "ignore", str(FLYER), str(plan), str(out)]
    done = subprocess.run(words, capture_output=True, text=True, env=dict(os.environ), check=False)
    assert done.returncode == 0, done.stderr[-2000:]
    content = json.loads(out.read_text())
    states = {name: np.array(rows) for name, rows in content["flights"].items()}
    return Flown(states, content["left"], content["echoed"], done.stdout)


def passed(state: np.ndarray, altitude_ft: float, column: int = 0) -> float:
    """Value of a column when the flight passed an altitude."""
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


def created(
    number: int, typecode: str, altitude_ft: float, cas_kt: float, name: str | None = None
) -> tuple[float, str]:
    place = f"{number * 0.5 - 40} 0 90"
    return 0.0, f"CRE {name or f'DF{number:05d}'} {typecode} {place} {altitude_ft} {cas_kt}"


@pytest.mark.parametrize("step_s", STEPS)
def test_the_plugin_flies_the_samples(a320: Path, tmp_path: Path, step_s: float) -> None:
    """The aim is 2 s of mean and 8 s of spread; at BlueSky's own step or a coarser one, a tenth of that is left."""
    source, _ = export(a320, "bluesky", tmp_path / "descents.py", n=N, seed=2)
    samples = df.sample(a320, N, seed=2).to_polars()
    commands = []
    for i, one in enumerate(samples.partition_by("sample_id", maintain_order=True)):
        commands.append(created(i, "A320", one["altitude_ft"][0] + 1000, one["CAS"][0]))
        commands += [(1.0, f"DFSAMPLE DF{i:05d} {i}"), (1.0, f"ALT DF{i:05d} {BELOW_FT}")]
    flown = fly(tmp_path, source, commands=commands, step_s=step_s, until_s=1100)
    errors = time_errors(flown.states, samples, 15_000.0)
    assert abs(errors.mean()) < 0.2
    assert errors.std() < 0.3
    assert all(state[-1, 1] < BELOW_FT + 5 for state in flown.states.values()), "and on, below, to what was selected"
    for number in (0, 7, 21):
        own = samples.filter(sample_id=number)
        cas = np.interp(-25_000.0, -own["altitude_ft"].to_numpy(), own["CAS"].to_numpy())
        assert passed(flown.states[f"DF{number:05d}"], 25_000.0, column=4) == pytest.approx(cas, abs=2.0)


@pytest.mark.parametrize("step_s", STEPS)
def test_the_scenario_flies_the_samples_to_their_end_point(a320: Path, tmp_path: Path, step_s: float) -> None:
    """Commands every 4 s: times within the aim of 2 s and 8 s, places within 2 NM after some 60 NM in a wind."""
    (source,) = export(a320, "bluesky", tmp_path / "descents.scn", n=N, seed=2, every_s=20.0, prefix="DF", **PLACES)
    samples = df.sample(a320, N, seed=2).placed(**PLACES).to_polars()
    flown = fly(tmp_path, source, step_s=step_s)
    assert flown.left == [], "deleted where their samples end"
    assert "ASAS" not in source.read_text()
    states = flown.states
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


@pytest.fixture(scope="module")
def a321(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("a321") / "a321.ckpt"
    df.fit(df.prepare(df.simulate("A321", 120, seed=3).rows, typecode="A321"), model="gaussian", out=path, final=False)
    return path


def rate_at(state: np.ndarray, altitude_ft: float) -> float:
    return passed(state, altitude_ft, column=5)


def test_what_a_controller_commands_in_a_descent_is_flown(a320: Path, tmp_path: Path) -> None:
    """SPD with the rate of a sample that has that speed, VS with the sample's speed, and VS 0 gives the rate back."""
    source, beside = export(a320, "bluesky", tmp_path / "flown.py", n=200, seed=2)
    samples = json.loads(beside.read_text())["fleet"][0]["samples"]
    highest = sorted(range(200), key=lambda k: -samples[k]["level_fl"][0])[0]
    top_ft = 100.0 * samples[highest]["level_fl"][0]
    names = ("FREE", "SLOW", "RATE", "ABOVE", "AGAIN", "CLIMB", "STEEP")
    commands = [created(k, "A320", top_ft, 280.0, name) for k, name in enumerate(names)]
    commands[3] = created(3, "A320", top_ft + 2000, 280.0, "ABOVE")
    commands += [(1.0, f"DFSAMPLE {name} {highest}") for name in ("FREE", "SLOW", "RATE", "AGAIN")]
    commands += [(2.0, f"ALT {name} {BELOW_FT}") for name in names[:4]] + [(2.0, f"ALT STEEP {BELOW_FT} -2600")]
    commands += [(2.0, "ALT AGAIN 32000 -1200"), (2.0, f"ALT CLIMB {BELOW_FT}")]
    commands += [(120.0, "SPD SLOW 240"), (120.0, "VS RATE -900"), (200.0, "ALT CLIMB 36000 1200")]
    commands += [(300.0, "VS RATE 0"), (300.0, f"ALT AGAIN {BELOW_FT}"), (600.0, f"ALT CLIMB {BELOW_FT}")]
    states = fly(tmp_path, source, commands=commands, until_s=1500).states
    at = {name: int(np.argmax(state[:, 0] >= 240.0)) for name, state in states.items()}
    assert states["SLOW"][at["SLOW"], 4] == pytest.approx(240.0, abs=1.0)
    assert states["FREE"][at["FREE"], 4] > 245
    altitude_ft, rate = states["SLOW"][at["SLOW"], [1, 5]]
    alike = [one for one in samples if one["level_fl"][0] * 100 >= altitude_ft]
    began_ft = states["SLOW"][int(np.argmax(states["SLOW"][:, 0] >= 120.0)), 1]

    def cas(one: dict) -> float:
        return abs(np.interp(-began_ft / 100, -np.array(one["level_fl"]), one["CAS"]) - 240.0)

    alike = sorted((one for one in alike if one["level_fl"][0] * 100 >= began_ft), key=cas)
    nearest = alike[: len(alike) // 50 + 1]
    rates = [np.interp(-altitude_ft / 100, -np.array(one["level_fl"]), one["vertical_rate"]) for one in nearest]
    assert min(np.abs(np.array(rates) - rate)) < 60.0
    assert states["RATE"][at["RATE"], 5] == pytest.approx(-900.0, abs=1.0)
    own = samples[highest]
    altitude_ft = states["RATE"][at["RATE"], 1]
    speed = np.interp(-altitude_ft / 100, -np.array(own["level_fl"]), own["CAS"])
    assert states["RATE"][at["RATE"], 4] == pytest.approx(speed, abs=2.0)
    later = states["RATE"][int(np.argmax(states["RATE"][:, 0] >= 400.0))]
    assert later[5] == pytest.approx(
        np.interp(-later[1] / 100, -np.array(own["level_fl"]), own["vertical_rate"]), abs=60.0
    )
    assert states["CLIMB"][at["CLIMB"], 5] == pytest.approx(1200.0, abs=1.0)
    assert rate_at(states["AGAIN"], 33_000.0) == pytest.approx(-1200.0, abs=1.0)
    expected = np.interp(-250.0, -np.array(own["level_fl"]), own["vertical_rate"])
    assert rate_at(states["AGAIN"], 25_000.0) == pytest.approx(expected, abs=60.0), "a level-off ends a commanded rate"
    assert rate_at(states["STEEP"], 25_000.0) == pytest.approx(-2600.0, abs=1.0)
    assert rate_at(states["ABOVE"], top_ft + 700) == pytest.approx(-1500.0, abs=1.0), "above all samples: BlueSky's own"
    assert all(state[-1, 1] == pytest.approx(BELOW_FT, abs=5.0) for state in states.values())


def test_a_reset_leaves_nothing_of_the_flights_before(a320: Path, tmp_path: Path) -> None:
    source, _ = export(a320, "bluesky", tmp_path / "flown.py", n=5, seed=2)

    def begun(name: str) -> list[tuple[float, str]]:
        orders = [(1.0, f"DFSAMPLE {name} 0"), (1.0, f"ALT {name} {BELOW_FT}")]
        return [created(0, "A320", 30_000.0, 280.0, name), *orders]

    commands = [*begun("BEFORE"), (100.0, "RESET"), *begun("AFTER")]
    flown = fly(tmp_path, source, commands=commands, until_s=400)
    before, after = flown.states["BEFORE"], flown.states["AFTER"]
    assert before[-1, 0] < 102.0
    assert "BEFORE" not in flown.left
    for altitude_ft in (29_000.0, 28_000.0):
        assert rate_at(after, altitude_ft) == pytest.approx(rate_at(before, altitude_ft), abs=10.0)
        assert passed(after, altitude_ft, column=4) == pytest.approx(passed(before, altitude_ft, column=4), abs=0.5)
    assert rate_at(after, 25_000.0) != pytest.approx(-1500.0, abs=1.0), "a sample is flown, and not BlueSky's own rate"


def test_several_types_fly_in_one_simulation(a320: Path, a321: Path, tmp_path: Path) -> None:
    """By one plugin, by two, by scenarios of one export and of two: no flight is lost."""
    both, _ = export([a320, a321], "bluesky", tmp_path / "both.py", n=20, fly_as=["A319,A320", "A321"])
    types = ("A319", "A320", "A321", "B738")
    commands = [created(k, name, 30_000.0, 280.0, name) for k, name in enumerate(types)]
    commands += [(1.0, f"ALT {name} {BELOW_FT}") for name in types]

    def steady(flown: Flown) -> list[str]:
        """Types that BlueSky flew at its own 1,500 ft/min."""
        return [name for name in types if rate_at(flown.states[name], 24_000.0) == pytest.approx(-1500.0, abs=0.1)]

    assert steady(fly(tmp_path, both, commands=commands, until_s=500)) == ["B738"]
    one, _ = export(a320, "bluesky", tmp_path / "one.py", n=20)
    two, _ = export(a321, "bluesky", tmp_path / "two.py", n=20)
    more, _ = export(a320, "bluesky", tmp_path / "more.py", n=20, fly_as="A320,B738")
    flown = fly(tmp_path, one, two, more, commands=[*commands, (1.0, "DFSAMPLE A321 3")], until_s=500)
    assert steady(flown) == ["A319", "B738"]
    assert any("MORE is not loaded: another plugin flies A320" in line for line in flown.echoed)
    assert any("A321 descends by sample 3" in line for line in flown.echoed)
    arrivals, types = {"n": 4, "every_s": 60.0, **PLACES}, ["A319,A320", "A321"]
    (first,) = export([a320, a321], "bluesky", tmp_path / "a.scn", fly_as=types, prefix="DF", **arrivals)
    created_as = [line.split()[1:3] for line in first.read_text().splitlines() if ">CRE" in line]
    assert sorted(created_as) == [[f"DF{i:05d}", ["A319", "A321", "A320", "A321"][i % 4]] for i in range(8)]
    # Callsigns of their own without any prefix: the same samples on two tracks.
    others = [
        *export(a320, "bluesky", tmp_path / "b.scn", **arrivals),
        *export(a320, "bluesky", tmp_path / "c.scn", **(arrivals | {"track": 90.0})),
    ]
    flown = fly(tmp_path, first, *others)
    assert len(flown.states) == 8 + 4 + 4
    assert flown.left == []
    ends = [passed(flown.states[f"DF{i:05d}"], 15_050.0) for i in range(8)]
    # A steep sample comes late: BlueSky holds descents to the type's largest rate of climb.
    assert np.median(np.diff(ends)) == pytest.approx(60.0, abs=3.0)
    assert np.diff(ends) == pytest.approx(60.0, abs=45.0)


@pytest.mark.parametrize(
    ("models", "name", "said", "message"),
    [
        (2, "d.py", {}, "A320 twice; expected each type once"),
        (1, "d.py", {"fly_as": ["A319", "A320"]}, "types A319 A320 of 1 model; expected"),
        (1, "d.py", {"fly_as": "A319 A320"}, "type 'A319 A320'; expected letters and digits"),
        (1, "d.scn", {"prefix": "K L"}, "callsigns that begin 'K L'"),
        (1, "my-descents.py", {}, r"my-descents.py, which Python cannot import"),
        (0, "d.py", {}, "no model"),
    ],
)
def test_fleets_that_cannot_be_are_refused(
    a320: Path, tmp_path: Path, models: int, name: str, said: dict, message: str
) -> None:
    with pytest.raises(ConfigError, match=message):
        export([a320] * models, "bluesky", tmp_path / name, n=2, **PLACES, **said)
    with pytest.raises(ConfigError, match="models = 2 for cf; expected bluesky or bluebird"):
        export([a320, a320], "cf", tmp_path / "s.nc", n=2, **WHERE)
    assert list(tmp_path.iterdir()) == []


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
