"""Flights of JSBSim's models: physics that nobody here wrote, so what holds is measured and not assumed."""

from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import polars as pl
import pytest
import torch
from numpy.typing import NDArray

pytest.importorskip("jsbsim", reason="JSBSim is an extra: pip install '.[jsbsim]'")

from descentflow.core.units import FL_M
from descentflow.physics.airspeed import tas_to_cas_mps
from descentflow.physics.atmosphere import isa_temperature_k, pressure_altitude_m
from descentflow.simulation.causes.air_and_instruments import KT_PER_KFT
from descentflow.surveillance.prepare import prepare
from descentflow.surveillance.rows.schema import COLUMNS
from studies.jsbsim_world.airframes import AIRFRAMES, airframe_of
from studies.jsbsim_world.flight_plans import JsbsimConfig
from studies.jsbsim_world.fly_models import JsbsimWorld, fly
from studies.jsbsim_world.model_files import copy_model

Array = NDArray[np.float64]
STEADY = JsbsimConfig(interval_s=1.0, wander_kt=0.0)
"""A row a second, and no wander of the speed held: what differs between two worlds is what was injected."""


def column(truth: pl.DataFrame, name: str) -> Array:
    return truth[name].to_numpy().astype(np.float64)


def gravity(height_m: Array) -> Array:
    """Normal gravity at 52 degrees north, with height."""
    return 9.780327 * (1 + 0.0053024 * np.sin(np.radians(52)) ** 2) / (1 + height_m / 6_371_000) ** 2


def at(truth: pl.DataFrame, name: str, altitude_m: Array) -> Array:
    """A column of one flight's truth at pressure altitudes, in its descent."""
    own = truth.filter(pl.col("rate_mps") < -1)
    return np.interp(-altitude_m, -column(own, "altitude_m"), column(own, name))


@pytest.fixture(scope="module")
def plain() -> JsbsimWorld:
    return fly("MD11", 1, seed=5, config=STEADY)


@pytest.mark.parametrize("model", AIRFRAMES)
@pytest.mark.parametrize("slope", [0.0, 2.0])
def test_energy_balances(model: str, slope: float) -> None:
    """Specific excess power (thrust minus drag, times speed, by weight) is the growth of the energy height.

    In air whose wind changes, the air's own acceleration along the path counts as well. Within 2 % at every second of
    the settled descent (differences over two seconds; brief accelerations are rounded off), 0.1 % on the mean.
    """
    wind = {"wind_gradient": {"slope_kt_per_kft": slope, "spread_kt_per_kft": 0.0}}
    (_, truth), *_ = fly(model, 1, seed=5, effects=wind, config=JsbsimConfig(interval_s=1.0)).truth.group_by(
        "flight_id"
    )
    height, tas, gamma, wind_mps = (column(truth, k) for k in ("height_m", "tas_mps", "gamma", "wind_mps"))
    g = gravity(height)
    growth = np.gradient(height) + tas * (np.gradient(tas) + np.cos(gamma) * np.gradient(wind_mps)) / g
    excess = (column(truth, "thrust_n") - column(truth, "drag_n")) / column(truth, "mass_kg")
    settled = (truth["label"] == "idle").to_numpy()[2:-2]
    ratio = (growth / (tas * excess / g))[2:-2][settled]
    assert len(ratio) > 200
    assert abs(ratio.mean() - 1) < 0.001
    assert np.abs(ratio - 1).max() < 0.02


def test_the_atmosphere_is_ours(plain: JsbsimWorld) -> None:
    truth = plain.truth
    altitude = torch.from_numpy(column(truth, "altitude_m"))
    isa = isa_temperature_k(altitude).numpy()
    assert np.abs(column(truth, "temperature_k") - isa).max() < 0.01
    # In standard air the pressure altitude is the geopotential height.
    height = column(truth, "height_m")
    assert np.abs(6_356_766 * height / (6_356_766 + height) - altitude.numpy()).max() < 20
    cas = tas_to_cas_mps(torch.from_numpy(column(truth, "tas_mps")), altitude)
    assert np.abs(cas.numpy() - column(truth, "cas_mps")).max() < 0.01
    assert float(pressure_altitude_m(22_632.04)) == pytest.approx(11_000, abs=1)


def test_warm_air_raises_the_true_airspeed_at_a_mach_number(plain: JsbsimWorld) -> None:
    warm = fly("MD11", 1, seed=5, effects={"temperature": {"deviation_k": 10.0, "spread_k": 0.0}}, config=STEADY)
    levels = np.array([340, 320, 240, 180]) * FL_M
    for (name,), own in plain.truth.group_by("flight_id"):
        hot = warm.truth.filter(pl.col("flight_id") == name)
        deviation = at(hot, "deviation_k", levels)
        # delta-T is added at geometric heights: at a pressure altitude less is left of it.
        assert ((deviation > 7.5) & (deviation < 10.0)).all()
        isa = isa_temperature_k(torch.from_numpy(levels)).numpy()
        ratio = at(hot, "tas_mps", levels) / at(own, "tas_mps", levels)
        by_mach = at(hot, "mach", levels) / at(own, "mach", levels)
        np.testing.assert_allclose(ratio / by_mach, np.sqrt(1 + deviation / isa), rtol=1e-4)
        np.testing.assert_allclose(by_mach, 1, atol=0.003)


def test_a_tailwind_gradient_slows_the_descent_by_the_closed_form(plain: JsbsimWorld) -> None:
    """Rate times ``(1 + G)`` is the same, ``G = (V/g)(dV/dh + dw/dh)``: -8 % at FL330 and -5 % at FL150 for 2 kt."""
    wind = {"wind_gradient": {"slope_kt_per_kft": 2.0, "spread_kt_per_kft": 0.0}}
    windy = fly("MD11", 1, seed=5, effects=wind, config=STEADY)
    levels = np.arange(160, 250, 5) * FL_M
    for (name,), own in plain.truth.group_by("flight_id"):
        blown = windy.truth.filter(pl.col("flight_id") == name)
        height, tas = at(own, "height_m", levels), at(own, "tas_mps", levels)
        slope = np.gradient(tas, height)
        g = gravity(height)
        expected = (1 + tas / g * slope) / (1 + tas / g * (slope + 2 * KT_PER_KFT)) - 1
        change = at(blown, "rate_mps", levels) / at(own, "rate_mps", levels) - 1
        assert (expected < -0.04).all()
        assert change.mean() == pytest.approx(expected.mean(), rel=0.05)
        np.testing.assert_allclose(change, expected, atol=0.006)


def test_rows_are_the_same_to_the_bit_for_the_same_seed() -> None:
    effects = {"speed_brake": {"factor": 1.5, "share": 0.5, "low_fl": 230, "high_fl": 280, "spread_fl": 10.0}}
    first, again = (fly("global5000", 3, seed=4, effects=effects) for _ in range(2))
    assert first.rows.equals(again.rows)
    assert first.truth.equals(again.truth)
    fewer = fly("global5000", 2, seed=4, effects=effects)
    names = fewer.flights["flight_id"].to_list()
    assert first.rows.filter(pl.col("flight_id").is_in(names)).equals(fewer.rows)
    assert not first.rows["vertical_rate"].equals(fly("global5000", 3, seed=5).rows["vertical_rate"])


@pytest.mark.parametrize("model", AIRFRAMES)
def test_prepare_keeps_most_flights(model: str) -> None:
    """Of 6 flights of each model at least 5 become descents."""
    world = fly(model, 6, seed=9, typecode=airframe_of(model).reference)
    assert set(world.rows.columns) <= set(COLUMNS)
    assert all(world.rows.schema[name] == COLUMNS[name] for name in world.rows.columns)
    descents = prepare(world.rows)
    assert descents.frame["flight_id"].n_unique() >= 5
    assert descents.frame["typecode"].unique().to_list() == [airframe_of(model).reference]


def test_flights_that_fail_are_counted_and_not_kept() -> None:
    # Some of these ask for speeds that the wing cannot fly.
    world = fly("MD11", 6, seed=0, config=JsbsimConfig(cas_spread_kt=80.0))
    assert 0 < len(world.failures) < 6
    assert len(world.flights) + len(world.failures) == 6
    assert set(world.failures["flight_id"]).isdisjoint(world.rows["flight_id"])
    assert world.failures["reason"].null_count() == 0
    assert f"{len(world.flights)} flights" in str(world)
    assert "failed" in str(world)


@pytest.mark.parametrize("model", AIRFRAMES)
def test_copies_read_and_write_nothing(model: str, tmp_path: Path) -> None:
    copy_model(airframe_of(model), tmp_path)
    text = (tmp_path / "aircraft" / model / f"{model}.xml").read_text()
    assert {child.tag for child in ElementTree.fromstring(text)}.isdisjoint({"input", "output", "system", "autopilot"})
    assert "port=" not in text
    assert text.count("injected/") == 3
