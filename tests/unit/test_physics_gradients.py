"""gradcheck of rate and time with respect to drag, CAS, mass, deviation, wind and coefficients (float64)."""

from dataclasses import replace

import pytest
import torch

from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
from descentflow.physics.airspeed import cas_to_mach, cas_to_tas_mps, tas_to_cas_mps
from descentflow.physics.energy import descent_rate_mps, energy_share_factor, energy_share_factor_exact, inferred_drag_n
from descentflow.physics.nominal_descent import nominal_descent

ALTITUDE = torch.tensor([3000.0, 6500.0, 9800.0, 11000.0, 12300.0], dtype=torch.float64)
ABOVE = ALTITUDE > 9000.0
JET = open_aircraft("A320")
TYPES = [JET, replace(JET, engine="turboprop", ct1=4.9e6, ct3=2650.0, des_mach=0.0), replace(JET, engine="piston")]
COEFFICIENTS = ("ct1", "ct2", "ct3", "ct5", "ct_des_low", "ct_des_high", "cd0_cr", "cd2_cr", "wing_area_m2")


def leaf(value):
    return torch.as_tensor(value, dtype=torch.float64).clone().requires_grad_()


def rate(aircraft, cas, mass, deviation, scale=1.0):
    tas = cas_to_tas_mps(cas, ALTITUDE, deviation)
    esf = energy_share_factor(cas_to_mach(cas, ALTITUDE), ALTITUDE, ABOVE, deviation)
    drag = scale * aircraft.drag_n(tas, ALTITUDE, deviation, mass)
    thrust = aircraft.idle_thrust_n(ALTITUDE, tas, deviation)
    return descent_rate_mps(aircraft, drag, thrust, tas, esf, ALTITUDE, deviation, mass)


@pytest.mark.parametrize("aircraft", TYPES, ids=lambda a: a.engine)
def test_rate_by_cas_mass_and_deviation(aircraft):
    inputs = (leaf([130.0, 140.0, 135.0, 120.0, 115.0]), leaf(61e3), leaf(7.0))
    assert torch.autograd.gradcheck(lambda *x: rate(aircraft, *x), inputs)


@pytest.mark.parametrize("aircraft", TYPES, ids=lambda a: a.engine)
def test_rate_by_every_coefficient_it_uses(aircraft):
    # Coefficients span 20 decades, so each is scaled by a factor that is differentiated.
    def by_factors(*factors):
        changed = {n: getattr(aircraft, n) * f for n, f in zip(COEFFICIENTS, factors, strict=True)}
        return rate(replace(aircraft, **changed), torch.tensor(135.0, dtype=torch.float64), 61e3, 12.0)

    assert torch.autograd.gradcheck(by_factors, tuple(leaf(1.0) for _ in COEFFICIENTS))


def test_rate_by_drag_and_back():
    drag, tas, esf = leaf([40e3, 0.0]), leaf([200.0, 210.0]), leaf([0.85, 1.08])

    def there(d, v, f):
        return descent_rate_mps(JET, d, 5e3, v, f, 6000.0, 10.0, 60e3)

    def back(r, v, f):
        return inferred_drag_n(JET, r, 5e3, v, f, 6000.0, 10.0, 60e3) * 1e-4

    assert torch.autograd.gradcheck(lambda d, v, f: there(d * 1e4, v, f), (leaf([4.0, 0.0]), tas, esf))
    assert torch.autograd.gradcheck(back, (leaf([-10.0, 0.0]), tas, esf))
    # The one is the other's inverse, so the product of their slopes is one.
    (slope,) = torch.autograd.grad(back(there(drag, tas, esf), tas, esf).sum() * 1e4, drag)
    torch.testing.assert_close(slope, torch.ones_like(slope), rtol=1e-12, atol=0)


def test_exact_energy_share_by_cas_wind_and_deviation():
    levels = torch.linspace(9000.0, 12000.0, 6, dtype=torch.float64)
    inputs = (leaf([130.0, 131.0, 129.0, 126.0, 124.0, 120.0]), leaf([3.0, 4.0, 8.0, 9.0, 11.0, 20.0]), leaf(5.0))
    assert torch.autograd.gradcheck(lambda cas, wind, dev: energy_share_factor_exact(cas, levels, dev, wind), inputs)


def test_speed_conversions_and_fuel():
    speeds = leaf([90.0, 150.0, 200.0])
    assert torch.autograd.gradcheck(lambda v, d: tas_to_cas_mps(v, 7000.0, d), (speeds, leaf(-8.0)))
    flow = lambda v, t: JET.fuel_flow_kg_s(1500.0, v, t * 1e4)  # noqa: E731
    assert torch.autograd.gradcheck(flow, (speeds, leaf([3.0, 4.0, 5.0])))


def test_time_by_mass_deviation_and_coefficients():
    """The quadrature's cells end at jumps that move with des_mach and H_p,des: their part of the slope counts."""
    levels = torch.arange(150, 372, 74)
    aircraft = replace(JET, altitude_des_ft=27310.0, ct_des_low=0.05, ct_des_high=0.01)

    def time(mass, deviation, drag, mach, hand_over, cas):
        changed = replace(
            aircraft,
            cd0_cr=aircraft.cd0_cr * drag,
            des_mach=mach,
            altitude_des_ft=27310.0 * hand_over,
            des_cas_high_kt=cas,
        )
        return nominal_descent(changed, levels, mass * 60e3, deviation).time_s

    inputs = (leaf(1.0), leaf(5.0), leaf(1.0), leaf(0.77), leaf(1.0), leaf(295.0))
    # Nodes may cross a fixed jump by a step of 1e-6: none lies within that of one here.
    assert torch.autograd.gradcheck(time, inputs, eps=1e-6, atol=1e-3, rtol=1e-4)


def test_no_nan_gradient_anywhere_on_the_nominal_descent():
    mass, deviation, mach = leaf([45e3, 70e3]), leaf([0.0, 30.0]), leaf(0.0)
    time = nominal_descent(replace(JET, des_mach=mach), torch.arange(0, 400, 10), mass, deviation).time_s
    for slope in torch.autograd.grad(time.sum(), (mass, deviation, mach), allow_unused=True):
        assert slope is None or torch.isfinite(slope).all()
