import pytest
import torch

from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
from descentflow.physics.airspeed import cas_to_mach, cas_to_tas_mps, mach_to_tas_mps
from descentflow.physics.atmosphere import geometric_altitude_m, isa_fraction
from descentflow.physics.energy import (
    descent_rate_mps,
    energy_share_factor,
    energy_share_factor_exact,
)

G0 = 9.80665
DOUBLE = torch.float64
ABOVE, BELOW = torch.tensor(True), torch.tensor(False)


def true_share(speed_of_altitude, altitude, deviation):
    """1 / (1 + V/g dV/dh) with a central difference over geometric altitude: no formula of the package's for it."""
    step = 0.5
    low, high = altitude - step, altitude + step
    rise = geometric_altitude_m(high, deviation) - geometric_altitude_m(low, deviation)
    slope = (speed_of_altitude(high) - speed_of_altitude(low)) / rise
    return 1 / (1 + speed_of_altitude(altitude) / G0 * slope)


@pytest.mark.parametrize("deviation", [-15.0, 0.0, 20.0])
@pytest.mark.parametrize("altitude", [2000.0, 8000.0, 10999.0, 12500.0])
def test_constant_mach_and_constant_cas_are_what_their_names_say(altitude, deviation):
    at = torch.tensor(altitude, dtype=DOUBLE)
    mach, cas = 0.78, 140.0
    # Central differences over one metre: truncation 1e-9, rounding 1e-10. The manual's constant-CAS term is exact too.
    held_mach = true_share(lambda h: mach_to_tas_mps(mach, h, deviation), at, deviation)
    torch.testing.assert_close(energy_share_factor(mach, at, ABOVE, deviation), held_mach, rtol=1e-7, atol=0)
    held_cas = true_share(lambda h: cas_to_tas_mps(cas, h, deviation), at, deviation)
    factor = energy_share_factor(cas_to_mach(cas, at), at, BELOW, deviation)
    torch.testing.assert_close(factor, held_cas, rtol=1e-7, atol=0)


def test_exactly_11000_m_uses_the_factor_below_the_tropopause():
    at, over = energy_share_factor(0.8, torch.tensor([11000.0, 11000.001], dtype=DOUBLE), ABOVE)
    assert at.item() == pytest.approx(1 / (1 - 0.085237), abs=1e-5)  # kappa R 0.0065 0.8^2 / (2 g0)
    assert over.item() == 1.0


def test_zero_mach_shares_nothing_and_has_no_nan_gradient():
    mach = torch.zeros(2, dtype=DOUBLE, requires_grad=True)
    factor = energy_share_factor(mach, 5000.0, torch.tensor([True, False]))
    assert (factor == 1).all()
    (slope,) = torch.autograd.grad(factor.sum(), mach)
    assert torch.isfinite(slope).all()


@pytest.mark.parametrize("deviation", [-10.0, 0.0, 15.0])
def test_exact_factor_balances_the_energy_of_a_flight_with_wind(deviation):
    """Fly the rate it gives and check m g dh/dt + m V (dV/dt + dw/dt) = (Thr - D) V, all from geometric height."""
    mass, force = 62000.0, -38000.0

    def cas(h):
        return 140.0 + 0.002 * (h - 5000.0) - 1e-7 * (h - 5000.0) ** 2

    def wind(h):
        return 5.0 + 0.0025 * h

    altitude = torch.linspace(4000.0, 10500.0, 214, dtype=DOUBLE)
    factor = energy_share_factor_exact(cas(altitude), altitude, deviation, wind(altitude))
    tas = cas_to_tas_mps(cas(altitude), altitude, deviation)
    rate = descent_rate_mps(open_aircraft("A320"), -force, 0.0, tas, factor, altitude, deviation, mass)
    step = 0.5
    true_slope = (
        cas_to_tas_mps(cas(altitude + step), altitude + step, deviation)
        - cas_to_tas_mps(cas(altitude - step), altitude - step, deviation)
    ) / (2 * step)
    climb = rate / isa_fraction(altitude, deviation)
    power = mass * (G0 * climb + tas * rate * (true_slope + 0.0025))
    # Second-order differences of this quadratic CAS and linear wind are exact; 1e-8 is the check's own difference.
    torch.testing.assert_close(power, force * tas, rtol=1e-7, atol=0)
