import pytest
import torch

from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
from descentflow.physics.airspeed import cas_to_mach, cas_to_tas_mps, mach_to_cas_mps, mach_to_tas_mps
from descentflow.physics.atmosphere import geometric_altitude_m, isa_fraction
from descentflow.physics.energy import (
    descent_rate_mps,
    energy_share_factor,
    energy_share_factor_exact,
    energy_share_factor_local,
    inferred_drag_n,
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


def test_known_sizes():
    assert energy_share_factor(0.8, 12000.0, ABOVE).item() == 1.0
    assert energy_share_factor(0.8, 9000.0, ABOVE).item() > 1.0
    assert energy_share_factor(0.5, 5000.0, BELOW).item() < 1.0


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


def test_exact_factor_is_bada_s_where_bada_s_assumption_holds():
    altitude = torch.linspace(3000.0, 10900.0, 260, dtype=DOUBLE)
    flat = torch.full_like(altitude, 145.0)
    bada = energy_share_factor(cas_to_mach(flat, altitude), altitude, BELOW, 10.0)
    torch.testing.assert_close(energy_share_factor_exact(flat, altitude, 10.0), bada, rtol=1e-12, atol=0)
    held = mach_to_cas_mps(0.78, altitude)
    by_mach = energy_share_factor(0.78, altitude, ABOVE, 10.0)
    # The CAS of constant Mach is curved: 30 m differences are good to 1e-5 of the factor.
    torch.testing.assert_close(energy_share_factor_exact(held, altitude, 10.0), by_mach, rtol=2e-5, atol=0)


def test_exact_factor_converges_with_the_square_of_the_spacing():
    def error(levels):
        altitude = torch.linspace(3000.0, 10900.0, levels, dtype=DOUBLE)
        exact = energy_share_factor(0.78, altitude, ABOVE)
        factor = energy_share_factor_exact(mach_to_cas_mps(0.78, altitude), altitude)
        return (factor - exact)[1:-1].abs().max().item()

    assert error(101) / error(201) == pytest.approx(4.0, rel=0.1)


def test_a_tailwind_that_grows_with_height_slows_the_descent():
    # A simulator measured 4.7 % for 1.5 kt per 1,000 ft of shear at its own speed and height.
    shear = 1.5 * 0.514444 / 304.8
    still = energy_share_factor_local(140.0, 6000.0, 0.0)
    windy = energy_share_factor_local(140.0, 6000.0, 0.0, shear)
    assert 1 - (windy / still).item() == pytest.approx(0.042, abs=0.005)


def test_exact_factor_batches_over_flights_and_winds():
    altitude = torch.arange(150, 300, dtype=DOUBLE) * 30.48
    cas = 140.0 + torch.rand(5, 150, dtype=DOUBLE)
    wind = torch.linspace(0, 30, 150, dtype=DOUBLE)
    together = energy_share_factor_exact(cas, altitude, 0.0, wind)
    alone = torch.stack([energy_share_factor_exact(c, altitude, 0.0, wind) for c in cas])
    # Vector and scalar lanes of one processor round the last bit differently.
    torch.testing.assert_close(together, alone, rtol=4e-16, atol=0)


def test_rate_and_drag_are_inverse_and_warm_air_slows_the_pressure_rate():
    ac = open_aircraft("A320")
    rate = descent_rate_mps(ac, 40e3, 4e3, 200.0, 0.85, 6000.0, 12.0, 60e3)
    drag = inferred_drag_n(ac, rate, 4e3, 200.0, 0.85, 6000.0, 12.0, 60e3)
    assert drag.item() == pytest.approx(40e3, rel=1e-13)
    cold = descent_rate_mps(ac, 40e3, 4e3, 200.0, 0.85, 6000.0, 0.0, 60e3)
    assert (rate / cold).item() == pytest.approx(isa_fraction(6000.0, 12.0).item(), rel=1e-13)


def test_reference_mass_stands_in_for_an_absent_one():
    ac = open_aircraft("A320")
    given = descent_rate_mps(ac, 40e3, 4e3, 200.0, 0.85, 6000.0, mass_kg=ac.mass_reference_kg)
    assert descent_rate_mps(ac, 40e3, 4e3, 200.0, 0.85, 6000.0).item() == given.item()
