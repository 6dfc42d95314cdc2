from dataclasses import replace

import pytest
import torch

from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
from descentflow.core.units import FT_M, KT_MPS
from descentflow.physics.atmosphere import pressure_pa

DOUBLE = torch.float64
JET = replace(
    open_aircraft("A320"),
    vmo_kt=350.0,
    mmo=0.82,
    altitude_maximum_ft=39000.0,
    altitude_mtow_ft=33500.0,
    altitude_mass_gradient_ft_kg=0.3,
    altitude_temperature_gradient_ft_k=-40.0,
    mass_maximum_kg=77000.0,
    ct4=10.0,
    buffet_clbo=1.6,
    buffet_k=0.9,
    cf1=0.75,
    cf2=1000.0,
    cf3=14.0,
    cf4=52000.0,
)


def test_buffet_without_k_is_a_square_root_and_without_coefficients_nothing():
    flat = replace(JET, buffet_k=0.0)
    load = JET.mass_reference_kg * 9.80665 / JET.wing_area_m2 / (0.7 / 1.2) / pressure_pa(9000.0)
    assert flat.buffet_mach(9000.0).item() == pytest.approx((load / 1.6).sqrt().item(), rel=1e-12)
    none = replace(JET, buffet_clbo=0.0, buffet_k=0.0)
    assert none.buffet_mach(9000.0).item() == 0.0
    assert replace(JET, buffet_clbo=0.0).buffet_mach(9000.0).item() == 0.0


def test_a_wing_too_heavy_for_any_root_gives_zero_and_no_nan_gradient():
    mass = torch.tensor(3e6, dtype=DOUBLE, requires_grad=True)
    mach = JET.buffet_mach(12000.0, mass)
    assert mach.item() == 0.0
    assert torch.isfinite(torch.autograd.grad(mach, mass)[0])
    assert torch.isfinite(JET.minimum_cas_mps(12000.0, mass))


def test_minimum_speed_feels_the_buffet_from_15000_ft_and_pistons_never():
    heavy = 77000.0
    stall = 1.3 * JET.vstall_cr_kt * KT_MPS * (heavy / JET.mass_reference_kg) ** 0.5
    assert JET.minimum_cas_mps(14999 * FT_M, heavy).item() == pytest.approx(stall, rel=1e-12)
    assert JET.minimum_cas_mps(38000 * FT_M, heavy).item() > stall
    piston = replace(JET, engine="piston")
    assert piston.minimum_cas_mps(38000 * FT_M, heavy).item() == pytest.approx(stall, rel=1e-12)


def test_maximum_altitude_by_hand():
    assert JET.maximum_altitude_m(70000.0).item() == pytest.approx((33500 + 0.3 * 7000) * FT_M)
    assert JET.maximum_altitude_m(70000.0, 20.0).item() == pytest.approx((33500 + 2100 - 400) * FT_M)
    assert JET.maximum_altitude_m(50000.0).item() == pytest.approx(39000 * FT_M)
    assert replace(JET, altitude_mtow_ft=0.0).maximum_altitude_m(77000.0).item() == pytest.approx(39000 * FT_M)
    odd = replace(JET, altitude_mass_gradient_ft_kg=-1.0, altitude_temperature_gradient_ft_k=5.0)
    assert odd.maximum_altitude_m(50000.0, 30.0).item() == pytest.approx(33500 * FT_M)


def test_fuel_by_hand():
    assert JET.idle_fuel_flow_kg_s(13000 * FT_M).item() == pytest.approx(14 * 0.75 / 60)
    assert JET.nominal_fuel_flow_kg_s(200 * KT_MPS, 30e3).item() == pytest.approx(0.75 * 1.2 * 30 / 60)
    prop = replace(JET, engine="turboprop")
    assert prop.nominal_fuel_flow_kg_s(200 * KT_MPS, 30e3).item() == pytest.approx(0.75 * 0.8 * 0.2 * 30 / 60)
    piston = replace(JET, engine="piston", cf1=0.4, cf3=0.3, cf4=0.0)
    assert piston.nominal_fuel_flow_kg_s(50.0, 1e3).item() == pytest.approx(0.4 / 60)
    assert piston.fuel_flow_kg_s(1000.0, 50.0, 1e3).item() == pytest.approx(0.3 / 60)
