"""The seam of performance models: what is behind it is read nowhere else."""

import ast
from dataclasses import fields
from pathlib import Path

import torch
from plain_descents import plain_descents
from torch import Tensor

import descentflow
from descentflow.aircraft_types.bada3.bada3_aircraft import Bada3Aircraft
from descentflow.aircraft_types.bada3.coefficients import Coefficients
from descentflow.aircraft_types.registry import aircraft
from descentflow.core.constants import P0_PA
from descentflow.core.tensors import as_tensors
from descentflow.core.units import FL_M
from descentflow.physics.airspeed import tas_to_mach
from descentflow.physics.atmosphere import pressure_pa
from descentflow.physics.nominal_descent import nominal_descent
from descentflow.physics.performance_model import Configuration, PerformanceModel
from descentflow.representation.decoder.trajectories import integrate
from descentflow.representation.profiles import infer_drag_n

PACKAGE = Path(descentflow.__file__).parent
BEHIND = {field.name for field in fields(Coefficients)} - set(dir(PerformanceModel)) - {"engine", "limits"}
"""Coefficients of BADA 3 that no other model has."""


def test_a_type_is_a_performance_model() -> None:
    assert isinstance(aircraft("A320"), PerformanceModel)
    assert not isinstance("A320", PerformanceModel)


def test_coefficients_of_bada_3_are_read_by_its_model_alone() -> None:
    strays = [
        f"{path.relative_to(PACKAGE)}:{node.lineno} {node.attr}"
        for path in sorted(PACKAGE.rglob("*.py"))
        if path.relative_to(PACKAGE).parts[0] != "aircraft_types"
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.Attribute) and node.attr in BEHIND
    ]
    assert strays == []


class Windmilling(Bada3Aircraft):
    """A type whose engines brake at idle, by powers of the Mach number and of the pressure, as BADA 4 has it."""

    def idle_thrust_terms(self, altitude_m: Tensor, deviation_k: float | Tensor = 0.0) -> dict[int, Tensor]:
        delta = pressure_pa(altitude_m) / P0_PA
        return {0: -900.0 * delta, 1: -26e3 * delta, 2: 9e3 * delta.square(), -1: 20.0 * delta}

    def idle_thrust_n(
        self,
        altitude_m: float | Tensor,
        tas_mps: float | Tensor,
        deviation_k: float | Tensor = 0.0,
        configuration: Configuration = "CR",
    ) -> Tensor:
        altitude, tas, deviation = as_tensors(altitude_m, tas_mps, deviation_k)
        mach = tas_to_mach(tas, altitude, deviation)
        return sum(term * mach**power for power, term in self.idle_thrust_terms(altitude, deviation).items())

    def thrust_breaks_m(self) -> tuple[Tensor, ...]:
        return (torch.tensor(9_000.0).double(),)


BRAKING = Windmilling.from_state(aircraft("A320").to_state())
LEVELS_FL = torch.arange(100, 371).double()
FLOWN = (
    torch.full((2, 271), 28e3).double(),
    torch.linspace(120, 155, 271).double().expand(2, -1),
    torch.tensor([270, 9]),
)


def test_idle_thrust_below_zero_by_powers_of_mach_is_inferred_and_flown() -> None:
    for deviation in (0.0, 20.0):
        flown = integrate(BRAKING, LEVELS_FL, LEVELS_FL * FL_M, *FLOWN, deviation_k=deviation)
        wanted = plain_descents(BRAKING, LEVELS_FL * FL_M, *FLOWN, deviation_k=deviation)
        for name, values in wanted.items():
            torch.testing.assert_close(getattr(flown, name), values, rtol=1e-12, atol=1e-10)
        thrust = BRAKING.idle_thrust_n(LEVELS_FL * FL_M, flown.tas_mps, deviation)
        assert -20e3 < float(thrust.min()) < float(thrust.max()) < -1e3
        inferred = infer_drag_n(BRAKING, flown.cas_mps, flown.rate_mps, LEVELS_FL * FL_M, deviation_k=deviation)
        torch.testing.assert_close(inferred, FLOWN[0], rtol=1e-12, atol=0)


def test_its_descents_are_differentiable() -> None:
    def seconds(drag: Tensor, mass: Tensor) -> Tensor:
        part = slice(0, 5)
        arguments = LEVELS_FL[part], LEVELS_FL[part] * FL_M, 1e4 * drag, FLOWN[1][:, part], torch.tensor([4, 2])
        return integrate(BRAKING, *arguments, mass_kg=6e4 * mass).time_s

    leaves = torch.full((2, 5), 3.0).double(), torch.tensor([[1.0], [1.1]]).double()
    assert torch.autograd.gradcheck(seconds, tuple(leaf.requires_grad_() for leaf in leaves))


def test_its_nominal_descent_is_flown() -> None:
    nominal = nominal_descent(BRAKING, LEVELS_FL)
    assert bool((nominal.thrust_n < 0).all())
    assert float(nominal.time_s[0]) < float(nominal_descent(aircraft("A320"), LEVELS_FL).time_s[0])
