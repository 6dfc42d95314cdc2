"""The seam of performance models: what is behind it is read nowhere else."""

import ast
from dataclasses import fields
from pathlib import Path

import pytest
import torch
from bada4_dummies import DUMMIES, dummies
from plain_descents import plain_descents
from torch import Tensor

import descentflow
from descentflow.aircraft_types.bada3.coefficients import Coefficients
from descentflow.aircraft_types.bada4.bada4_aircraft import Bada4Aircraft
from descentflow.aircraft_types.bada4.engines import Piston, Turboprop
from descentflow.aircraft_types.bada4.wing import Wing
from descentflow.aircraft_types.registry import aircraft, aircraft_from_state
from descentflow.core.constants import G0_MPS2
from descentflow.core.errors import AircraftError
from descentflow.core.units import FL_M, KT_MPS
from descentflow.physics.nominal_descent import nominal_descent
from descentflow.physics.performance_model import NAMES, PerformanceModel
from descentflow.representation.decoder.trajectories import integrate
from descentflow.representation.drag_scale import DragScaleName, fit_drag_scale
from descentflow.representation.profiles import drag_at_idle_n, profiles_with_drag

PACKAGE = Path(descentflow.__file__).parent
PARTS = (Coefficients, Bada4Aircraft, Wing, Turboprop, Piston)
ELSEWHERE = {"engine", "limits", "version", "thrust", "landing", "wing", "drag", "exponents"}
BEHIND = {field.name for part in PARTS for field in fields(part)} - set(dir(PerformanceModel)) - ELSEWHERE
"""Coefficients that one model has and no other."""
WRITER = "repaired_files"
"""Writes files of BADA 3."""


def test_a_type_is_a_performance_model() -> None:
    assert isinstance(aircraft("A320"), PerformanceModel)
    assert not isinstance("A320", PerformanceModel)


def test_coefficients_of_a_model_are_read_by_it_alone() -> None:
    strays = [
        f"{path.relative_to(PACKAGE)}:{node.lineno} {node.attr}"
        for path in sorted(PACKAGE.rglob("*.py"))
        if path.relative_to(PACKAGE).parts[0] != "aircraft_types" and path.stem != WRITER
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.Attribute) and node.attr in BEHIND
    ]
    assert strays == []


@pytest.fixture(params=DUMMIES)
def braking(request: pytest.FixtureRequest) -> PerformanceModel:
    """EUROCONTROL's dummies: the engines of jets and turboprops brake at idle."""
    return aircraft(request.param, dummies())


LEVELS_FL = torch.arange(50, 141).double()


def flights(model: PerformanceModel, levels_fl: Tensor = LEVELS_FL) -> tuple[Tensor, Tensor, Tensor]:
    """Drag, CAS and entry of two descents."""
    speeds = torch.linspace(0.8, 1.0, len(levels_fl)).double() * model.des_cas_high_kt * KT_MPS
    drag = 0.08 * model.mass_reference_kg * G0_MPS2
    return torch.full((2, len(levels_fl)), drag).double(), speeds.expand(2, -1), torch.tensor([len(levels_fl) - 1, 9])


def test_idle_thrust_by_powers_of_mach_is_inferred_and_flown(braking: PerformanceModel) -> None:
    flown_in = flights(braking)
    for deviation in (0.0, 20.0):
        flown = integrate(braking, LEVELS_FL, LEVELS_FL * FL_M, *flown_in, deviation_k=deviation)
        wanted = plain_descents(braking, LEVELS_FL * FL_M, *flown_in, deviation_k=deviation)
        for name, values in wanted.items():
            torch.testing.assert_close(getattr(flown, name), values, rtol=1e-12, atol=1e-10)
        thrust = braking.idle_thrust_n(LEVELS_FL * FL_M, flown.tas_mps, deviation)
        assert braking.engine == "piston" or float(thrust.max()) < -1e3
        inferred = drag_at_idle_n(braking, flown.cas_mps, flown.rate_mps, LEVELS_FL * FL_M, deviation_k=deviation)
        torch.testing.assert_close(inferred, flown_in[0], rtol=1e-12, atol=0)


def test_descents_are_differentiable_by_drag_mass_and_coefficients(braking: PerformanceModel) -> None:
    levels_fl = LEVELS_FL[::30]
    drag_n, cas_mps, _ = flights(braking, levels_fl)
    entry = torch.tensor([len(levels_fl) - 1, 2])

    def seconds(drag: Tensor, mass: Tensor, idle: Tensor) -> Tensor:
        model = braking.with_factors(idle=idle)
        return integrate(
            model, levels_fl, levels_fl * FL_M, drag_n * drag, cas_mps, entry, mass_kg=braking.mass_reference_kg * mass
        ).time_s

    leaves = torch.ones_like(drag_n), torch.tensor([[1.0], [1.1]]).double(), torch.ones(()).double()
    assert torch.autograd.gradcheck(seconds, tuple(leaf.requires_grad_() for leaf in leaves))


def test_every_equation_is_differentiable(braking: PerformanceModel) -> None:
    top = 0.97 * float(braking.mmo) * 340.0

    def equations(speed: Tensor, height: Tensor, mass: Tensor, induced: Tensor) -> tuple[Tensor, ...]:
        model = braking.with_factors(induced=induced)
        tas, altitude, kilos = 100 * speed, 1e4 * height, mass * braking.mass_reference_kg
        return (
            *(model.drag_n(tas, altitude, 10.0, kilos, name) for name in NAMES),
            *(model.minimum_cas_mps(altitude, kilos, name) for name in NAMES),
            model.idle_thrust_n(altitude, tas, 10.0),
            model.climb_thrust_n(altitude, tas, 10.0),
            model.idle_fuel_flow_kg_s(altitude, tas, 10.0),
            model.fuel_flow_kg_s(altitude, tas, 0.5 * model.drag_n(tas, altitude), 10.0),
            model.descent_cas_mps(altitude, kilos),
            model.maximum_altitude_m(2.0 * kilos),
        )

    speed, height = torch.tensor([[0.4 * top, 0.7 * top, top], [600.0, 2_000.0, 4_000.0]]).double()
    leaves = speed / 100, height / 1e4, torch.ones(1).double(), torch.ones(()).double()
    units = [name.abs().max() for name in equations(*leaves)]

    def in_units(*arguments: Tensor) -> tuple[Tensor, ...]:
        return tuple(name / unit for name, unit in zip(equations(*arguments), units, strict=True))

    assert torch.autograd.gradcheck(in_units, tuple(leaf.requires_grad_() for leaf in leaves), rtol=1e-4)


@pytest.mark.parametrize("logarithm", ["log", "newton"])
def test_idle_thrust_below_zero_works_in_every_scale_of_drag(
    braking: PerformanceModel, logarithm: DragScaleName
) -> None:
    """Down to the levels of the approach, where nominal engines give thrust and flights are taken to idle."""
    levels_fl = torch.arange(10, 101).double()
    drag_n, cas_mps, _ = flights(braking, levels_fl)
    entry = torch.full((2,), len(levels_fl) - 1)
    flown = integrate(braking, levels_fl, levels_fl * FL_M, drag_n * torch.tensor([[0.8], [1.2]]), cas_mps, entry)
    args = ("a", "b"), levels_fl, flown.time_s, flown.cas_mps, flown.rate_mps, flown.mask
    seen = profiles_with_drag(braking, *args)
    scale = fit_drag_scale(seen, braking, logarithm)
    back = scale.drag_n(scale.scaled(seen.drag_n, seen.cas_mps), seen.cas_mps)
    torch.testing.assert_close(back, seen.drag_n, rtol=1e-12, atol=0)
    assert bool(scale.scaled(seen.drag_n, seen.cas_mps).isfinite().all())


def test_its_nominal_descent_is_flown_and_comes_back_from_its_state(braking: PerformanceModel) -> None:
    nominal = nominal_descent(braking, LEVELS_FL)
    assert bool((nominal.rate_mps < 0).all())
    again = aircraft_from_state(braking.to_state())
    assert again == braking
    assert torch.equal(nominal_descent(again, LEVELS_FL).time_s, nominal.time_s)


def test_a_state_that_is_none_of_bada_4_is_refused(braking: PerformanceModel) -> None:
    state = braking.to_state()
    wing = state["wing"]
    for wrong in (
        {"engine": "rocket"},
        {"vmo_kt": float("nan")},
        {"vmo_kt": -1.0},
        {"typecode": 3},
        {"wing": {**wing, "drag": wing["drag"][1:]}},
        {"wing": {**wing, "span_m": 30.0}},
        {"engines": None},
        {"limits": {}},
        {"climb_speeds": (1.0,)},
    ):
        with pytest.raises(AircraftError, match="expected"):
            aircraft_from_state(state | wrong)
    with pytest.raises(AircraftError, match="mass_reference_kg"):
        aircraft_from_state({name: value for name, value in state.items() if name != "mass_reference_kg"})
