"""The atmosphere against ICAO's table and closed forms, and edges of the conversions of speed."""

import numpy as np
import pytest
import torch

from descentflow.core.constants import P0_PA
from descentflow.core.isa import pressure_ratio, standard_altitude_m, standard_k
from descentflow.physics.airspeed import (
    cas_to_mach,
    cas_to_tas_mps,
    crossover_altitude_m,
    mach_to_cas_mps,
    mach_to_tas_mps,
    tas_to_cas_mps,
)
from descentflow.physics.atmosphere import (
    density_kg_m3,
    geometric_altitude_m,
    isa_fraction,
    pressure_pa,
    speed_of_sound_mps,
    temperature_k,
)

# ICAO Doc 7488/3, table 1: altitude m, temperature K, pressure hPa, density kg/m3, speed of sound m/s, as printed.
ICAO = [
    (0.0, 288.150, 1013.250, 1.22500, 340.294),
    (5000.0, 255.650, 540.200, 0.736116, 320.529),
    (10000.0, 223.150, 264.363, 0.412707, 299.463),
    (11000.0, 216.650, 226.321, 0.363918, 295.069),
    (15000.0, 216.650, 120.446, 0.193673, 295.069),
]


def test_the_atmosphere_in_numpy_is_that_in_torch() -> None:
    altitude = np.linspace(-500.0, 16_000.0, 400)
    pressure = pressure_pa(torch.from_numpy(altitude)).numpy()
    assert P0_PA * pressure_ratio(altitude) == pytest.approx(pressure, rel=1e-12)
    assert standard_altitude_m(pressure) == pytest.approx(altitude, abs=1e-6)
    assert standard_k(altitude) == pytest.approx(temperature_k(torch.from_numpy(altitude), 0.0).numpy(), abs=1e-9)


@pytest.mark.parametrize(("altitude", "temperature", "pressure", "density", "sound"), ICAO)
def test_standard_atmosphere_is_icao_s(altitude, temperature, pressure, density, sound):
    # Tolerances: half a unit of the last printed digit, a whole one for sound (printed with another R).
    assert temperature_k(altitude).item() == pytest.approx(temperature, abs=5e-4)
    assert pressure_pa(altitude).item() / 100 == pytest.approx(pressure, abs=1.5e-3)
    assert density_kg_m3(altitude).item() == pytest.approx(density, rel=5e-6)
    assert speed_of_sound_mps(altitude).item() == pytest.approx(sound, abs=1e-3)


def test_exactly_11000_m_counts_as_below_the_tropopause():
    altitude = torch.tensor([11000.0, 11000.0 + 1e-9], dtype=torch.float64, requires_grad=True)
    (slope,) = torch.autograd.grad(temperature_k(altitude).sum(), altitude)
    assert slope.tolist() == [-0.0065, 0.0]


def test_pressure_slope_is_hydrostatic_on_both_sides_and_at_the_tropopause():
    altitude = torch.tensor([3000.0, 11000.0, 11000.1, 14000.0], dtype=torch.float64, requires_grad=True)
    pressure = pressure_pa(altitude)
    (slope,) = torch.autograd.grad(pressure.sum(), altitude)
    # dp/dHp = -rho g0 in ISA; a doubled gradient at 11,000 m would show here.
    torch.testing.assert_close(slope, -9.80665 * density_kg_m3(altitude.detach()), rtol=1e-12, atol=0)


@pytest.mark.parametrize("deviation", [-15.0, 0.0, 20.0])
def test_geometric_altitude_integrates_the_warm_column(deviation):
    altitude = torch.linspace(0.0, 15000.0, 30001, dtype=torch.float64)
    stretch = 1 / isa_fraction(altitude, deviation)
    summed = torch.trapezoid(stretch, altitude)
    # 0.5 m trapezoids of a smooth integrand are good to 1e-6 m.
    assert geometric_altitude_m(15000.0, deviation).item() == pytest.approx(summed.item(), abs=1e-5)


def test_arguments_broadcast_and_keep_their_precision():
    altitude = torch.zeros(4, 1, dtype=torch.float32)
    deviation = torch.zeros(3, dtype=torch.float32)
    assert density_kg_m3(altitude, deviation).shape == (4, 3)
    assert density_kg_m3(altitude, deviation).dtype == torch.float32
    assert density_kg_m3(altitude, torch.tensor(10.0, dtype=torch.float64)).dtype == torch.float32
    assert pressure_pa(5000.0).dtype == torch.float64
    assert pressure_pa(torch.tensor([5000])).item() == pressure_pa(5000.0).item()


def test_float32_loses_only_its_own_digits():
    altitude = torch.linspace(0.0, 14000.0, 300, dtype=torch.float64)
    error = (pressure_pa(altitude.float()).double() / pressure_pa(altitude) - 1).abs().max().item()
    assert error < 20 * torch.finfo(torch.float32).eps


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
