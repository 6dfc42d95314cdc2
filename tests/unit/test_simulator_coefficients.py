"""Coefficients of the aircraft that flew against scipy's optimum, and rates at the crossover."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
import torch
from scipy.optimize import minimize

from descentflow.aircraft_types.registry import aircraft
from descentflow.diagnosis.sides.assumptions import ASSUMED
from descentflow.diagnosis.sides.simulator_coefficients import (
    SimulatorCoefficients,
    _spread,
    scaled,
    simulator_coefficients,
)
from descentflow.effects._example_flights import example_flights
from descentflow.effects.flight_state import FlightState, log_rate
from descentflow.measurements.quantities import quantities_of
from descentflow.simulation.world import simulate
from descentflow.simulation.world_config import Operator, WorldConfig
from descentflow.surveillance.prepare import prepare

TRUE = torch.tensor([0.05, 0.2, -0.05, 0.5], dtype=torch.float64)


@pytest.fixture(scope="module")
def flown() -> tuple[FlightState, torch.Tensor]:
    """A hundred flights at other coefficients than the reference's, with 3 % of noise alike within a flight."""
    state = example_flights(100)
    generator = torch.Generator().manual_seed(3)
    whole = torch.randn(100, 1, generator=generator, dtype=torch.float64)
    each = torch.randn(100, 11, generator=generator, dtype=torch.float64)
    return state, log_rate(scaled(state, TRUE)) + 0.03 * whole + 0.01 * each


def hessian(f: Callable[[torch.Tensor], torch.Tensor], x: torch.Tensor, step: float = 1e-3) -> torch.Tensor:
    """Second derivatives by central differences."""
    moves = step * torch.eye(len(x), dtype=torch.float64)
    rows = [[f(x + a + b) - f(x + a - b) - f(x - a + b) + f(x - a - b) for b in moves] for a in moves]
    return torch.tensor(rows) / (4 * step**2)


def test_the_optimum_is_that_of_a_general_optimiser(flown: tuple[FlightState, torch.Tensor]) -> None:
    """The same posterior written down flight by flight, with the common error as parameters beside the others."""
    state, seen = flown
    alone = torch.arange(100)
    precision = torch.linalg.inv(torch.from_numpy(_spread(seen - log_rate(state))))
    missed = torch.linalg.inv(0.5 * ASSUMED.equation_spread**2 * (torch.eye(11, dtype=torch.float64) + 1.0))
    prior = torch.tensor(ASSUMED.coefficient_spread, dtype=torch.float64)

    def minus_log_posterior(both: torch.Tensor) -> torch.Tensor:
        rest = seen - log_rate(scaled(state, both[:4])) - both[4:]
        value = ((rest @ precision) * rest).sum() + both[4:] @ missed @ both[4:] + ((both[:4] / prior) ** 2).sum()
        return 0.5 * value

    best = minimize(
        lambda x: float(minus_log_posterior(torch.tensor(x))), [0.0] * 15, method="BFGS", options={"gtol": 1e-4}
    )
    coefficients = simulator_coefficients(state, seen, alone)
    # Differences of the optimiser's gradient limit it to some 1e-3 of a prior's spread.
    torch.testing.assert_close(coefficients.ln_factors, torch.tensor(best.x[:4]), atol=3e-3, rtol=0)
    spread = coefficients.covariance.diagonal().sqrt()
    curvature = hessian(minus_log_posterior, torch.tensor(best.x))
    # Gauss and Newton leave out the second derivatives of ln rate.
    torch.testing.assert_close(spread, torch.linalg.inv(curvature).diagonal()[:4].sqrt(), rtol=0.1, atol=0)


def test_the_common_scale_stays_as_open_as_before(flown: tuple[FlightState, torch.Tensor]) -> None:
    """No rate tells the scale of mass, drag and thrust: along it the data add nothing to the prior."""
    state, seen = flown
    coefficients = simulator_coefficients(state, seen, torch.arange(100))
    gauge = torch.tensor([1.0, 1.0, -1.0, 1.0], dtype=torch.float64)
    torch.testing.assert_close(log_rate(scaled(state, gauge * 0.2)), log_rate(state))
    prior = torch.diag(torch.tensor(ASSUMED.coefficient_spread, dtype=torch.float64) ** -2)
    known = gauge @ torch.linalg.inv(coefficients.covariance) @ gauge
    assert float(known) == pytest.approx(float(gauge @ prior @ gauge), rel=1e-3)


def test_flights_of_which_no_rate_was_seen_leave_the_prior() -> None:
    state = example_flights(5)
    blank = torch.full((5, 11), torch.nan, dtype=torch.float64)
    coefficients = simulator_coefficients(state, blank, torch.arange(5))
    torch.testing.assert_close(coefficients.covariance, SimulatorCoefficients.unknown().covariance)


def test_one_trajectory_flies_the_polars_rate_on_both_sides_of_its_crossover() -> None:
    """Its flights all cross over in one band, and what each loses of its height there does not average out."""
    still = {"level_off_share": 0.0, "managed_share": 0.0, "thrust_spread": 0.0, "cd0_spread": 0.0, "mach_spread": 0.0}
    quiet = replace(WorldConfig(), **still, cas_spread_kt=0.0, wander_kt=0.0, rate_smoothing_s=0.0)
    alike = replace(quiet, operators=(Operator("ONE", 1.0, 289.0, 0.797),), mass_range=(0.875, 0.875))
    frame = prepare(simulate("B738", 40, 3, alike)).frame
    quantities = quantities_of(frame, 150, 360, ["IAS", "Mach", "vertical_rate"])
    physics = quantities.physics
    cas = physics["cas_mps"]
    middles = (150 + (torch.arange(cas.shape[1], dtype=torch.float64) + 0.5) * quantities.band_fl) * 30.48
    mass_kg = 0.875 * 66_349
    state = FlightState(
        aircraft("B738"),
        mass_kg,
        middles,
        quantities.band_fl * 30.48,
        cas,
        physics["cas_slope_per_s"],
        torch.zeros_like(cas),
        cas.isfinite(),
        physics["depth_m"],
    )
    beyond = np.nanmean((physics["log_rate"] - state.own_log_rate).numpy(), 0)
    # A step of the energy share is 0.3; a line through more than a band leaves 0.06 of it.
    assert np.abs(np.diff(beyond)[4:13]).max() < 0.03
