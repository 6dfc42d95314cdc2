import torch

from descentflow.physics.airspeed import (
    cas_to_mach,
    cas_to_tas_mps,
    crossover_altitude_m,
    mach_to_cas_mps,
    mach_to_tas_mps,
    tas_to_cas_mps,
)


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
