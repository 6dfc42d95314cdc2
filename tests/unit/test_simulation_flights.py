"""The equation of motion against closed forms, and the laws by which causes differ between flights."""

import math
from dataclasses import replace

import numpy as np
import pytest
import torch
from scipy import stats
from scipy.integrate import solve_ivp
from toys import AIRCRAFT

from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
from descentflow.core.constants import G0_MPS2, LAPSE_K_M, P0_PA, R_AIR, T0_K
from descentflow.core.units import FL_M, FT_M, KT_MPS
from descentflow.physics.airspeed import cas_to_tas_mps
from descentflow.simulation.causes import Injection
from descentflow.simulation.flight import fly
from descentflow.simulation.motion import Controls, Dynamics, Motion
from descentflow.simulation.parameters import FlightParameters, draw_parameters
from descentflow.simulation.world_config import WorldConfig

QUIET = WorldConfig(wander_kt=0.0, level_off_share=0.0, managed_share=0.0, interval_s=1)


def draw(n: int, config: WorldConfig = QUIET, seed: int = 0) -> FlightParameters:
    return draw_parameters(AIRCRAFT, range(n), seed, config)


def hand_rates(state: list[float], mass: float, factor: float, cd0: float, dev: float, slope: float, gamma: float):
    """The motion of one flight above 10,000 ft in plain Python from the BADA manual, sharing no code with torch."""
    v, hp, _ = state
    a = AIRCRAFT
    isa = max(T0_K + LAPSE_K_M * hp, 216.65)
    if hp <= 11000:
        p = P0_PA * (isa / T0_K) ** (-G0_MPS2 / LAPSE_K_M / R_AIR)
    else:
        p11 = P0_PA * (216.65 / T0_K) ** (-G0_MPS2 / LAPSE_K_M / R_AIR)
        p = p11 * math.exp(-G0_MPS2 * (hp - 11000) / R_AIR / 216.65)
    q_s = 0.5 * p / R_AIR / (isa + dev) * v * v * a.wing_area_m2
    drag = q_s * (cd0 * a.cd0_cr + a.cd2_cr * (mass * G0_MPS2 / q_s) ** 2)
    ft = hp / FT_M
    climb = a.ct1 * (1 - ft / a.ct2 + a.ct3 * ft * ft) * (1 - min(max(a.ct5 * (dev - a.ct4), 0), 0.4))
    up = v * math.sin(gamma)
    acceleration = (factor * a.ct_des_high * climb - drag) / mass - G0_MPS2 * math.sin(gamma)
    return [acceleration - slope * up * math.cos(gamma), up * isa / (isa + dev), up]


@pytest.mark.parametrize("deviation", [0.0, 15.0])
def test_fixed_path_against_an_ode_solver(deviation: float) -> None:
    config = replace(QUIET, deviation_mean_k=deviation, wind_slope_mean_per_s=0.003)
    p = draw(1, config)
    gamma = math.radians(-2.5)
    values = [x.item() for x in (p.mass_kg, p.thrust_factor, p.cd0_factor, p.deviation_k, p.wind_slope_per_s)]
    begin = [225.0, 11500.0, 11700.0]
    exact = solve_ivp(
        lambda _, y: hand_rates(y, *values, gamma), (0, 300), begin, method="DOP853", rtol=1e-11, atol=1e-9, max_step=1
    ).y[:, -1]
    state = Motion(*(torch.tensor([x], dtype=torch.float64) for x in begin))
    zero = torch.zeros(1, dtype=torch.float64)
    for _ in range(300):
        state = Dynamics(AIRCRAFT, p).step(state, Controls(zero + gamma, zero, zero, zero), 1.0)
    # RK4 at 1 s on motions of minutes: only the kink of temperature at the tropopause costs more than rounding.
    assert state.tas_mps.item() == pytest.approx(exact[0], abs=1e-5)
    assert state.altitude_m.item() == pytest.approx(exact[1], abs=1e-4)
    assert state.height_m.item() == pytest.approx(exact[2], abs=1e-4)


def test_steady_rate_at_constant_cas_against_the_closed_form() -> None:
    """Energy: (Thr - D) V = m g dh/dt + m V d(V + w)/dt, with dV/dh of constant CAS by finite difference."""
    p = draw(16, replace(QUIET, cd0_spread=0.03))
    wind_slope = torch.tensor([0.0, 0.004]).double().repeat(8)
    p = replace(p, wind_slope_per_s=wind_slope)
    flown = fly(AIRCRAFT, p, QUIET)
    altitude, tas = flown.altitude_m, flown.tas_mps
    cas_slope = (cas_to_tas_mps(p.cas_mps, altitude + 1) - cas_to_tas_mps(p.cas_mps, altitude - 1)) / 2
    expected = (flown.thrust_n - flown.drag_n) * tas / p.mass_kg / (G0_MPS2 + tas * (cas_slope + wind_slope))
    # Only where the Mach phase and the capture of its successor are long over.
    quiet = flown.flying & (flown.label == 1) & (altitude < 6000) & (altitude > 3300) & (p.top_m > 9000)
    rate = tas * torch.sin(flown.gamma)
    assert int(quiet[:, ::2].sum()) > 1000
    assert int(quiet[:, 1::2].sum()) > 1000
    # The law holds CAS to 0.02 m/s while drag and thrust drift; the rate follows within half a per cent.
    torch.testing.assert_close(rate[quiet], expected[quiet], rtol=6e-3, atol=0)


def test_energy_changes_by_the_work_of_thrust_and_drag() -> None:
    config = replace(QUIET, level_off_share=1.0, managed_share=1.0)
    p = replace(draw(16, config), deviation_k=torch.tensor([0.0, 10.0]).double().repeat(8))
    flown = fly(AIRCRAFT, p, config)
    energy = p.mass_kg * (G0_MPS2 * flown.height_m + 0.5 * flown.tas_mps**2)
    power = (flown.thrust_n - flown.drag_n) * flown.tas_mps
    work = torch.cumulative_trapezoid(power, flown.time_s, dim=0)
    change = energy[1:] - energy[0]
    flying = flown.flying[1:]
    # Trapezia of 1 s: their error is that of the thrust's bends.
    torch.testing.assert_close(work[flying], change[flying], rtol=1e-4, atol=2e-5 * float(energy.max()))


def test_hot_air_stretches_geometric_height() -> None:
    config = replace(QUIET, deviation_mean_k=20.0)
    flown = fly(AIRCRAFT, draw(4, config), config)
    ratio = flown.height_m.diff(dim=0) / flown.altitude_m.diff(dim=0)
    low = flown.flying[1:] & (flown.altitude_m[1:] < 20 * FL_M + 95 * FL_M) & (flown.label[1:] == 1)
    # (T_isa + 20) / T_isa between FL95 and FL115: 1.0740 to 1.0754.
    assert ratio[low].min() > 1.0735
    assert ratio[low].max() < 1.0760


def test_steps_converge() -> None:
    """Only the autopilot's period is a setting of the world; the integration within it is exact for all purposes."""
    p = draw(8, WorldConfig(), seed=3)
    once, often = (fly(AIRCRAFT, p, replace(WorldConfig(), substeps=k)) for k in (1, 2))
    assert once.flying.equal(often.flying)
    # BADA's own step of idle thrust at H_p,des falls inside a period: 4 cm of altitude, soon flown out again.
    assert float((once.altitude_m - often.altitude_m).abs()[once.flying].max()) < 0.1
    assert float((once.tas_mps - often.tas_mps).abs()[once.flying].max()) < 0.02


def test_speed_is_held() -> None:
    config = replace(WorldConfig(), level_off_share=0.0, managed_share=0.0, interval_s=1)
    p = draw(64, config)
    flown = fly(AIRCRAFT, p, config)
    low = flown.flying & (flown.label == 1) & (flown.altitude_m < 6000)
    target = cas_to_tas_mps(p.cas_mps, flown.altitude_m)
    error = (flown.tas_mps - target)[low] / KT_MPS
    assert 0.3 < float(error.std()) < 3.0  # the pilot's wander, not the autopilot's error
    assert float(flown.gamma.max()) < math.radians(0.5)


A320 = open_aircraft("A320")
N = 600
CHANCE = 1e-3


def drawn(seed: int = 2, flights_per_aircraft: int = 5, **causes: dict[str, float]) -> FlightParameters:
    config = WorldConfig(low_top_share=0.0, flights_per_aircraft=flights_per_aircraft)
    return Injection(A320, causes, seed)(draw_parameters(A320, range(N), seed, config))


def fits(values: np.ndarray, law: str, *numbers: float) -> bool:
    return bool(stats.kstest(values, law, args=numbers).pvalue > CHANCE)


def share_fits(flags: np.ndarray, share: float) -> bool:
    return bool(stats.binomtest(int(flags.sum()), len(flags), share).pvalue > CHANCE)


@pytest.mark.parametrize(
    ("cause", "mean", "spread", "value", "low", "high"),
    [
        ("temperature", {"deviation_k": 8.0}, {"spread_k": 3.0}, "deviation_k", 8.0, 3.0),
        ("wind_gradient", {"slope_kt_per_kft": -1.0}, {"spread_kt_per_kft": 0.4}, "slope_kt_per_kft", -1.0, 0.4),
        ("mass", {"factor": 0.95}, {"spread": 0.05}, "factor", 0.95, 0.05),
        ("drag_polar", {"factor": 1.05}, {"spread": 0.03}, "factor", 1.05, 0.03),
    ],
)
def test_a_spread_is_normal(
    cause: str, mean: dict[str, float], spread: dict[str, float], value: str, low: float, high: float
) -> None:
    own = drawn(**{cause: mean | spread}).planted[f"{cause}_{value}"].numpy()
    assert fits(own, "norm", low, high)
    assert set(drawn(**{cause: mean}).planted[f"{cause}_{value}"].tolist()) == {low}


def test_brakes_have_levels_heights_and_drag_of_each_flights_own() -> None:
    values = {"factor": 1.5, "share": 0.6, "low_fl": 220.0, "high_fl": 270.0, "spread_fl": 15.0}
    p = drawn(speed_brake={**values, "depth_spread": 0.2, "strength_spread": 0.1})
    low, high, factor = (p.planted[f"speed_brake_{name}"].numpy() for name in ("low_fl", "high_fl", "factor"))
    taken = np.isfinite(low)
    assert share_fits(taken, 0.6)
    assert fits((low + high)[taken] / 2, "norm", 245, 15)
    assert fits((high - low)[taken], "norm", 50, 10)
    assert fits(factor[taken], "norm", 1.5, 0.05)
    assert p.injected is not None
    np.testing.assert_allclose(p.injected.brake_high_m.numpy()[taken], high[taken] * FL_M)
    assert not p.injected.brake_gain.numpy()[~taken].any()
    # No flight's window says anything of its drag.
    assert abs(stats.spearmanr((low + high)[taken], factor[taken]).statistic) < 0.18


def test_paths_and_rates_are_each_flights_own() -> None:
    p = drawn(geometric_path={"share": 1.0, "of_idle": 0.88, "of_idle_range": 0.08})
    alike = drawn(geometric_path={"share": 1.0, "of_idle": 1.0}).planted["geometric_path_angle_deg"].numpy()
    own = p.planted["geometric_path_angle_deg"].numpy()
    # Both rounded to the shallower tenth of a degree, so their ratio is blurred by a thirtieth.
    assert abs(np.mean(own / alike) - 0.88) < 0.02
    assert np.std(own / alike) == pytest.approx(0.16 / 12**0.5, rel=0.35)
    assert np.abs(own * 10 - np.round(own * 10)).max() < 1e-9
    held = drawn(vertical_speed_mode={"share": 1.0, "depth_fl": 80.0, "depth_range_fl": 30.0, "of_idle_range": 0.1})
    height = held.planted["vertical_speed_mode_high_fl"] - held.planted["vertical_speed_mode_low_fl"]
    room = (held.top_m - held.bottom_m).numpy() / FL_M > 80 + 30 + 50
    assert fits(height.numpy()[room], "uniform", 50, 60)
    rates = held.planted["vertical_speed_mode_rate_fpm"].numpy()
    assert len(np.unique(np.round(rates / 100))) > 5


def test_days_and_airframes_share_what_is_theirs() -> None:
    """Twenty days: deviations alike within a day, and by the spread between days."""
    p = drawn(flights_per_aircraft=20, temperature={"deviation_k": 0.0, "daily_spread_k": 4.0})
    own, day = p.planted["temperature_deviation_k"].numpy(), p.day.numpy()
    by_day = np.array([np.unique(own[day == k]) for k in range(20)])
    assert by_day.shape == (20, 1)
    assert fits(by_day[:, 0], "norm", 0.0, 4.0)
    p = drawn(vertical_rate_lag={"lag_s": 20.0, "spread_s": 3.0}, airspeed_bias={"bias_kt": 1.0, "spread_kt": 0.5})
    for name, mean, spread in (("vertical_rate_lag_lag_s", 20.0, 3.0), ("airspeed_bias_bias_kt", 1.0, 0.5)):
        own = p.planted[name].numpy().reshape(-1, 5)
        assert (own == own[:, :1]).all()
        assert fits(own[:, 0], "norm", mean, spread)


def test_a_share_of_the_flights_and_none_of_the_others() -> None:
    plain = drawn()
    heavy = drawn(mass={"factor": 1.2, "share": 0.3})
    taken = heavy.planted["mass_factor"].isfinite()
    assert share_fits(taken.numpy(), 0.3)
    np.testing.assert_allclose((heavy.mass_kg / plain.mass_kg).numpy(), np.where(taken, 1.2, 1.0))
    kept = drawn(kept_thrust={"share": 0.3, "share_range": 0.1, "decay_range_s": 50.0, "of_flights": 0.7})
    share, decay = (kept.planted[f"kept_thrust_{name}"].numpy() for name in ("share", "decay_s"))
    assert share_fits(np.isfinite(share), 0.7)
    assert fits(share[np.isfinite(share)], "uniform", 0.2, 0.2)
    assert fits(decay[np.isfinite(decay)], "uniform", 100, 100)
    powered = drawn(powered_descent={"share": 0.18, "share_range": 0.06, "of_flights": 1.0}).planted
    assert fits(powered["powered_descent_share"].numpy(), "uniform", 0.12, 0.12)
    slow = drawn(speed_schedule={"cas_kt": -15.0, "mach": -0.01, "spread_kt": 2.0, "share": 0.8})
    cas = slow.planted["speed_schedule_cas_kt"].numpy()
    assert share_fits(np.isfinite(cas), 0.8)
    assert fits(cas[np.isfinite(cas)], "norm", -15, 2)


def test_a_path_is_planned_for_the_speeds_and_forces_that_the_flight_meets() -> None:
    """Causes act in one order: less drag makes the idle path shallower, and the held one with it."""
    path = {"share": 1.0, "of_idle": 0.9}
    plain = drawn(geometric_path=path).planted["geometric_path_angle_deg"]
    for name, values in (("induced_drag", {"factor": 0.8}), ("speed_schedule", {"cas_kt": -40.0, "mach": -0.05})):
        changed = drawn(geometric_path=path, **{name: values}).planted["geometric_path_angle_deg"]
        assert float((changed - plain).mean()) > 0.02, name
