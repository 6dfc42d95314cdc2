from dataclasses import replace

import pytest
import torch

from descentflow.aircraft_types._standard_descent import GlobalParameters
from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
from descentflow.core.units import FL_M, FT_M, KT_MPS

DOUBLE = torch.float64
JET = replace(
    open_aircraft("A320"),
    vstall_ld_kt=100.0,
    des_cas_low_kt=290.0,
    des_cas_high_kt=300.0,
    des_mach=0.78,
)
PISTON = replace(JET, engine="piston", vstall_ld_kt=43.0, des_cas_low_kt=126.0, des_cas_high_kt=126.0, des_mach=0.0)


def kt(aircraft, altitude_ft, mass_kg=None):
    feet = torch.as_tensor(altitude_ft, dtype=DOUBLE)
    return aircraft.descent_cas_mps(feet * FT_M, mass_kg) / KT_MPS


def test_piston_schedule_step_by_step():
    feet = [0, 499, 500, 999, 1000, 1499, 1500, 9999, 10000, 14000]
    slow = 1.3 * 43
    speeds = [slow + 5, slow + 5, slow + 10, slow + 10, slow + 20, slow + 20, 126, 126, 126, 126]
    torch.testing.assert_close(kt(PISTON, feet), torch.tensor(speeds, dtype=DOUBLE), rtol=1e-12, atol=0)


def test_flight_levels_on_a_boundary_belong_to_the_range_above():
    levels = torch.tensor([5.0, 10.0, 15.0, 20.0, 30.0, 60.0, 100.0], dtype=DOUBLE)
    assert (JET.descent_cas_mps(levels * FL_M) == JET.descent_cas_mps(levels * FL_M + 1.0)).all()
    low = levels.float() * FL_M
    assert (JET.descent_cas_mps(low) == JET.descent_cas_mps(low + 1.0)).all()


def test_no_speed_exceeds_the_range_above_when_the_aircraft_is_heavy():
    heavy = kt(JET, [500, 1200, 1700, 2500, 4000, 8000], mass_kg=4 * JET.mass_reference_kg)
    assert (heavy.diff() >= 0).all()
    assert heavy[3].item() == pytest.approx(220.0)


def test_slow_types_keep_their_own_low_speed():
    slow = replace(JET, des_cas_low_kt=190.0)
    assert kt(slow, [4000, 8000]).tolist() == pytest.approx([190.0, 190.0])


def test_no_mach_schedule_means_no_crossover():
    turboprop = replace(JET, engine="turboprop", des_mach=0.0)
    assert turboprop.transition_altitude_m().item() == float("inf")
    assert not turboprop.holds_mach(torch.tensor([0.0, 15000.0])).any()
    assert kt(turboprop, [30000, 41000]).tolist() == pytest.approx([300.0, 300.0])


def test_no_mach_schedule_has_no_nan_gradient():
    cas = torch.tensor(250.0, dtype=DOUBLE, requires_grad=True)
    mach = torch.tensor(0.0, dtype=DOUBLE, requires_grad=True)
    ac = replace(JET, des_cas_high_kt=cas, des_mach=mach)
    speed = ac.descent_cas_mps(torch.tensor([5000.0, 12000.0], dtype=DOUBLE)).sum()
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
