"""Against pyBADA itself on its six dummy aircraft: every function of a descent, on points chosen to hit every edge.

Relative 1e-9 is asked, where the measured deviations are near 1e-13. Only a crossover above the tropopause differs
more, because pyBADA rounds the pressure of the tropopause; no dummy aircraft has one.
"""

import pytest
import torch
from bada4_dummies import dummies

from descentflow.aircraft_types.bada3._bada_directory import load_aircraft
from descentflow.core.units import FT_M
from descentflow.physics.airspeed import cas_to_tas_mps, crossover_altitude_m
from descentflow.physics.energy import descent_rate_mps, energy_share_factor
from descentflow.physics.performance_model import NAMES

# pyBADA warns of its own (numpy and pandas deprecations, optional map packages); the package's warnings stay errors.
pytestmark = pytest.mark.filterwarnings("ignore:::pyBADA")

TYPES = ("J2M", "J2H", "J4H", "BZJT", "TP2M", "GA")
MASSES = ("minimum", "reference", "maximum")
DEVIATIONS = (-15.0, 0.0, 25.0)
RELATIVE = 1e-9
LEVELS_FT = (
    0, 400, 700, 1200, 1700, 2500, 3500, 5000, 7000, 9000, 11000, 14000, 16000, 21000, 26000, 30000, 35000, 41000,
)  # fmt: skip


class Side:
    """One type on both sides, at points (altitude, mass, deviation) with the CAS of the schedule."""

    def __init__(self, code):
        from pyBADA import atmosphere
        from pyBADA.bada3 import Bada3Aircraft

        self.air = atmosphere
        self.theirs = Bada3Aircraft(badaVersion="DUMMY", acName=code)
        self.ours = load_aircraft(code, dummies("BADA3"))
        transition = float(self.ours.transition_altitude_m())
        hand_over = self.ours.altitude_des_ft * FT_M
        edges = [11000.0, 11000.001, 11500.0, transition - 0.01, transition + 0.01, hand_over - 0.01, hand_over + 0.01]
        altitudes = [*(ft * FT_M for ft in LEVELS_FT), *edges]
        masses = [self.theirs.mass[name] for name in MASSES]
        points = [(h, m, d) for h in altitudes for m in masses for d in DEVIATIONS]
        self.points = points
        self.altitude, self.mass, self.deviation = torch.tensor(points, dtype=torch.float64).T
        self.cas = self.ours.descent_cas_mps(self.altitude, self.mass)
        self.tas = cas_to_tas_mps(self.cas, self.altitude, self.deviation)

    def each(self, function):
        """Call pyBADA point by point."""
        speeds = zip(self.cas.tolist(), self.tas.tolist(), strict=True)
        values = [float(function(*point, *speed)) for point, speed in zip(self.points, speeds, strict=True)]
        return torch.tensor(values, dtype=torch.float64)

    def ratios(self, h, deviation):
        return self.air.atmosphereProperties(h=h, deltaTemp=deviation)


@pytest.fixture(scope="module", params=TYPES)
def side(request):
    return Side(request.param)


def agree(ours, expected):
    torch.testing.assert_close(*torch.broadcast_tensors(ours, expected), rtol=RELATIVE, atol=1e-9)


def test_schedule(side):
    def theirs(h, mass, deviation, *_):
        theta, delta, _ = side.ratios(h, deviation)
        return side.theirs.ARPM.descentSpeed(theta, delta, mass, h, deviation, applyLimits=False)[0]

    agree(side.cas, side.each(theirs))


def test_true_airspeed(side):
    agree(side.tas, side.each(lambda h, m, d, cas, _: side.air.cas2Tas(cas, *side.ratios(h, d)[1:])))


def test_envelope(side):
    envelope = side.theirs.flightEnvelope
    for name in ("CR", "AP", "LD"):
        agree(side.ours.stall_cas_mps(side.mass, name), side.each(lambda h, m, d, *_, n=name: envelope.VStall(m, n)))
        lowest = side.ours.minimum_cas_mps(side.altitude, side.mass, name)
        agree(lowest, side.each(lambda h, m, d, *_, n=name: envelope.VMin(h, m, n, d)))
    highest = side.ours.maximum_altitude_m(side.mass, side.deviation)
    agree(highest, side.each(lambda h, m, d, *_: envelope.maxAltitude(m, d)))


def test_configuration(side):
    for slower in (1.0, 0.95, 0.85, 0.7):
        configuration = side.ours.descent_configuration(side.altitude, slower * side.cas, side.mass)

        def theirs(h, m, d, cas, _, s=slower):
            return NAMES[side.theirs.flightEnvelope.getConfig("Descent", h, m, s * cas, d)]

        assert configuration.tolist() == side.each(theirs).int().tolist()


def test_thrust_and_fuel(side):
    climb = side.ours.climb_thrust_n(side.altitude, side.tas, side.deviation)
    agree(climb, side.each(lambda h, m, d, _, tas: side.theirs.TMax(h, d, "MCMB", tas)))
    for name in ("CR", "AP", "LD"):
        thrust = side.ours.idle_thrust_n(side.altitude, side.tas, side.deviation, name)
        agree(thrust, side.each(lambda h, m, d, _, tas, n=name: side.theirs.TDes(h, d, tas, n)))
        powered = side.ours.fuel_flow_kg_s(side.altitude, side.tas, thrust)
        fuel = side.ours.idle_fuel_flow_kg_s(side.altitude) if name == "CR" else powered
        by_point = dict(zip(side.points, thrust.tolist(), strict=True))
        if side.ours.engine == "piston" and name != "CR":
            continue  # pyBADA takes the nominal flow here, the manual (3.9-8) and EUROCONTROL's tables the minimum

        def theirs(h, m, d, _, tas, n=name, forces=by_point):
            return side.theirs.ff(h, tas, forces[h, m, d], n, "Descent")

        agree(fuel, side.each(theirs))


def test_drag(side):
    for name in ("CR", "AP", "LD"):

        def theirs(h, m, d, _, tas, n=name):
            sigma = side.ratios(h, d)[2]
            return side.theirs.D(sigma, tas, side.theirs.CD(side.theirs.CL(sigma, m, tas), n))

        agree(side.ours.drag_n(side.tas, side.altitude, side.deviation, side.mass, name), side.each(theirs))


@pytest.mark.parametrize("held", ["constM", "constCAS"])
def test_energy_share_and_rate(side, held):
    def mach(h, d, tas):
        return side.air.tas2Mach(tas, side.ratios(h, d)[0])

    def share(h, m, d, _, tas):
        return side.theirs.esf(h=h, flightEvolution=held, M=mach(h, d, tas), deltaTemp=d)

    def rate(h, m, d, cas, tas):
        return side.theirs.ROCD(T=1e3, D=4e4, v=tas, mass=m, ESF=share(h, m, d, cas, tas), h=h, deltaTemp=d)

    above = torch.tensor(held == "constM")
    numbers = side.each(lambda h, m, d, _, tas: mach(h, d, tas))
    factor = energy_share_factor(numbers, side.altitude, above, side.deviation)
    agree(factor, side.each(share))
    flown = descent_rate_mps(side.ours, 4e4, 1e3, side.tas, factor, side.altitude, side.deviation, side.mass)
    agree(flown, side.each(rate))


@pytest.mark.parametrize(("cas", "mach", "tolerance"), [(150.0, 0.78, 1e-12), (110.0, 0.8, 5e-9)])
def test_crossover_below_and_above_the_tropopause(side, cas, mach, tolerance):
    expected = float(side.air.crossOver(cas=cas, Mach=mach))
    assert crossover_altitude_m(cas, mach).item() == pytest.approx(expected, rel=tolerance)
    assert (expected > 11000.0) is (cas < 120.0)
