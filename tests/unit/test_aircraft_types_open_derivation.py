"""Derived coefficients of the open aircraft, computed again from the facts that their files print."""

import math

import numpy as np
import pytest

from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft, open_type, open_typecodes
from descentflow.core.units import FT_M, KT_MPS

G, RHO0 = 9.80665, 1.225
# The files print coefficients with four significant digits.
ROUNDED = 1e-3


def entries(typecode: str, table: str) -> dict[str, float]:
    return {e.name: e.value for e in getattr(open_type(typecode), table)}


def source(typecode: str, name: str) -> str:
    return next(e.source for e in open_type(typecode).coefficients if e.name == name)


def derived(typecode: str, name: str) -> float:
    """The coefficient as its sources give it, before flights."""
    own = next(e for e in open_type(typecode).coefficients if e.name == name)
    return (
        entries(typecode, "facts")[f"{name}_before"]
        if own.confidence == "fitted"
        else getattr(open_aircraft(typecode), name)
    )


POLL_SCHUMANN = [t for t in open_typecodes() if "drag_psi_0" in entries(t, "facts")]
JETS = [t for t in open_typecodes() if open_aircraft(t).engine == "jet"]
PROPELLERS = [t for t in open_typecodes() if open_aircraft(t).engine == "turboprop"]


def pressure_ratio(altitude_ft: float) -> float:
    if altitude_ft <= 36_089:
        return (1 - 6.8756e-6 * altitude_ft) ** 5.25588
    return 0.22336 * math.exp(-(altitude_ft - 36_089) / 20_806)


def mach_of(cas_kt: float, altitude_ft: float) -> float:
    impact = (1 + 0.2 * (cas_kt * KT_MPS / 340.294) ** 2) ** 3.5 - 1
    return math.sqrt(5 * ((impact / pressure_ratio(altitude_ft) + 1) ** (1 / 3.5) - 1))


@pytest.mark.parametrize("typecode", POLL_SCHUMANN)
def test_polar_is_poll_and_schumann_s(typecode: str) -> None:
    a, f = open_aircraft(typecode), entries(typecode, "facts")
    temperature, pressure, mach = 238.6, 37_600.0, 0.70
    viscosity = 1.458e-6 * temperature**1.5 / (temperature + 110.4)
    speed = mach * math.sqrt(1.4 * 287.05287 * temperature)
    reynolds = pressure / 287.05287 / temperature * speed * math.sqrt(a.wing_area_m2) / viscosity
    cd0 = 0.0269 / reynolds**0.14 * f["drag_psi_0"]
    aspect = f["span_m"] ** 2 / a.wing_area_m2
    k1 = 0.8 * (1 - 0.53 * f["cos_sweep"]) * cd0
    cd2 = (1.03 + f["drag_delta_2"] + k1 * math.pi * aspect) / (math.pi * aspect * f["winglet_factor"])
    assert derived(typecode, "cd0_cr") == pytest.approx(cd0, rel=ROUNDED)
    assert derived(typecode, "cd2_cr") == pytest.approx(cd2, rel=ROUNDED)


@pytest.mark.parametrize(
    ("typecode", "cd0", "cd2"),
    [("B738", 0.01704, 0.04262), ("A388", 0.01117, 0.04902), ("E190", 0.01689, 0.04122), ("E170", 0.01753, 0.04235)],
)
def test_polar_agrees_with_pycontrails(typecode: str, cd0: float, cd2: float) -> None:
    # Values of pycontrails 0.63.5 itself (printed with four digits) at that state: guards the formula above.
    assert derived(typecode, "cd0_cr") == pytest.approx(cd0, abs=1e-5)
    assert derived(typecode, "cd2_cr") == pytest.approx(cd2, abs=1e-5)


@pytest.mark.parametrize("typecode", JETS)
def test_climb_thrust_is_the_stated_lapse(typecode: str) -> None:
    a, static_n = open_aircraft(typecode), entries(typecode, "facts")["static_thrust_n"]
    altitude = np.arange(0, 40_001, 1000.0)
    thrust = []
    for h in altitude:
        mach = min(mach_of(250 if h < 10_000 else a.des_cas_high_kt, h), a.des_mach)
        total = pressure_ratio(h) * (1 + 0.2 * mach**2) ** 3.5
        thrust.append(0.85 * static_n * total * (1 - 0.49 * math.sqrt(mach)))
    fitted = a.ct1 * (1 - altitude / a.ct2 + a.ct3 * altitude**2)
    best = np.polyval(np.polyfit(altitude, thrust, 2), altitude)
    # Rounded coefficients of a least-squares fit: to 0.3 % of the largest thrust, and the fit itself within 2.5 %.
    assert np.abs(fitted - best).max() < 3e-3 * a.ct1
    assert np.abs(fitted - thrust).max() < 2.5e-2 * a.ct1


@pytest.mark.parametrize("typecode", open_typecodes())
def test_reference_mass_follows_the_rule(typecode: str) -> None:
    a, landing = open_aircraft(typecode), entries(typecode, "facts")["mass_landing_kg"]
    rule = a.mass_minimum_kg + 0.85 * (landing - a.mass_minimum_kg)
    assert a.mass_reference_kg == pytest.approx(rule, abs=51 if typecode in POLL_SCHUMANN else 5.1)  # rounded


@pytest.mark.parametrize("typecode", open_typecodes())
@pytest.mark.parametrize("configuration", ["cr", "ic", "to", "ap", "ld"])
def test_stall_speeds_follow_from_the_stated_lift(typecode: str, configuration: str) -> None:
    a, name = open_aircraft(typecode), f"vstall_{configuration}_kt"
    lift = float(source(typecode, name).split("CLmax ")[1].split(",")[0])
    speed = math.sqrt(2 * a.mass_reference_kg * G / (RHO0 * a.wing_area_m2 * lift)) / KT_MPS
    assert getattr(a, name) == pytest.approx(speed, abs=0.051)


@pytest.mark.parametrize("typecode", open_typecodes())
@pytest.mark.parametrize("configuration", ["ic", "to", "ap", "ld"])
def test_drag_of_configurations_follows_from_the_stated_increments(typecode: str, configuration: str) -> None:
    a = open_aircraft(typecode)
    increment = float(source(typecode, f"cd0_{configuration}").split("clean + ")[1])
    factor = float(source(typecode, f"cd2_{configuration}").split("clean x ")[1])
    assert getattr(a, f"cd0_{configuration}") == pytest.approx(a.cd0_cr + increment, abs=6e-6)
    assert getattr(a, f"cd2_{configuration}") == pytest.approx(a.cd2_cr * factor, rel=ROUNDED)


@pytest.mark.parametrize("typecode", POLL_SCHUMANN)
def test_fuel_of_jets_follows_from_databank_and_efficiency(typecode: str) -> None:
    a, f = open_aircraft(typecode), entries(typecode, "facts")
    assert a.cf1 == pytest.approx(f["fuel_takeoff_kg_s"] / f["static_thrust_n"] * 60e3, rel=ROUNDED)
    assert a.cf3 == pytest.approx(f["fuel_idle_kg_s"] * 60, rel=ROUNDED)
    speed = f["design_mach"] * math.sqrt(1.4 * 287.05287 * 218.808)
    efficiency = f["efficiency_1"] * f["design_mach"] ** f["efficiency_2"]
    assert a.cf1 * (1 + speed / KT_MPS / a.cf2) == pytest.approx(speed / efficiency / 43e6 * 60e3, rel=ROUNDED)


@pytest.mark.parametrize("typecode", PROPELLERS)
def test_propeller_thrust_and_drag_follow_from_power_and_span(typecode: str) -> None:
    a, f = open_aircraft(typecode), entries(typecode, "facts")
    assert a.ct1 == pytest.approx(0.85 * f["power_climb_w"] * a.n_engines / KT_MPS, rel=ROUNDED)
    assert derived(typecode, "cd2_cr") == pytest.approx(
        a.wing_area_m2 / (math.pi * 0.8 * f["span_m"] ** 2), rel=ROUNDED
    )


@pytest.mark.parametrize("typecode", PROPELLERS)
def test_descent_power_gives_the_stated_path_at_fl150(typecode: str) -> None:
    a, altitude_ft = open_aircraft(typecode), 15_000
    mach = mach_of(a.des_cas_high_kt, altitude_ft)
    temperature = 288.15 - 0.0065 * altitude_ft * FT_M
    speed = mach * math.sqrt(1.4 * 287.05287 * temperature)
    dynamic = 0.7 * pressure_ratio(altitude_ft) * 101_325 * mach**2
    weight = a.mass_reference_kg * G
    lift = weight / dynamic / a.wing_area_m2
    drag = dynamic * a.wing_area_m2 * (derived(typecode, "cd0_cr") + derived(typecode, "cd2_cr") * lift**2)
    thrust = derived(typecode, "ct_des_high") * a.ct1 / (speed / KT_MPS) * (1 - altitude_ft / a.ct2)
    compressed = (1 + 0.2 * mach**2) ** 3.5
    energy_share = 1 / (1 - 0.1332 * mach**2 + (1 + 0.2 * mach**2) ** -2.5 * (compressed - 1))
    sink = (drag - thrust) / weight * speed * energy_share
    stated = (
        2000 * FT_M / 60 if "2,000 ft/min" in source(typecode, "ct_des_high") else speed * math.sin(math.radians(3))
    )
    assert sink == pytest.approx(stated, rel=5e-3)  # the coefficient is printed with three decimals
