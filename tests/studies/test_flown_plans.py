"""Scripts that fly other simulators: plans from real flights, and reports of what was flown."""

from datetime import UTC, datetime

import numpy as np
import polars as pl
import pytest
import torch

from descentflow.core.units import FT_M, KT_MPS
from descentflow.physics.airspeed import mach_to_tas_mps
from flying.bluesky_fleet import Orders, fly, start
from flying.flight_plans import FlightPlan, cas_of_mach_kt, flight_plans
from flying.profiles import Profile
from flying.radar_reports import reports, table

START = datetime(2024, 3, 1, 10, tzinfo=UTC)


def descent(mach: float = 0.78, cas_kt: float = 290.0, name: str = "a1") -> pl.DataFrame:
    """Prepared descent from FL360 to FL110 at Mach, then CAS, 4 s a level."""
    levels = np.arange(360, 109, -1)
    cas = np.minimum([cas_of_mach_kt(mach, float(level)) for level in levels], cas_kt)
    n = len(levels)
    return pl.DataFrame(
        {
            "flight_id": [name] * n,
            "icao24": [name] * n,
            "typecode": ["A320"] * n,
            "level_fl": levels,
            "timestamp": [START.replace(minute=i * 4 // 60, second=i * 4 % 60) for i in range(n)],
            "IAS": cas,
            "Mach": np.where(cas < cas_kt, mach, np.nan),
            "vertical_rate": np.full(n, -1500.0),
            "TAS": pl.Series([None] * n, dtype=pl.Float64),
        }
    )


def test_plan_holds_the_schedule_that_was_flown() -> None:
    """The crossover of M 0.78 and 290 kt lies at FL313, so both speeds are seen as they are."""
    plan = flight_plans(descent(), None, 150.0)[0]
    assert (plan.top_fl, plan.bottom_fl, plan.intervals_s) == (360.0, 150.0, (4.0,))
    assert plan.mach == pytest.approx(0.78)
    assert plan.cas_kt == pytest.approx(290.0)
    assert plan.channels == ("vertical_rate", "Mach")  # a channel without a value is not reported


def test_rows_say_how_often_and_whether_a_rate_was_reported() -> None:
    seconds = [0, 7, 7, 20, 400, 412]
    rows = pl.DataFrame(
        {
            "icao24": ["a1"] * 6 + ["b2"],
            "timestamp": [START.replace(minute=s // 60, second=s % 60) for s in [*seconds, 3]],
            "vertical_rate": pl.Series([None] * 7, dtype=pl.Float64),
        }
    )
    plan = flight_plans(descent(), rows, 100.0)[0]
    assert plan.intervals_s == (7.0, 13.0, 12.0)  # neither the repeated report nor the loss of 380 s
    assert "vertical_rate" not in plan.channels  # `prepare` had differenced it


def test_reports_are_sampled_at_the_intervals_and_quantised() -> None:
    plan = FlightPlan("f", "a1", "A320", START, 360, 100, 0.78, 290, (4.0, 9.0), ("vertical_rate", "track", "Mach"))
    time = np.arange(0.0, 41.0)
    state = {
        "time_s": time,
        "altitude": 36000.0 - 30.0 * time,
        "IAS": 250.0 + 0.1 * time,
        "vertical_rate": np.full(41, -1807.0),
        "track": (359.0 + 0.1 * time) % 360,  # through north
        "latitude": 0.001 * time,
        "longitude": 0.0 * time,
    }
    rows = reports(plan, state, number=2)
    seconds = [(stamp - START).total_seconds() - 2 * 86400 for stamp in rows["timestamp"]]
    assert seconds == [0, 4, 13, 17, 26, 30, 39]
    assert rows["altitude"].to_list() == [25 * round((36000 - 30 * s) / 25) for s in seconds]
    assert set(rows["vertical_rate"]) == {-1792.0}  # 56 steps of 32 ft/min
    assert all(t > 358 or t < 3.1 for t in rows["track"])
    assert "Mach" not in rows.columns  # the state has none
    assert table([rows, rows.drop("track")]).height == 14


pytestmark = pytest.mark.filterwarnings("ignore")  # BlueSky's own, at import


def plan(typecode: str = "A320", mach: float = 0.78, cas_kt: float = 290.0) -> FlightPlan:
    return FlightPlan("f", "a1", typecode, START, 360, 150, mach, cas_kt, (4.0,), ("Mach",))


@pytest.fixture(scope="module")
def bluesky() -> object:
    pytest.importorskip("bluesky", reason="BlueSky is an extra: pip install '.[bluesky]'")
    return start()


def test_commanded_rates_speeds_and_wind_are_flown(bluesky: object) -> None:
    """Tolerances: BlueSky moves in steps of 0.5 s and changes its vertical speed by 300 ft/min a second."""
    rates, wind = Profile((150.0, 350.0), (-1500.0, -2500.0)), Profile((150.0, 350.0), (20.0, 60.0))
    state = fly(bluesky, [plan(), plan("B738", cas_kt=270.0)], Orders(step_ft=1000.0, rates_fpm=rates, wind_kt=wind))[0]
    level = state["altitude"] / 100
    settled = level < 340
    expected = np.interp(level, rates.levels_fl, rates.values)
    assert np.abs(state["vertical_rate"] - expected)[settled].max() < 60
    tailwind = state["groundspeed"] - state["TAS"]
    assert np.abs(tailwind - np.interp(level, wind.levels_fl, wind.values)).max() < 1
    assert np.abs(state["IAS"] - 290)[level < 290].max() < 2
    assert np.abs(state["Mach"] - 0.78)[(level > 325) & settled].max() < 0.005


def test_warmer_air_is_faster_at_the_same_mach_number_and_cooler_again_after(bluesky: object) -> None:
    """sqrt of the ratio of temperatures, at the same Mach number; heights of pressures stretch by it (hypsometry)."""
    warm, standard = (fly(bluesky, [plan()], Orders(step_ft=1000.0, warmer_k=kelvin))[0] for kelvin in (12.0, 0.0))
    height = torch.from_numpy(warm["altitude"] * FT_M)
    expected = mach_to_tas_mps(torch.from_numpy(warm["Mach"]), height, 12.0).numpy() / KT_MPS
    assert np.abs(expected - warm["TAS"]).max() < 0.5
    assert np.abs(warm["Mach"] - 0.78)[warm["altitude"] > 33500].max() < 0.005
    stretched = np.diff(warm["geoaltitude"]) / np.diff(warm["altitude"])
    kelvin = 288.15 - 0.0065 * height.numpy()
    assert np.abs(stretched - 1 - 12.0 / (0.5 * (kelvin[1:] + kelvin[:-1]))).max() < 1e-3
    assert np.abs(standard["geoaltitude"] - standard["altitude"]).max() < 1e-6
