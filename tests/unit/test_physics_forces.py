from dataclasses import replace

import pytest
import torch

from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
from descentflow.core.errors import AircraftError
from descentflow.core.units import FT_M
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
    codes = torch.tensor([CLEAN, APPROACH, LANDING])
    by_name = [JET.drag_n(80.0, 500.0, configuration=c).item() for c in ("CR", "AP", "LD")]
    assert JET.drag_n(80.0, 500.0, configuration=codes).tolist() == by_name
    by_name = [JET.idle_thrust_n(500.0, 80.0, 0.0, c).item() for c in ("CR", "AP", "LD")]
    assert JET.idle_thrust_n(500.0, 80.0, 0.0, codes).tolist() == by_name


def test_h_des_rises_to_the_approach_ceiling_only_with_a_full_polar():
    low = replace(JET, altitude_des_ft=4000.0)
    assert low.descent_thrust_floor_ft().item() == 8000.0
    assert replace(NO_POLARS, altitude_des_ft=4000.0).descent_thrust_floor_ft().item() == 4000.0
    assert replace(low, cd0_gear=0.0).descent_thrust_floor_ft().item() == 4000.0


def test_bank_presses_the_wing():
    level, banked = JET.drag_n(120.0, 5000.0, load_factor=torch.tensor([1.0, 1.3], dtype=DOUBLE))
    assert banked > level


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
