"""The equation of motion against closed forms and its own energy."""

import math
from dataclasses import replace

import pytest
import torch
from scipy.integrate import solve_ivp
from toys import AIRCRAFT

from descentflow.core.constants import G0_MPS2, LAPSE_K_M, P0_PA, R_AIR, T0_K
from descentflow.core.units import FL_M, FT_M, KT_MPS
from descentflow.physics.airspeed import cas_to_tas_mps
from descentflow.simulation._flight import fly
from descentflow.simulation._motion import Controls, Dynamics, Motion
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
