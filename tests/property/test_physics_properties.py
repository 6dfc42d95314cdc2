from dataclasses import replace

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from descentflow.aircraft_types.bada3._fixed_columns import e10
from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
from descentflow.core.units import FL_M
from descentflow.physics.airspeed import (
    cas_to_mach,
    cas_to_tas_mps,
    crossover_altitude_m,
    mach_to_cas_mps,
    mach_to_tas_mps,
    tas_to_cas_mps,
    tas_to_mach,
)
from descentflow.physics.atmosphere import pressure_altitude_m, pressure_pa
from descentflow.physics.energy import descent_rate_mps, energy_share_factor, energy_share_factor_local, inferred_drag_n
from descentflow.physics.nominal_descent import nominal_descent
from descentflow.representation.decoder.trajectories import integrate
from descentflow.representation.profiles import drag_at_idle_n

QUICK = settings(max_examples=60, deadline=None)
altitudes = st.floats(-300.0, 15000.0)
deviations = st.floats(-30.0, 40.0)
speeds = st.floats(40.0, 190.0)
masses = st.floats(40e3, 90e3)
JET = open_aircraft("A320")
GRID = torch.arange(150, 371, 20)


@QUICK
@given(speeds, altitudes, deviations)
def test_speed_conversions_round_trip(cas, altitude, deviation):
    tas = cas_to_tas_mps(cas, altitude, deviation)
    assert tas_to_cas_mps(tas, altitude, deviation).item() == pytest.approx(cas, rel=1e-12)
    mach = tas_to_mach(tas, altitude, deviation)
    assert mach_to_tas_mps(mach, altitude, deviation).item() == pytest.approx(tas.item(), rel=1e-14)
    assert mach_to_cas_mps(mach, altitude).item() == pytest.approx(cas, rel=1e-12)
    assert cas_to_mach(cas, altitude).item() == pytest.approx(mach.item(), rel=1e-12)


@QUICK
@given(st.floats(-300.0, 25000.0))
def test_pressure_and_altitude_round_trip(altitude):
    # 1e-16 of 100 kPa at some 4 Pa per metre.
    assert pressure_altitude_m(pressure_pa(altitude)).item() == pytest.approx(altitude, abs=1e-8)


@QUICK
@given(speeds, st.floats(0.3, 0.9))
def test_above_the_crossover_mach_is_the_slower_speed(cas, mach):
    altitude = crossover_altitude_m(cas, mach)
    for step, slower in ((100.0, True), (-100.0, False)):
        held = mach_to_cas_mps(mach, altitude + step)
        assert (held.item() < cas) is slower


@QUICK
@given(speeds, altitudes, deviations, st.booleans())
def test_energy_share_lies_between_its_bounds(cas, altitude, deviation, above):
    mach = cas_to_mach(cas, altitude)
    factor = energy_share_factor(mach, altitude, torch.tensor(above), deviation).item()
    assert (1.0 <= factor < 1.3) if above else (0.5 < factor <= 1.0)


@QUICK
@given(speeds, altitudes, deviations, st.floats(-0.01, 0.01))
def test_a_headwind_gradient_and_its_mirror_are_symmetric_in_the_inverse(cas, altitude, deviation, shear):
    inverse = [1 / energy_share_factor_local(cas, altitude, 0.0, sign * shear, deviation).item() for sign in (-1, 0, 1)]
    assert inverse[0] + inverse[2] == pytest.approx(2 * inverse[1], rel=1e-12)


@QUICK
@given(speeds, altitudes, deviations, masses, st.floats(1.0, 100e3), st.floats(1.0, 20e3))
def test_rate_falls_with_drag_and_drag_comes_back(cas, altitude, deviation, mass, drag, more):
    tas = cas_to_tas_mps(cas, altitude, deviation)
    rest = (3e3, tas, 0.85, altitude, deviation, mass)
    rate = descent_rate_mps(JET, drag, *rest)
    assert descent_rate_mps(JET, drag + more, *rest) < rate
    # Absolute: the thrust is subtracted, so small drags keep the rounding of thrust.
    assert inferred_drag_n(JET, rate, *rest).item() == pytest.approx(drag, rel=1e-12, abs=1e-9)


def _gauged(aircraft, scale):
    return replace(
        aircraft,
        mass_reference_kg=scale * aircraft.mass_reference_kg,
        ct1=scale * aircraft.ct1,
        **{name: scale * getattr(aircraft, name) for name in ("cd0_cr", "cd0_ap", "cd0_ld", "cd0_gear")},
        **{name: getattr(aircraft, name) / scale for name in ("cd2_cr", "cd2_ap", "cd2_ld")},
    )


@settings(max_examples=15, deadline=None)
@given(st.floats(0.5, 2.0), st.floats(0.75, 1.25), st.floats(-20.0, 30.0))
def test_gauge_leaves_the_whole_nominal_descent_unchanged(scale, mass_share, deviation):
    mass = mass_share * JET.mass_reference_kg
    nominal = nominal_descent(JET, GRID, mass, deviation)
    other = nominal_descent(_gauged(JET, scale), GRID, scale * mass, deviation)
    torch.testing.assert_close(other.time_s, nominal.time_s, rtol=1e-11, atol=1e-9)


@settings(max_examples=15, deadline=None)
@given(st.floats(0.2, 5.0), st.floats(0.75, 1.25), st.floats(-20.0, 30.0), st.booleans(), st.booleans())
def test_gauge_leaves_decoded_trajectories_and_the_inference_unchanged(scale, mass_share, deviation, windy, exact):
    """With mass, thrust and drag scaled together time and rate stay, and the drag inferred is scaled as well."""
    levels = torch.arange(150, 371, dtype=torch.float64)
    altitude = levels * FL_M
    drag = (40e3 + 3e3 * torch.cos(altitude / 1500))[None]
    cas = (140 + 8 * torch.sin(altitude / 2000))[None]
    wind = 0.002 * altitude if windy else None
    mass, entry = mass_share * JET.mass_reference_kg, torch.tensor([220])
    first, other = (
        integrate(a, levels, altitude, d, cas, entry, m, deviation, wind_mps=wind, exact_energy_share=exact)
        for a, d, m in ((JET, drag, mass), (_gauged(JET, scale), scale * drag, scale * mass))
    )
    torch.testing.assert_close(other.time_s, first.time_s, rtol=1e-11, atol=1e-9)
    torch.testing.assert_close(other.rate_mps, first.rate_mps, rtol=1e-11, atol=0)
    inferred, scaled = (
        drag_at_idle_n(a, cas, first.rate_mps, altitude, m, deviation)
        for a, m in ((JET, mass), (_gauged(JET, scale), scale * mass))
    )
    torch.testing.assert_close(scaled, scale * inferred, rtol=1e-11, atol=0)


@QUICK
@given(st.floats(-1e9, 1e9).filter(lambda x: x == 0 or abs(x) > 1e-12))
def test_numbers_survive_bada_s_columns(value):
    text = e10(value)
    assert len(text) == 10
    assert float(text) == pytest.approx(value, rel=5e-4 if value < 0 else 5e-5)
    assert e10(float(text)) == text
