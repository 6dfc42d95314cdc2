"""The nominal descent against an ODE solver, and gradients of rate and time by finite differences (float64)."""

from dataclasses import replace

import pytest
import torch
from scipy.integrate import solve_ivp

from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
from descentflow.core.errors import AircraftError
from descentflow.core.units import FL_M
from descentflow.physics.airspeed import cas_to_mach, cas_to_tas_mps, tas_to_cas_mps
from descentflow.physics.energy import descent_rate_mps, energy_share_factor, energy_share_factor_exact, inferred_drag_n
from descentflow.physics.nominal_descent import nominal_descent, nominal_state

DOUBLE = torch.float64
# A thrust step inside the grid, so that every kind of jump is crossed.
JET = replace(open_aircraft("A320"), altitude_des_ft=25030.0, ct_des_low=0.05, ct_des_high=0.01)
GRID = torch.arange(100, 381)


def flown_time_s(aircraft, top_m, bottom_m, mass_kg, deviation_k):
    """Fly dHp/dt in time with a tight adaptive solver, restarted at each jump: nothing shared with the quadrature."""

    def rate(_, altitude):
        return nominal_state(aircraft, torch.tensor(altitude), mass_kg, deviation_k).rate_mps.numpy()

    jumps = [11000.0, float(aircraft.transition_altitude_m()), 25030 * 0.3048, 4572.0]
    stops = sorted({bottom_m, *(j for j in jumps if bottom_m < j < top_m)}, reverse=True)
    total, altitude = 0.0, top_m
    for stop in stops:
        # The state just above a jump counts until it is reached; each leg starts a hair below the last stop.
        def hit(_, h, stop=stop):
            return h[0] - stop - 1e-4

        hit.terminal = True
        start = altitude - (1e-2 if altitude != top_m else 0.0)
        leg = solve_ivp(rate, (0.0, 5000.0), [start], events=hit, rtol=1e-7, atol=1e-3, method="RK45")
        total += leg.t_events[0][0]
        altitude = stop
    return total


@pytest.mark.parametrize(("mass", "deviation"), [(50e3, -10.0), (66e3, 15.0)])
def test_time_agrees_with_a_tight_ode_solver_in_time(mass, deviation):
    nominal = nominal_descent(JET, GRID, torch.tensor(mass, dtype=DOUBLE), torch.tensor(deviation, dtype=DOUBLE))
    flown = flown_time_s(JET, 380 * FL_M, 100 * FL_M, mass, deviation)
    # Hairs of 1 cm at some 10 m/s and the solver's 1e-7 a step: 20 ms, 0.002 % of the time (0.05 % is asked).
    assert nominal.time_s[0].item() == pytest.approx(flown, abs=0.02)


def test_time_does_not_depend_on_the_grid():
    fine = nominal_descent(JET, GRID).time_s
    coarse = nominal_descent(JET, torch.tensor([100, 173, 380])).time_s
    # Cells of 1,000 ft against 100 ft, two Gauss points each.
    torch.testing.assert_close(coarse, fine[[0, 73, 280]], rtol=1e-8, atol=0)


def test_coefficients_batch_and_move_the_jumps():
    mach = torch.tensor([[0.0], [0.74], [0.8]], dtype=DOUBLE)
    descent = nominal_descent(replace(JET, des_mach=mach), GRID)
    alone = nominal_descent(replace(JET, des_mach=0.74), GRID)
    torch.testing.assert_close(descent.time_s[1], alone.time_s, rtol=1e-12, atol=1e-9)


def test_float32_grid_gives_float32_close_to_float64():
    single = nominal_descent(JET, GRID.float())
    assert single.time_s.dtype == torch.float32
    error = (single.time_s[:-1].double() / nominal_descent(JET, GRID).time_s[:-1] - 1).abs().max().item()
    assert error < 2e-5


@pytest.mark.parametrize("levels", [[200, 150], [150, 150, 160]])
def test_levels_that_do_not_ascend_are_refused(levels):
    with pytest.raises(AircraftError, match="ascending"):
        nominal_descent(JET, torch.tensor(levels))


def test_two_dimensional_levels_are_refused():
    with pytest.raises(AircraftError, match="one dimension"):
        nominal_descent(JET, torch.arange(150, 152)[None])


def test_an_aircraft_that_cannot_descend_is_refused():
    with pytest.raises(AircraftError, match="does not descend"):
        nominal_descent(replace(JET, ct_des_low=0.9), GRID)


def test_every_step_stays_on_the_device_of_the_altitudes():
    """The meta device refuses to mix as a GPU does, and needs none."""
    altitude = torch.linspace(0.0, 12000.0, 9, dtype=torch.float32, device="meta")
    state = nominal_state(JET, altitude, torch.full((3, 1), 6e4, dtype=torch.float32, device="meta"), 10.0)
    for name, value in vars(state).items():
        assert value.shape == (3, 9)
        assert value.device.type == "meta"
        assert value.dtype == (torch.int64 if name == "configuration" else torch.float32)


def test_an_expedited_descent_has_the_drag_factor_and_nothing_else_changed() -> None:
    """C_des,exp is 1.6: rate per excess drag, speeds and thrust stay."""
    levels = torch.arange(150, 371, 10)
    usual, expedited = (nominal_descent(open_aircraft("A320"), levels, expedited=e) for e in (False, True))
    torch.testing.assert_close(expedited.drag_n, 1.6 * usual.drag_n, rtol=1e-12, atol=0)
    torch.testing.assert_close(expedited.thrust_n, usual.thrust_n, rtol=0, atol=0)
    torch.testing.assert_close(
        expedited.rate_mps / (expedited.thrust_n - expedited.drag_n),
        usual.rate_mps / (usual.thrust_n - usual.drag_n),
        rtol=1e-12,
        atol=0,
    )
    assert bool((expedited.time_s[1:] < usual.time_s[1:]).any())


ALTITUDE = torch.tensor([3000.0, 6500.0, 9800.0, 11000.0, 12300.0], dtype=torch.float64)
ABOVE = ALTITUDE > 9000.0
A320 = open_aircraft("A320")
TYPES = [A320, replace(A320, engine="turboprop", ct1=4.9e6, ct3=2650.0, des_mach=0.0), replace(A320, engine="piston")]
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
        return descent_rate_mps(A320, d, 5e3, v, f, 6000.0, 10.0, 60e3)

    def back(r, v, f):
        return inferred_drag_n(A320, r, 5e3, v, f, 6000.0, 10.0, 60e3) * 1e-4

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
    flow = lambda v, t: A320.fuel_flow_kg_s(1500.0, v, t * 1e4)  # noqa: E731
    assert torch.autograd.gradcheck(flow, (speeds, leaf([3.0, 4.0, 5.0])))


def test_time_by_mass_deviation_and_coefficients():
    """The quadrature's cells end at jumps that move with des_mach and H_p,des: their part of the slope counts."""
    levels = torch.arange(150, 372, 74)
    aircraft = replace(A320, altitude_des_ft=27310.0, ct_des_low=0.05, ct_des_high=0.01)

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
    time = nominal_descent(replace(A320, des_mach=mach), torch.arange(0, 400, 10), mass, deviation).time_s
    for slope in torch.autograd.grad(time.sum(), (mass, deviation, mach), allow_unused=True):
        assert slope is None or torch.isfinite(slope).all()
