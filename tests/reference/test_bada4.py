"""BADA 4 against EUROCONTROL's printed tables of its dummies, and against pyBADA's classes."""

import pytest
import torch
from bada4_dummies import DUMMIES, dummies, printed_descents

from descentflow.aircraft_types.bada4.acm_file import read_acm, read_gpf
from descentflow.aircraft_types.bada4.engines import Piston
from descentflow.aircraft_types.registry import aircraft
from descentflow.core.units import FL_M, FPM_MPS, FT_M, KT_MPS
from descentflow.physics.airspeed import cas_to_mach, mach_to_cas_mps, mach_to_tas_mps
from descentflow.physics.atmosphere import density_kg_m3, pressure_pa, speed_of_sound_mps, temperature_k
from descentflow.physics.energy import descent_rate_mps, energy_share_factor, inferred_drag_n
from descentflow.physics.nominal_descent import nominal_state
from descentflow.physics.performance_model import NAMES

pytestmark = pytest.mark.filterwarnings("ignore:::pyBADA")
HALF = {"T": 0.005, "p": 0.5, "rho": 0.0005, "a": 0.05, "TAS": 0.005, "CAS": 0.005, "M": 0.0005, "thrust": 0.5}
HALF |= {"drag": 0.5, "fuel": 0.005, "ESF": 0.0005, "rod": 0.5, "gamma": 0.005}
"""Half a unit of each column's last printed digit."""
CONSTANTS = 4e-6
"""Relative room for constants of the printing program that differ in the seventh digit; measured up to 3.4e-6."""
THROTTLE_STEP = 0.01
"""The printing program finds the fuel of a piston in powered flight on steps of the throttle, so half a step more."""
POINTS = 60


@pytest.mark.parametrize("warmer", [False, True], ids=["ISA", "ISA+20"])
@pytest.mark.parametrize("name", DUMMIES)
def test_every_printed_column_to_print_rounding(name: str, warmer: bool) -> None:
    model, deviation = aircraft(name, dummies()), 20.0 * warmer
    empty, heaviest = model.mass_minimum_kg, model.mass_maximum_kg
    masses = (1.2 * empty, model.mass_reference_kg, heaviest)
    tables = printed_descents(name, warmer)
    assert len(tables) == 3
    for (printed, configurations), mass in zip(tables, masses, strict=True):
        assert bool((printed["mass"] == round(mass)).all())
        altitude = printed["level"] * FL_M
        state = nominal_state(model, altitude, mass, deviation)
        assert state.configuration.tolist() == [NAMES[configuration] for configuration in configurations]
        climbing = state.rate_mps * temperature_k(altitude, deviation) / temperature_k(altitude)
        ours = {
            "T": temperature_k(altitude, deviation),
            "p": pressure_pa(altitude),
            "rho": density_kg_m3(altitude, deviation),
            "a": speed_of_sound_mps(altitude, deviation),
            "TAS": state.tas_mps / KT_MPS,
            "CAS": state.cas_mps / KT_MPS,
            "M": state.mach,
            "thrust": state.thrust_n,
            "drag": state.drag_n,
            "fuel": state.fuel_kg_s * 60,
            "ESF": state.esf,
            "rod": -state.rate_mps / FPM_MPS,
            "gamma": torch.asin(climbing / state.tas_mps).rad2deg(),
        }
        for column, value in ours.items():
            room = HALF[column] + CONSTANTS * value.abs()
            if column == "fuel" and isinstance(model.engines, Piston):
                engines = model.engines
                full = engines.power_hp * 745.7 * engines.consumption / engines.heating_value_j_kg * 60
                room = room + (state.configuration > 0) * full * THROTTLE_STEP / 2
            assert bool(((value - printed[column]).abs() <= room).all()), column


class Side:
    """A dummy on both sides, at random states from low speed to beyond M_MO; of version 4.2 with its own branch."""

    def __init__(self, name: str, version: str, folder):
        from pyBADA import atmosphere
        from pyBADA.bada4 import Bada4Aircraft as Theirs

        self.air, self.theirs = atmosphere, Theirs(badaVersion="DUMMY", acName=name)
        limits = read_gpf(dummies() / "GPF.xml")
        self.ours = read_acm(dummies() / name / f"{name}.xml", limits)
        if version == "4.2":
            self.theirs.BADAVersion = self.theirs.AC.BADAVersion = "4.2"
            lines = (dummies() / name / f"{name}.xml").read_text().splitlines()
            older = [line for line in lines if "<p_delta>" not in line and "<p_theta>" not in line]
            (folder / "older.xml").write_text("\n".join(older))
            self.ours = read_acm(folder / "older.xml", limits)
        assert self.ours.engines.version == version
        draw = torch.rand(4, POINTS, generator=torch.Generator().manual_seed(4), dtype=torch.float64)
        self.altitude = draw[0] * self.ours.altitude_maximum_ft * FT_M
        self.deviation = -15 + 40 * draw[1]
        self.mass = torch.lerp(*torch.tensor([self.ours.mass_minimum_kg, self.ours.mass_maximum_kg]).double(), draw[2])
        slowest = cas_to_mach(self.ours.minimum_cas_mps(self.altitude, self.mass), self.altitude)
        self.mach = slowest + draw[3] * (self.ours.mmo + 0.02 - slowest)
        self.tas = mach_to_tas_mps(self.mach, self.altitude, self.deviation)

    def each(self, function):
        """Call pyBADA state by state, with its own ratios of the air."""
        columns = (one.tolist() for one in (self.altitude, self.deviation, self.mass, self.mach))
        values = []
        for h, deviation, mass, mach in zip(*columns, strict=True):
            theta, delta, _ = self.air.atmosphereProperties(h=h, deltaTemp=deviation)
            values.append(function(h, mass, {"theta": theta, "delta": delta, "M": mach, "deltaTemp": deviation}))
        return torch.tensor(values, dtype=torch.float64)


@pytest.fixture(scope="module", params=[(name, version) for name in DUMMIES for version in ("4.3", "4.2")], ids=str)
def side(request, tmp_path_factory):
    return Side(*request.param, tmp_path_factory.mktemp("older"))


def agree(ours, expected, scale=0.0):
    torch.testing.assert_close(*torch.broadcast_tensors(ours, expected), rtol=1e-9, atol=1e-9 * (1 + scale))


def test_forces_and_rates_agree_with_pybada(side) -> None:
    state = side.altitude, side.deviation
    theirs = side.theirs
    idle = side.ours.idle_thrust_n(side.altitude, side.tas, side.deviation)
    agree(idle, side.each(lambda h, m, air: theirs.Thrust(rating="LIDL", **air)), scale=1e3)
    climb = side.ours.climb_thrust_n(side.altitude, side.tas, side.deviation)
    agree(climb, side.each(lambda h, m, air: theirs.Thrust(rating="MCMB", **air)))
    for name in NAMES:
        position = theirs.flightEnvelope.getAeroConfig(name)

        def drag(h, mass, air, at=position):
            lift = theirs.CL(air["delta"], mass, air["M"])
            return theirs.D(air["delta"], air["M"], theirs.CD(*at, lift, air["M"]))

        def rate(h, mass, air, own=drag):
            share = theirs.esf(h=h, flightEvolution="constCAS", M=air["M"], deltaTemp=air["deltaTemp"])
            speed = air["M"] * side.air.aSound(theta=air["theta"])
            thrust = theirs.Thrust(rating="LIDL", **air)
            return theirs.ROCD(thrust, own(h, mass, air), speed, mass, share, h, air["deltaTemp"])

        ours = side.ours.drag_n(side.tas, *state, side.mass, name)
        agree(ours, side.each(drag))
        share = energy_share_factor(side.mach, side.altitude, torch.tensor(False), side.deviation)
        rates = descent_rate_mps(side.ours, ours, idle, side.tas, share, *state, side.mass)
        agree(rates, side.each(rate))
        back = inferred_drag_n(side.ours, rates, idle, side.tas, share, *state, side.mass)
        torch.testing.assert_close(back, ours, rtol=1e-12, atol=0)


def test_fuel_agrees_with_pybada(side) -> None:
    idle = side.ours.idle_fuel_flow_kg_s(side.altitude, side.tas, side.deviation)
    agree(idle, side.each(lambda h, m, air: side.theirs.ff(rating="LIDL", **air)))
    if isinstance(side.ours.engines, Piston):
        return  # pyBADA takes the nearest hundredth of the throttle; the printed tables hold ours
    wanted = side.ours.drag_n(side.tas, side.altitude, side.deviation, side.mass)
    powered = side.ours.fuel_flow_kg_s(side.altitude, side.tas, wanted, side.deviation)

    def theirs(h, mass, air):
        lift = side.theirs.CL(air["delta"], mass, air["M"])
        thrust = side.theirs.D(air["delta"], air["M"], side.theirs.CD(0, "LGUP", lift, air["M"]))
        return side.theirs.ff(CT=side.theirs.CT(Thrust=thrust, delta=air["delta"]), **air)

    agree(powered, side.each(theirs))
    assert bool((powered >= idle).all())


def test_minimum_speeds_agree_with_pybada(side) -> None:
    for name in NAMES:
        slowest = side.ours.minimum_cas_mps(side.altitude, side.mass, name)
        limits = side.theirs.flightEnvelope
        lowest = side.each(lambda h, m, air, n=name, e=limits: e.VMin(n, air["theta"], air["delta"], m) or torch.nan)
        if name == "CR" and len(side.ours.wing.clean_lift) > 1:
            # pyBADA takes the first of Mach numbers in steps of 0.001 beyond the buffet, we the buffet itself.
            step = mach_to_cas_mps(cas_to_mach(slowest, side.altitude) + 0.001, side.altitude) - slowest
            known = ~lowest.isnan()
            assert bool(((lowest - slowest)[known] >= -1e-9).all())
            assert bool(((lowest - slowest)[known] <= step[known] * 1.001).all())
        else:
            agree(slowest, lowest)
