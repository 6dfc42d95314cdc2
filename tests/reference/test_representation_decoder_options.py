"""The decoder's options: wind and the exact energy share."""

from dataclasses import replace

import pytest
import torch
import toys
from torch import Tensor

from descentflow.core.constants import G0_MPS2
from descentflow.core.units import FL_M, KT_MPS
from descentflow.physics.atmosphere import isa_fraction
from descentflow.representation.decoder.trajectories import integrate

LEVELS = torch.arange(150, 371, dtype=torch.float64)
ALTITUDE_M = LEVELS * FL_M
TOP = torch.full((3,), len(LEVELS) - 1)
DRAG_N = 42_000 + 3_000 * torch.cos(ALTITUDE_M / 1500 + torch.arange(3.0, dtype=torch.float64)[:, None])
CAS_MPS = 140 + 10 * torch.sin(ALTITUDE_M / 2000 + torch.arange(3.0, dtype=torch.float64)[:, None])
WIND_MPS = 5 + 15 * torch.sin(ALTITUDE_M / 4000)


def test_the_exact_energy_share_closes_the_energy_balance() -> None:
    """Thr - D = m g dh/dt / V + m d(V + w)/dt at every level, the derivatives taken along the flown trajectory."""
    deviation = 10.0
    path = (LEVELS, ALTITUDE_M, DRAG_N, CAS_MPS, TOP)
    flown = integrate(toys.AIRCRAFT, *path, None, deviation, wind_mps=WIND_MPS, exact_energy_share=True)
    mass = toys.AIRCRAFT.mass_reference_kg
    inside = slice(3, -3)
    for i in range(3):
        air_speed_along_path = flown.tas_mps[i] + WIND_MPS
        # Seconds count downwards from the top: differences over them are derivatives in time.
        (gain,) = torch.gradient(air_speed_along_path, spacing=(flown.time_s[i],))
        height_rate = flown.rate_mps[i] / isa_fraction(ALTITUDE_M, deviation)
        thrust = toys.AIRCRAFT.idle_thrust_n(ALTITUDE_M, flown.tas_mps[i], deviation)
        needed = mass * (G0_MPS2 * height_rate / flown.tas_mps[i] + gain)
        # Centred differences over 2 x 30 m of profiles that turn over 1,500 m, and jumps of thrust and lapse.
        error = ((thrust - DRAG_N[i] - needed) / DRAG_N[i])[inside]
        assert float(error.abs().median()) < 1e-4
        assert float(error.abs().quantile(0.98)) < 2e-3


def test_bada_and_exact_energy_share_agree_where_cas_is_held_and_differ_where_it_is_not() -> None:
    """Below the transition BADA holds CAS: no difference at constant CAS, a fifth through a slowdown by 50 kt."""
    below = ALTITUDE_M < 7000
    held = torch.full((1, len(LEVELS)), 280 * KT_MPS, dtype=torch.float64)
    slower = held - 50 * KT_MPS * torch.sigmoid((5500 - ALTITUDE_M) / 150)
    ratios = {}
    for name, cas in (("held", held), ("slower", slower)):
        drag = torch.full_like(cas, 45_000.0)
        bada, exact = (
            integrate(toys.AIRCRAFT, LEVELS, ALTITUDE_M, drag, cas, TOP[:1], exact_energy_share=e)
            for e in (False, True)
        )
        ratios[name] = (exact.rate_mps / bada.rate_mps)[0, below]
    torch.testing.assert_close(ratios["held"], torch.ones_like(ratios["held"]), rtol=1e-12, atol=0)
    # dV/dh is positive through the slowdown: the aircraft trades speed for distance and sinks more slowly.
    assert float(ratios["slower"].min()) < 0.8


@pytest.mark.parametrize("exact", [False, True])
def test_tailwind_that_falls_off_downwards_makes_the_descent_slower(exact: bool) -> None:
    """f = 1/(1 + a + (V/g) w'): with CAS held the ratio of rates is known in closed form."""
    cas = torch.full((1, len(LEVELS)), 280 * KT_MPS, dtype=torch.float64)
    drag, slope = torch.full_like(cas, 45_000.0), 2 * KT_MPS / 304.8
    arguments = (toys.AIRCRAFT, LEVELS, ALTITUDE_M, drag, cas, TOP[:1])
    still = integrate(*arguments, exact_energy_share=exact)
    windy = integrate(*arguments, wind_mps=slope * ALTITUDE_M, exact_energy_share=exact)
    # From the rates: 1/f = -V X / (m g R) with X = D - Thr, the same in both.
    thrust = toys.AIRCRAFT.idle_thrust_n(ALTITUDE_M, still.tas_mps, 0.0)
    power = (thrust - drag) * still.tas_mps / (toys.AIRCRAFT.mass_reference_kg * G0_MPS2)
    difference = power / windy.rate_mps - power / still.rate_mps
    torch.testing.assert_close(difference, still.tas_mps * slope / G0_MPS2, rtol=1e-9, atol=0)
    assert bool((windy.rate_mps > still.rate_mps).all())


@pytest.mark.parametrize(("exact", "windy"), [(False, False), (False, True), (True, True)])
def test_gradients_of_time_and_rate(exact: bool, windy: bool) -> None:
    """gradcheck by drag, CAS, wind, mass and deviation, of BADA's and of the exact energy share."""
    coarse = slice(None, None, 20)
    h, entry = ALTITUDE_M[coarse], torch.full((2,), 11)
    drag, cas = (values[:2, coarse].clone().requires_grad_() for values in (DRAG_N, CAS_MPS))
    wind = WIND_MPS[coarse].expand(2, -1).clone().requires_grad_()
    mass, deviation = (torch.tensor(v, dtype=torch.float64, requires_grad=True) for v in (62_000.0, 8.0))

    def outputs(drag: Tensor, cas: Tensor, wind: Tensor, mass: Tensor, deviation: Tensor) -> tuple[Tensor, Tensor]:
        options = {"wind_mps": wind if windy else None, "exact_energy_share": exact}
        flown = integrate(toys.AIRCRAFT, LEVELS[coarse], h, drag, cas, entry, mass, deviation, **options)
        return flown.time_s[:, 0], flown.rate_mps

    # Finite differences of numbers near 1e5 with eps 1e-4 are good to about 1e-6 relative.
    assert torch.autograd.gradcheck(outputs, (drag, cas, wind, mass, deviation), eps=1e-4, atol=1e-6, rtol=1e-5)


OF_THRUST = ("ct1", "ct2", "ct3", "ct5", "ct_des_low", "ct_des_high")
COEFFICIENTS = (*OF_THRUST, "altitude_des_ft", "des_mach", "des_cas_high_kt")
"""All that the decoder takes of a type; the last three move the jumps of the rate."""


@pytest.mark.parametrize("exact", [False, True])
@pytest.mark.parametrize("engine", ["jet", "turboprop", "piston"])
def test_gradients_with_respect_to_every_coefficient(engine: str, exact: bool) -> None:
    """gradcheck of decoded time and rate by factors on the coefficients, which span 20 decades."""
    coarse = slice(None, None, 20)
    thrust = {"turboprop": {"ct1": 4.9e6, "ct3": 2650.0}, "piston": {"ct3": 9e3}, "jet": {}}[engine]
    # The step of idle thrust inside the grid, between two levels.
    aircraft = replace(toys.AIRCRAFT, engine=engine, altitude_des_ft=24_730.0, **thrust)

    def outputs(*factors: Tensor) -> tuple[Tensor, Tensor]:
        changed = {name: getattr(aircraft, name) * factor for name, factor in zip(COEFFICIENTS, factors, strict=True)}
        path = (LEVELS[coarse], ALTITUDE_M[coarse], DRAG_N[:2, coarse], CAS_MPS[:2, coarse], torch.full((2,), 11))
        options = {"wind_mps": WIND_MPS[coarse], "exact_energy_share": exact}
        flown = integrate(replace(aircraft, **changed), *path, 61_000.0, 12.0, **options)
        return flown.time_s[:, 0], flown.rate_mps

    factors = tuple(torch.ones((), dtype=torch.float64, requires_grad=True) for _ in COEFFICIENTS)
    assert torch.autograd.gradcheck(outputs, factors, eps=1e-6, atol=1e-5, rtol=1e-5)
