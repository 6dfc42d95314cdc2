"""Forces, envelope and schedule of BADA 3 at edges that no file of the dummies has: absent and odd coefficients."""

from dataclasses import replace

import pytest
import torch

from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
from descentflow.aircraft_types.standard_descent import GlobalParameters
from descentflow.core.errors import AircraftError
from descentflow.core.units import FL_M, FT_M, KT_MPS
from descentflow.physics.atmosphere import pressure_pa
from descentflow.physics.performance_model import APPROACH, CLEAN, LANDING

DOUBLE = torch.float64
JET = replace(
    open_aircraft("A320"),
    ct1=140e3, ct2=50e3, ct3=1e-10, ct4=10.0, ct5=0.01, altitude_des_ft=20000.0,
    ct_des_low=0.05, ct_des_high=0.02, ct_des_app=0.15, ct_des_ld=0.3,
    cd0_ap=0.05, cd2_ap=0.04, cd0_ld=0.08, cd2_ld=0.037, cd0_gear=0.02, vstall_ld_kt=100.0,
    altitude_maximum_ft=39000.0, altitude_mtow_ft=33500.0, mass_maximum_kg=77000.0,
    altitude_mass_gradient_ft_kg=0.3, altitude_temperature_gradient_ft_k=-40.0, buffet_clbo=1.6, buffet_k=0.9,
    des_cas_low_kt=290.0, des_cas_high_kt=300.0, des_mach=0.78,
)  # fmt: skip
NO_POLARS = replace(JET, cd0_ap=0.0, cd2_ap=0.0, cd0_ld=0.0, cd2_ld=0.0, cd0_gear=0.0)


@pytest.mark.parametrize(("deviation", "left"), [(-20.0, 1.0), (10.0, 1.0), (20.0, 0.9), (50.0, 0.6), (90.0, 0.6)])
def test_heat_takes_between_nothing_and_two_fifths(deviation, left):
    hot, isa = JET.climb_thrust_n(3000.0, 200.0, torch.tensor([deviation, 0.0], dtype=DOUBLE))
    assert (hot / isa).item() == pytest.approx(left, rel=1e-12)


def test_a_negative_heat_coefficient_counts_as_zero():
    odd = replace(JET, ct5=-0.01)
    assert odd.climb_thrust_n(3000.0, 200.0, 40.0).item() == odd.climb_thrust_n(3000.0, 200.0).item()


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_a_flight_level_on_h_des_does_not_fall_off_it_by_rounding(dtype):
    ac = replace(JET, altitude_des_ft=15000.0)
    level = torch.tensor(150.0, dtype=dtype) * (100 * FT_M)
    share = ac.idle_thrust_n(level, 200.0) / ac.climb_thrust_n(level, 200.0)
    assert share.item() == pytest.approx(0.05, rel=1e-6)


def test_codes_in_a_tensor_mean_the_same_as_names():
    codes, names = torch.tensor([CLEAN, APPROACH, LANDING]), ("CR", "AP", "LD")
    by_name = [JET.drag_n(80.0, 500.0, configuration=name).item() for name in names]
    assert JET.drag_n(80.0, 500.0, configuration=codes).tolist() == by_name
    by_name = [JET.idle_thrust_n(500.0, 80.0, 0.0, name).item() for name in names]
    assert JET.idle_thrust_n(500.0, 80.0, 0.0, codes).tolist() == by_name
    with pytest.raises(AircraftError, match=r"'TO'.*CR, AP, LD"):
        JET.drag_n(80.0, 500.0, configuration="TO")


def test_h_des_rises_to_the_approach_ceiling_only_with_a_full_polar():
    low = replace(JET, altitude_des_ft=4000.0)
    assert low.descent_thrust_floor_ft().item() == 8000.0
    assert replace(NO_POLARS, altitude_des_ft=4000.0).descent_thrust_floor_ft().item() == 4000.0
    assert replace(low, cd0_gear=0.0).descent_thrust_floor_ft().item() == 4000.0


def test_bank_presses_the_wing():
    level, banked = JET.drag_n(120.0, 5000.0, load_factor=torch.tensor([1.0, 1.3], dtype=DOUBLE))
    assert banked > level


def test_configuration_by_altitude_and_speed():
    clean, approach = (JET.minimum_cas_mps(0.0, configuration=name).item() for name in ("CR", "AP"))
    cases = [
        # The thresholds lie 10 kt above the minimum speeds.
        (300.0, approach + 5.1, LANDING),
        (300.0, approach + 5.2, APPROACH),
        (300.0, clean + 5.2, CLEAN),
        (2000.0, approach + 5.1, APPROACH),
        (2000.0, clean + 5.2, CLEAN),
        (3000.0, 60.0, CLEAN),
        (3000 * FT_M, 60.0, APPROACH),
        (8000 * FT_M, 60.0, CLEAN),
        (80 * 30.48, 60.0, CLEAN),
    ]
    altitude, cas, expected = (torch.tensor(c, dtype=DOUBLE) for c in zip(*cases, strict=True))
    assert JET.descent_configuration(altitude, cas).tolist() == expected.int().tolist()


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_the_precision_of_the_batch_is_the_precision_of_the_result(dtype):
    altitude = torch.tensor([500.0, 2000.0, 9000.0], dtype=dtype)
    tas = torch.tensor([80.0, 120.0, 220.0], dtype=dtype)
    codes = torch.tensor([LANDING, APPROACH, CLEAN])
    for deviation in (5.0, torch.tensor(5.0, dtype=DOUBLE)):
        assert JET.idle_thrust_n(altitude, tas, deviation, codes).dtype == dtype
        assert JET.drag_n(tas, altitude, deviation, 60e3, codes).dtype == dtype
        assert JET.drag_n(80.0, altitude, deviation, 60e3, codes).dtype == dtype
        assert JET.climb_thrust_n(altitude, tas, deviation).dtype == dtype
    assert JET.stall_cas_mps(1e3 * tas, codes).dtype == dtype


def test_coefficients_batch():
    ac = replace(JET, cd0_cr=torch.tensor([[0.02], [0.03]], dtype=DOUBLE), altitude_des_ft=torch.tensor([[5e3], [4e4]]))
    altitude = torch.linspace(3e3, 1e4, 7, dtype=DOUBLE)
    assert ac.drag_n(200.0, altitude).shape == (2, 7)
    assert ac.idle_thrust_n(altitude, 200.0).shape == (2, 7)


def test_buffet_without_k_is_a_square_root_and_without_coefficients_nothing():
    flat = replace(JET, buffet_k=0.0)
    load = JET.mass_reference_kg * 9.80665 / JET.wing_area_m2 / (0.7 / 1.2) / pressure_pa(9000.0)
    assert flat.buffet_mach(9000.0).item() == pytest.approx((load / 1.6).sqrt().item(), rel=1e-12)
    assert replace(flat, buffet_clbo=0.0).buffet_mach(9000.0).item() == 0.0
    assert replace(JET, buffet_clbo=0.0).buffet_mach(9000.0).item() == 0.0


def test_a_wing_too_heavy_for_any_root_gives_zero_and_no_nan_gradient():
    mass = torch.tensor(3e6, dtype=DOUBLE, requires_grad=True)
    mach = JET.buffet_mach(12000.0, mass)
    assert mach.item() == 0.0
    assert torch.isfinite(torch.autograd.grad(mach, mass)[0])
    assert torch.isfinite(JET.minimum_cas_mps(12000.0, mass))


def test_pistons_never_feel_the_buffet():
    stall = 1.3 * JET.vstall_cr_kt * KT_MPS * (77000.0 / JET.mass_reference_kg) ** 0.5
    piston = replace(JET, engine="piston")
    assert piston.minimum_cas_mps(38000 * FT_M, 77000.0).item() == pytest.approx(stall, rel=1e-12)


def test_maximum_altitude_without_a_height_at_the_largest_mass_and_with_odd_gradients():
    assert replace(JET, altitude_mtow_ft=0.0).maximum_altitude_m(77000.0).item() == pytest.approx(39000 * FT_M)
    odd = replace(JET, altitude_mass_gradient_ft_kg=-1.0, altitude_temperature_gradient_ft_k=5.0)
    assert odd.maximum_altitude_m(50000.0, 30.0).item() == pytest.approx(33500 * FT_M)


def test_nominal_fuel_of_each_engine_by_hand():
    fuel = replace(JET, cf1=0.75, cf2=1000.0)
    for engine, wanted in (("jet", 0.75 * 1.2 * 30), ("turboprop", 0.75 * 0.8 * 0.2 * 30), ("piston", 0.75)):
        flow = replace(fuel, engine=engine).nominal_fuel_flow_kg_s(200 * KT_MPS, 30e3)
        assert flow.item() == pytest.approx(wanted / 60)


def kt(aircraft, altitude_ft, mass_kg=None):
    feet = torch.as_tensor(altitude_ft, dtype=DOUBLE)
    return aircraft.descent_cas_mps(feet * FT_M, mass_kg) / KT_MPS


def test_flight_levels_on_a_boundary_belong_to_the_range_above():
    levels = torch.tensor([5.0, 10.0, 15.0, 20.0, 30.0, 60.0, 100.0], dtype=DOUBLE)
    for low in (levels * FL_M, levels.float() * FL_M):
        assert (JET.descent_cas_mps(low) == JET.descent_cas_mps(low + 1.0)).all()


def test_no_speed_exceeds_the_range_above_when_the_aircraft_is_heavy():
    heavy = kt(JET, [500, 1200, 1700, 2500, 4000, 8000], mass_kg=4 * JET.mass_reference_kg)
    assert (heavy.diff() >= 0).all()
    assert heavy[3].item() == pytest.approx(220.0)


def test_slow_types_keep_their_own_low_speed():
    slow = replace(JET, des_cas_low_kt=190.0)
    assert kt(slow, [4000, 8000]).tolist() == pytest.approx([190.0, 190.0])


def test_no_mach_schedule_means_no_crossover_and_no_nan_gradient():
    turboprop = replace(JET, engine="turboprop", des_mach=0.0)
    assert turboprop.transition_altitude_m().item() == float("inf")
    assert not turboprop.holds_mach(torch.tensor([0.0, 15000.0])).any()
    assert kt(turboprop, [30000, 41000]).tolist() == pytest.approx([300.0, 300.0])
    cas, mach = (torch.tensor(value, dtype=DOUBLE, requires_grad=True) for value in (250.0, 0.0))
    speed = kt(replace(JET, des_cas_high_kt=cas, des_mach=mach), [15000, 40000]).sum()
    for slope in torch.autograd.grad(speed, (cas, mach), allow_unused=True):
        assert slope is None or torch.isfinite(slope)


def test_a_mach_crossover_below_10000_ft_waits_for_10000_ft():
    odd = replace(JET, des_mach=0.3)
    assert odd.transition_altitude_m().item() < 3000
    assert not odd.holds_mach(9000 * FT_M)
    assert odd.holds_mach(10000 * FT_M)


def test_global_parameters_move_the_schedule():
    calm = GlobalParameters(des_increment_kt=(0.0, 0.0, 0.0, 0.0), min_speed_factor=1.5)
    assert (replace(JET, limits=calm).descent_cas_mps(100.0) / KT_MPS).item() == pytest.approx(150.0)
