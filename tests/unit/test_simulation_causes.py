"""Every cause that a world can inject, against plain formulas, sensors against their definitions."""

import math
from dataclasses import replace
from functools import cache

import numpy as np
import polars as pl
import pytest
from polars.testing import assert_frame_equal

from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
from descentflow.core.errors import ConfigError
from descentflow.core.units import FL_M, FPM_MPS, FT_M, KT_MPS
from descentflow.simulation.causes import Injection
from descentflow.simulation.world import World, simulate
from descentflow.simulation.world_config import WorldConfig

A320 = open_aircraft("A320")
N, SEED = 40, 5
G, R_AIR, T0, LAPSE, P0 = 9.80665, 287.05287, 288.15, -0.0065, 101325.0
EXACT = {"jitter_s": 0.0, "dropout_share": 0.0, "gap_share": 0.0, "altitude_noise_ft": 0.0}
EXACT |= {"rate_noise_fpm": 0.0, "cas_noise_kt": 0.0, "mach_noise": 0.0, "tas_noise_kt": 0.0}
QUIET = WorldConfig(wander_kt=0.0, level_off_share=0.0, managed_share=0.0, low_top_share=0.0, **EXACT)
QUIET = replace(QUIET, top_range=(0.9, 0.95), mass_range=(0.75, 0.88), bottom_fl=140.0, step_s=2.0, interval_s=2)


def fly(**causes: dict[str, float]) -> World:
    return simulate(A320, N, SEED, QUIET, inject=Injection(A320, causes, SEED) if causes else None)


@pytest.fixture(scope="module")
def plain() -> World:
    return fly()


def at_level(world: World, level_fl: float, column: str = "rate_mps") -> np.ndarray:
    """A truth column of every flight at a pressure altitude in settled idle descent, NaN elsewhere."""
    values = []
    for flight in world.truth.partition_by("flight_id", maintain_order=True):
        idle = flight.filter(pl.col("label").is_in(["idle", "constant_path"])).sort("altitude_m")
        altitude = idle["altitude_m"].to_numpy()
        wanted = level_fl * FL_M
        inside = len(altitude) and altitude[0] < wanted < altitude[-1] - 900
        values.append(np.interp(wanted, altitude, idle[column].to_numpy()) if inside else np.nan)
    return np.array(values)


def change(plain: World, injected: World, level_fl: float, column: str = "rate_mps") -> np.ndarray:
    """Relative change of a truth column, flight by flight, of those above (or below) their crossover in both."""
    before, after = at_level(plain, level_fl, column), at_level(injected, level_fl, column)
    return after / before - 1


def thrust_in_hand(plain: World, powered: World, name: str) -> pl.DataFrame:
    """Truth of a flight, with its thrust above the idle thrust of the plain flight there, in units of drag minus it."""
    flight, idle = powered.truth.filter(flight_id=name), plain.truth.filter(flight_id=name, label="idle")
    idle = idle.sort("altitude_m")
    begun = plain.flights.filter(flight_id=name)["cruise_s"].item() + 60
    high, low = idle["altitude_m"].max(), idle["altitude_m"].min()
    flight = flight.filter(pl.col("time_s") > begun, pl.col("altitude_m").is_between(low, high))
    thrust = pl.Series(np.interp(flight["altitude_m"], idle["altitude_m"], idle["thrust_n"]))
    return flight.with_columns(in_hand=(pl.col("thrust_n") - thrust) / (pl.col("drag_n") - thrust))


def by_hand(plain: World, level_fl: float) -> dict[str, np.ndarray]:
    """Forces, speeds and energy share of the plain flights at a level, from the manual's formulas."""
    mach, tas = at_level(plain, level_fl, "mach"), at_level(plain, level_fl, "tas_mps")
    altitude = level_fl * FL_M
    temperature = T0 + LAPSE * altitude
    pressure = P0 * (temperature / T0) ** (-G / LAPSE / R_AIR)
    parasitic = 0.5 * pressure / R_AIR / temperature * tas**2 * A320.wing_area_m2 * A320.cd0_cr
    parasitic = parasitic * plain.flights["cd0_factor"].to_numpy()
    drag, thrust = at_level(plain, level_fl, "drag_n"), at_level(plain, level_fl, "thrust_n")
    y = 1 + 0.2 * mach**2
    lapse = 1.4 * R_AIR * LAPSE / 2 / G * mach**2
    # Constant CAS below the crossover (some FL290), constant Mach above.
    share = lapse + (y**-2.5 * (y**3.5 - 1) if level_fl < 250 else 0.0)
    return {"tas": tas, "mach": mach, "d0": parasitic, "di": drag - parasitic, "thrust": thrust, "g": share} | {
        "x": drag - thrust,
        "t": np.full(N, temperature),
        "lapse": lapse,
    }


def expected(name: str, h: dict[str, np.ndarray]) -> np.ndarray:
    """Relative change of the rate of descent by the total-energy equation."""
    if name == "temperature":  # dHp/dt = -tau X V / (m g (1 + G)), V as sqrt(T), the lapse's share as tau
        tau = h["t"] / (h["t"] + 10)
        return tau * (1 / tau) ** 0.5 * (1 + h["g"]) / (1 + h["g"] + h["lapse"] * (tau - 1)) - 1
    if name == "wind_gradient":
        return (1 + h["g"]) / (1 + h["g"] + h["tas"] / G * 2 * KT_MPS / (1000 * FT_M)) - 1
    if name == "mass":
        return (h["d0"] + 0.81 * h["di"] - h["thrust"]) / h["x"] / 0.9 - 1
    if name == "idle_thrust":
        return -0.8 * h["thrust"] / h["x"]
    if name == "drag_polar":
        return 0.1 * h["d0"] / h["x"]
    raise KeyError(name)


ONE = {
    "temperature": {"deviation_k": 10.0},
    "wind_gradient": {"slope_kt_per_kft": 2.0},
    "mass": {"factor": 0.9},
    "idle_thrust": {"factor": 1.8},
    "drag_polar": {"factor": 1.1},
}


@cache
def injected(name: str) -> World:
    """A world with one cause of a table, flown once."""
    return fly(**{name: ONE[name]})


@pytest.mark.parametrize("name", ONE)
def test_rate_changes_as_the_energy_equation_says(name: str, plain: World) -> None:
    """Flown in time and computed by hand: the middle flight agrees within 0.05 % of the rate.

    A few flights are still in the transient of their crossover, and so the middle one counts and not the mean.
    """
    changed = injected(name)
    for level in (330, 200):
        rates = change(plain, changed, level)
        h = by_hand(plain, level)
        # Above the crossover by a margin, so that both flights hold Mach there (or both hold CAS).
        cas = h["mach"] < 0.995 * plain.flights["mach"].to_numpy()
        seen = np.isfinite(rates) & (cas if level < 250 else ~cas)
        assert seen.sum() > 20
        want = expected(name, h)[seen]
        assert np.median(rates[seen] - want) == pytest.approx(0, abs=5e-4), level


def test_brakes_compressibility_and_banks_raise_the_drag_they_should(plain: World) -> None:
    brake = fly(speed_brake={"factor": 1.6, "share": 0.5, "low_fl": 200.0, "high_fl": 240.0})
    h = by_hand(plain, 220)
    drag = change(plain, brake, 220, "drag_n")
    braked = brake.flights["planted_speed_brake_factor"].is_not_null().to_numpy()
    assert 0.3 < braked.mean() < 0.7
    np.testing.assert_allclose(drag[braked], (0.6 * h["d0"] / (h["d0"] + h["di"]))[braked], rtol=0.05)
    assert np.nanmax(np.abs(drag[~braked])) < 1e-6
    assert np.nanmax(np.abs(change(plain, brake, 260, "drag_n"))) < 1e-9
    wave = change(plain, fly(compressibility={"gain": 0.2}), 330, "drag_n")
    h = by_hand(plain, 330)
    rise = 0.2 * ((h["mach"] - (A320.des_mach - 0.06)) / 0.06).clip(0) ** 2 * h["d0"] / (h["d0"] + h["di"])
    seen = np.isfinite(wave)
    assert np.abs(wave - rise)[seen].max() < 0.01
    induced = change(plain, fly(induced_drag={"factor": 1.1}), 330, "drag_n")
    assert np.abs(induced - 0.1 * h["di"] / (h["d0"] + h["di"]))[np.isfinite(induced)].max() < 5e-3
    turn = fly(turn={"bank_deg": 30.0, "share": 1.0, "depth_fl": 40.0})
    high = turn.flights["planted_turn_high_fl"].to_numpy()
    flight = int(np.flatnonzero((high > 215) & (high < 235))[0])
    h = by_hand(plain, 200)
    rise = h["di"] / (h["d0"] + h["di"]) * (1 / math.cos(math.radians(30)) ** 2 - 1)
    assert change(plain, turn, 200, "drag_n")[flight] == pytest.approx(rise[flight], rel=0.05)
    rows = turn.rows.partition_by("flight_id", maintain_order=True)[flight]
    inside = rows.filter(pl.col("altitude").is_between(100 * high[flight] - 3000, 100 * high[flight] - 1000))
    seconds = inside["timestamp"].dt.epoch("us").to_numpy() / 1e6
    turned = np.unwrap(np.radians(inside["heading"].to_numpy()))
    by_bank = G * math.tan(math.radians(30)) / (inside["TAS"].to_numpy().mean() * KT_MPS)
    assert abs(np.polyfit(seconds, turned, 1)[0]) == pytest.approx(by_bank, rel=0.03)


def test_thrust_kept_up_decays_from_the_top(plain: World) -> None:
    kept = fly(kept_thrust={"share": 0.4, "decay_s": 150.0})
    for name in kept.flights["flight_id"].to_list()[:10]:
        cruise = plain.flights.filter(flight_id=name)["cruise_s"].item()
        seen = thrust_in_hand(plain, kept, name).filter(pl.col("time_s") < cruise + 400)
        want = 0.4 * np.exp(-(seen["time_s"] - cruise) / 150)
        assert np.abs(seen["in_hand"].to_numpy() - want.to_numpy()).max() < 0.03


def test_thrust_all_the_way_down_and_between_two_levels_is_that_share_of_drag(plain: World) -> None:
    """By the energy balance the rate falls by the very share of drag minus idle thrust that thrust keeps."""
    powered = fly(powered_descent={"share": 0.18, "share_range": 0.05})
    iced = fly(anti_ice={"share": 1.0, "drag_share": 0.4, "low_fl": 200.0, "high_fl": 260.0, "spread_fl": 8.0})
    slower = []
    for name in powered.flights["flight_id"].to_list()[:10]:
        share = powered.flights.filter(flight_id=name)["planted_powered_descent_share"].item()
        seen = thrust_in_hand(plain, powered, name)
        # Thrust follows drag and idle thrust, which change with altitude and at the crossover, by a lag of 4 to 8 s.
        assert np.abs(seen["in_hand"].to_numpy() - share).max() < 0.01
        idle = plain.truth.filter(flight_id=name, label="idle").sort("altitude_m")
        steady = seen.filter(pl.col("altitude_m").is_between(170 * FL_M, 230 * FL_M))
        rate = np.interp(steady["altitude_m"], idle["altitude_m"], idle["rate_mps"])
        slower.append(np.median(steady["rate_mps"] / rate) - (1 - share))
        about = iced.flights.filter(flight_id=name)
        low, high = (about[f"planted_anti_ice_{end}_fl"].item() * FL_M for end in ("low", "high"))
        assert (high - low) / FL_M == pytest.approx(60)
        seen = thrust_in_hand(plain, iced, name)
        inside = seen.filter(pl.col("altitude_m").is_between(low + 300, high - 600))
        outside = seen.filter(~pl.col("altitude_m").is_between(low - 600, high + 100))
        assert np.abs(inside["in_hand"].to_numpy() - 0.4).max() < 0.02
        assert np.abs(outside["in_hand"].to_numpy()).max() < 0.02
    assert np.abs(slower).max() < 2e-3


def test_a_geometric_path_is_straight_and_a_held_rate_constant() -> None:
    path = fly(geometric_path={"share": 1.0, "of_idle": 0.9}).truth.filter(label="constant_path")
    slope = pl.col("rate_mps") / (pl.col("tas_mps") * pl.col("gamma").cos())
    by_flight = path.group_by("flight_id").agg(
        slope.std().alias("spread"), slope.mean().alias("slope"), (pl.col("cas_mps") / KT_MPS).max().alias("cas")
    )
    assert len(by_flight) == N
    assert by_flight["spread"].max() < 2e-4
    tenths = np.degrees(np.arctan(by_flight["slope"].to_numpy())) * 10
    assert np.abs(tenths - np.round(tenths)).max() < 0.05
    assert path["thrust_n"].min() > 0
    values = {"share": 1.0, "of_idle": 0.9, "depth_fl": 80.0}
    held = fly(vertical_speed_mode=values).truth.filter(label="constant_rate")
    rate = held.group_by("flight_id").agg(pl.col("rate_mps").median() / FPM_MPS, pl.len())
    assert len(rate) > 0.9 * N
    assert np.abs(rate["rate_mps"] / 100 - (rate["rate_mps"] / 100).round()).max() < 0.05
    assert rate["len"].median() > 30  # 4 s apart: more than two minutes


def test_level_offs_and_speeds_are_those_asked_for(plain: World) -> None:
    truth = fly(level_off={"share": 0.6, "duration_s": 90.0}).truth.filter(label="level_off")
    assert truth["flight_id"].n_unique() / N == pytest.approx(0.6, abs=0.15)
    assert truth.group_by("flight_id").len()["len"].median() == pytest.approx(90 / 4, abs=2)
    slow = fly(speed_schedule={"cas_kt": -20.0, "mach": -0.02})
    fell = at_level(slow, 160, "cas_mps") - at_level(plain, 160, "cas_mps")
    np.testing.assert_allclose(fell / KT_MPS, -20, atol=0.2)
    high = at_level(slow, 340, "mach") - at_level(plain, 340, "mach")
    assert np.nanmedian(high) == pytest.approx(-0.02, abs=1e-3)


def test_instruments_err_exactly_as_injected(plain: World) -> None:
    wrong = fly(airspeed_bias={"bias_kt": 2.0, "slope_kt_per_mach": 25.0}, vertical_rate_lag={"lag_s": 12.0})
    assert_frame_equal(wrong.truth, plain.truth)
    assert_frame_equal(wrong.rows.drop("IAS", "vertical_rate"), plain.rows.drop("IAS", "vertical_rate"))
    error = wrong.rows["IAS"].to_numpy() - plain.truth["cas_mps"].to_numpy() / KT_MPS
    np.testing.assert_allclose(error, 2 + 25 * (plain.truth["mach"].to_numpy() - 0.6), atol=0.501)
    rate = plain.truth.filter(flight_id=plain.truth["flight_id"][0])["rate_mps"].to_numpy() / FPM_MPS
    keep, held = math.exp(-4 / (3 + 12)), [rate[0]]
    for value in rate[1:]:
        held.append(keep * held[-1] + (1 - keep) * value)
    np.testing.assert_allclose(wrong.rows["vertical_rate"].to_numpy()[: len(held)], held, atol=16.001)
    noisy, quiet = (
        simulate(A320, 20, 0, WorldConfig(bottom_fl=220.0, low_top_share=0.0, step_s=2.0, interval_s=2), inject=inject)
        for inject in (Injection(A320, {"measurement_noise": {"factor": 3.0}}, 0), None)
    )
    assert_frame_equal(noisy.truth, quiet.truth)
    spread = (noisy.rows["vertical_rate"] - quiet.rows["vertical_rate"]).std()
    # Two of the three standard deviations of 40 ft/min are not common to both; each is rounded to 32 ft/min.
    assert spread == pytest.approx((80**2 + 2 * 32**2 / 12) ** 0.5, rel=0.05)


def test_a_flight_depends_on_its_seed_and_number_alone() -> None:
    together = {"temperature": {"spread_k": 4.0}, "speed_brake": {"spread_fl": 20.0}, "level_off": {}, "turn": {}}
    inject = Injection(A320, together, SEED)
    config = WorldConfig(bottom_fl=240.0, low_top_share=0.0, step_s=2.0, interval_s=2)
    whole = simulate(A320, 12, SEED, config, inject=inject)
    parts = simulate(A320, 12, SEED, config, inject=inject, chunk=7)
    assert_frame_equal(whole.rows, parts.rows)
    assert_frame_equal(whole.flights, parts.flights)


@pytest.mark.parametrize(
    ("plant", "message"),
    [
        ({"nonsense": {}}, "to plant nonsense; expected one of temperature, wind_gradient, mass"),
        ({"mass": {"percent": 3.0}}, "mass with percent; expected of mass: factor=0.9 mean factor"),
        ({"mass": {"factor": 9.0}}, "mass with factor=9; expected a finite number, at least 0.5 and at most 1.5"),
        ({"temperature": {"deviation_k": math.nan}}, "deviation_k': nan.*expected .* a finite number"),
        ({"speed_brake": {"low_fl": 300.0}}, "low_fl < high_fl"),
        ({"geometric_path": {"of_idle": 0.95, "of_idle_range": 0.1}}, r"of_idle \+ of_idle_range <= 1"),
    ],
)
def test_what_cannot_be_planted_is_refused(plant: dict[str, dict[str, float]], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        simulate(A320, 1, plant=plant)


def test_planting_is_injecting_and_the_flights_say_what_each_has_got() -> None:
    plant = {"speed_brake": {"share": 0.5, "spread_fl": 20.0}, "temperature": {"deviation_k": 5.0}}
    config = replace(QUIET, bottom_fl=260.0)
    planted = simulate(A320, 12, SEED, config, plant=plant)
    assert_frame_equal(planted.rows, simulate(A320, 12, SEED, config, inject=Injection(A320, plant, SEED)).rows)
    assert planted.planted["speed_brake"]["factor"] == 1.6
    assert "planted: speed_brake (factor=1.6, share=0.5" in str(planted)
    assert planted.flights["planted_temperature_deviation_k"].to_list() == [5.0] * 12
    braked = planted.flights["planted_speed_brake_factor"] > 1
    assert 0 < braked.sum() < 12
    own = planted.flights["planted_speed_brake_high_fl"]
    assert (own.is_not_null() == braked.fill_null(False)).all()
    assert own.n_unique() == braked.sum() + 1
