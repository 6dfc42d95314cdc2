"""BlueSky flies what it is commanded; needs the extra `bluesky`."""

from datetime import UTC, datetime

import numpy as np
import pytest
import torch

from descentflow.core.units import FT_M, KT_MPS
from descentflow.physics.airspeed import mach_to_tas_mps
from flying.bluesky_fleet import Orders, fly, start
from flying.flight_plans import FlightPlan
from flying.profiles import Profile

START = datetime(2024, 3, 1, 10, tzinfo=UTC)
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
