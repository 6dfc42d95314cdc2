from dataclasses import replace

import pytest
import torch

from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
from descentflow.core.errors import AircraftError
from descentflow.core.units import FT_M, KT_MPS
from descentflow.physics.atmosphere import density_kg_m3
from descentflow.physics.performance_model import APPROACH, CLEAN, LANDING

DOUBLE = torch.float64
JET = replace(
    open_aircraft("A320"),
    ct1=140e3,
    ct2=50e3,
    ct3=1e-10,
    ct4=10.0,
    ct5=0.01,
    ct_des_low=0.05,
    ct_des_high=0.02,
    ct_des_app=0.15,
    ct_des_ld=0.3,
    altitude_des_ft=20000.0,
    cd0_ap=0.05,
    cd2_ap=0.04,
    cd0_ld=0.08,
    cd2_ld=0.037,
    cd0_gear=0.02,
)
NO_POLARS = replace(JET, cd0_ap=0.0, cd2_ap=0.0, cd0_ld=0.0, cd2_ld=0.0, cd0_gear=0.0)


def test_jet_thrust_by_hand():
    # 10,000 ft: 140e3 (1 - 0.2 + 0.01)
    assert JET.climb_thrust_n(10000 * FT_M, 200.0).item() == pytest.approx(113.4e3, rel=1e-12)


def test_turboprop_and_piston_thrust_by_hand():
    turboprop = replace(JET, engine="turboprop", ct1=4.9e6, ct2=45e3, ct3=2650.0)
    piston = replace(JET, engine="piston", ct1=1100.0, ct2=28e3, ct3=8800.0)
    assert turboprop.climb_thrust_n(9000 * FT_M, 200 * KT_MPS).item() == pytest.approx(24500 * 0.8 + 2650)
    assert piston.climb_thrust_n(7000 * FT_M, 110 * KT_MPS).item() == pytest.approx(1100 * 0.75 + 80)


@pytest.mark.parametrize(("deviation", "left"), [(-20.0, 1.0), (10.0, 1.0), (20.0, 0.9), (50.0, 0.6), (90.0, 0.6)])
def test_heat_takes_between_nothing_and_two_fifths(deviation, left):
    hot, isa = JET.climb_thrust_n(3000.0, 200.0, torch.tensor([deviation, 0.0], dtype=DOUBLE))
    assert (hot / isa).item() == pytest.approx(left, rel=1e-12)


def test_a_negative_heat_coefficient_counts_as_zero():
    odd = replace(JET, ct5=-0.01)
    assert odd.climb_thrust_n(3000.0, 200.0, 40.0).item() == odd.climb_thrust_n(3000.0, 200.0).item()


def test_descent_thrust_steps_at_h_des_and_the_level_itself_is_low():
    altitude = torch.tensor([19990.0, 20000.0, 20010.0], dtype=DOUBLE) * FT_M
    share = JET.idle_thrust_n(altitude, 200.0) / JET.climb_thrust_n(altitude, 200.0)
    torch.testing.assert_close(share, torch.tensor([0.05, 0.05, 0.02], dtype=DOUBLE))


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_a_flight_level_on_h_des_does_not_fall_off_it_by_rounding(dtype):
    ac = replace(JET, altitude_des_ft=15000.0)
    level = torch.tensor(150.0, dtype=dtype) * (100 * FT_M)
    share = ac.idle_thrust_n(level, 200.0) / ac.climb_thrust_n(level, 200.0)
    assert share.item() == pytest.approx(0.05, rel=1e-6)


def test_thrust_by_configuration_below_h_des_only():
    low = [
        (JET.idle_thrust_n(1000.0, 100.0, 0.0, c) / JET.climb_thrust_n(1000.0, 100.0)).item()
        for c in ("CR", "AP", "LD")
    ]
    assert low == pytest.approx([0.05, 0.15, 0.3])
    high = [JET.idle_thrust_n(9000.0, 200.0, 0.0, c).item() for c in ("CR", "AP", "LD")]
    assert len(set(high)) == 1


def test_codes_in_a_tensor_mean_the_same_as_names():
    codes = torch.tensor([CLEAN, APPROACH, LANDING])
    by_name = [JET.drag_n(80.0, 500.0, configuration=c).item() for c in ("CR", "AP", "LD")]
    assert JET.drag_n(80.0, 500.0, configuration=codes).tolist() == by_name
    by_name = [JET.idle_thrust_n(500.0, 80.0, 0.0, c).item() for c in ("CR", "AP", "LD")]
    assert JET.idle_thrust_n(500.0, 80.0, 0.0, codes).tolist() == by_name


def test_zero_and_negative_idle_coefficients_are_taken_as_printed():
    none = replace(JET, ct_des_high=0.0)
    assert none.idle_thrust_n(9000.0, 200.0).item() == 0.0
    windmill = replace(JET, ct_des_high=-0.18)
    assert windmill.idle_thrust_n(9000.0, 200.0).item() < 0


def test_h_des_rises_to_the_approach_ceiling_only_with_a_full_polar():
    low = replace(JET, altitude_des_ft=4000.0)
    assert low.descent_thrust_floor_ft().item() == 8000.0
    assert replace(NO_POLARS, altitude_des_ft=4000.0).descent_thrust_floor_ft().item() == 4000.0
    assert replace(low, cd0_gear=0.0).descent_thrust_floor_ft().item() == 4000.0


def test_drag_by_hand():
    density, tas, mass = density_kg_m3(5000.0).item(), 180.0, 62e3
    pressed = 0.5 * density * tas**2 * JET.wing_area_m2
    lift = mass * 9.80665 / pressed
    expected = pressed * (JET.cd0_cr + JET.cd2_cr * lift**2)
    assert JET.drag_n(tas, 5000.0, mass_kg=mass).item() == pytest.approx(expected, rel=1e-12)


def test_bank_presses_the_wing():
    level, banked = JET.drag_n(120.0, 5000.0, load_factor=torch.tensor([1.0, 1.3], dtype=DOUBLE))
    assert banked > level


def test_gear_counts_when_landing_and_missing_polars_fall_back_to_clean():
    assert JET.polar("LD")[0].item() == pytest.approx(0.10)
    assert [float(c) for c in NO_POLARS.polar("AP")] == [JET.cd0_cr, JET.cd2_cr]
    assert [float(c) for c in NO_POLARS.polar("LD")] == [JET.cd0_cr, JET.cd2_cr]


def test_an_unknown_configuration_is_refused():
    with pytest.raises(AircraftError, match=r"'TO'.*CR, AP, LD"):
        JET.drag_n(80.0, 500.0, configuration="TO")


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


def test_a_schedule_speed_on_the_landing_threshold_is_approach():
    threshold = JET.minimum_cas_mps(300.0, configuration="AP").item() + 10 * KT_MPS
    assert JET.descent_configuration(300.0, threshold).item() == APPROACH


def test_stall_speed_grows_with_the_root_of_mass():
    light, heavy = JET.stall_cas_mps(torch.tensor([50e3, 72e3], dtype=DOUBLE))
    assert (heavy / light).item() == pytest.approx(1.2, rel=1e-12)
    assert JET.stall_cas_mps().item() == pytest.approx(JET.vstall_cr_kt * KT_MPS, rel=1e-12)


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
