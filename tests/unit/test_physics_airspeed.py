import pytest
import torch

from descentflow.core.units import KT_MPS
from descentflow.physics.airspeed import (
    cas_to_mach,
    cas_to_tas_mps,
    crossover_altitude_m,
    mach_to_cas_mps,
    mach_to_tas_mps,
    tas_to_cas_mps,
    tas_to_mach,
)
from descentflow.physics.atmosphere import pressure_altitude_m, speed_of_sound_mps


def test_at_sea_level_calibrated_and_true_airspeed_are_one():
    # The printed rho0 and p0/(R T0) differ by 1.5e-8, so the speeds differ by half of that.
    assert cas_to_tas_mps(150.0, 0.0).item() == pytest.approx(150.0, rel=1e-8)


def test_low_speed_limit_is_the_square_root_of_density():
    density_ratio = 0.736116 / 1.225
    assert cas_to_tas_mps(1.0, 5000.0).item() == pytest.approx(density_ratio**-0.5, rel=1e-5)


def test_temperature_moves_true_airspeed_and_not_mach():
    warm = cas_to_tas_mps(150.0, 8000.0, 20.0)
    assert warm > cas_to_tas_mps(150.0, 8000.0)
    torch.testing.assert_close(tas_to_mach(warm, 8000.0, 20.0), cas_to_mach(150.0, 8000.0), rtol=1e-14, atol=0)


def test_crossover_is_where_both_speeds_agree():
    cas = torch.tensor([250.0, 280.0, 310.0, 340.0], dtype=torch.float64) * KT_MPS
    mach = torch.tensor([0.78, 0.78, 0.84, 0.8], dtype=torch.float64)
    altitude = crossover_altitude_m(cas, mach)
    # Within the 2.8e-8 between the printed a0 and sqrt(kappa p0 / rho0).
    torch.testing.assert_close(cas_to_mach(cas, altitude), mach, rtol=1e-7, atol=0)
    assert altitude[0] > 11000.0  # the branch above the tropopause is tried too


def test_crossover_below_sea_level_is_negative():
    assert crossover_altitude_m(150.0, 0.3).item() < 0


def test_standing_still_has_finite_gradients():
    speed = torch.zeros(3, dtype=torch.float64, requires_grad=True)
    for convert in (cas_to_tas_mps, tas_to_cas_mps, mach_to_tas_mps):
        value = convert(speed, 5000.0, 10.0)
        (slope,) = torch.autograd.grad(value.sum(), speed)
        assert torch.isfinite(slope).all()
        assert (value == 0).all()
    (slope,) = torch.autograd.grad(mach_to_cas_mps(speed, 5000.0).sum(), speed)
    assert torch.isfinite(slope).all()


def test_float32_keeps_six_digits_at_low_speed():
    cas = torch.linspace(30.0, 180.0, 200, dtype=torch.float64)
    error = (cas_to_mach(cas.float(), 9000.0).double() / cas_to_mach(cas, 9000.0) - 1).abs().max().item()
    assert error < 1e-6


def test_mach_one_is_the_speed_of_sound():
    assert mach_to_tas_mps(1.0, 7000.0, -10.0).item() == speed_of_sound_mps(7000.0, -10.0).item()


def test_impact_pressure_at_sea_level_by_hand():
    # M 0.5 at sea level: (1 + 0.05)^3.5 - 1 = 0.18621; the altitude where that impact belongs to M 0.78 is where
    # p / p0 = 0.18621 / ((1 + 0.12168)^3.5 - 1).
    ratio = (1.05**3.5 - 1) / (1.12168**3.5 - 1)
    assert crossover_altitude_m(0.5 * 340.294, 0.78).item() == pytest.approx(
        pressure_altitude_m(101325.0 * ratio).item(), abs=1e-6
    )
