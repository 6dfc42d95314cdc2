r"""Mass, drag and idle thrust of the aircraft that a simulator flies, as its own flights show them, and how surely.

An effect's signature is taken with some aircraft's coefficients, and the simulator's are not known: it may fly another
polar, another mass, another idle thrust. So they are parameters,
:math:`\psi = \ln(m, C_{D0}, C_{D2}, T_\mathrm{idle})` minus those of the type, with a prior as wide as open
sources differ. The simulator's own rates say what they can,

.. math:: \ln R_i = f_i(\psi) + b + e_i, \quad b \sim N(0, B), \quad e_i \sim N(0, S), \quad \psi \sim N(0, \Lambda_0),

by their dependence on altitude and on each flight's CAS; ``b`` is what such equations miss in every flight alike. The
prior alone decides along :math:`(m, T, C_{D0}, C_{D2}) \to (lm, lT, lC_{D0}, C_{D2}/l)`, which changes no rate at all.
"""

from dataclasses import dataclass, replace

import numpy as np
import torch
from torch import Tensor

from descentflow.core.linear_gaussian import Array, Precisions, shrunk
from descentflow.diagnosis.sides.assumptions import ASSUMED, Assumptions
from descentflow.effects.flight_state import FlightState, log_rate

GAUSS_NEWTON_STEPS = 4
"""Gauss-Newton steps: ln rate is close to linear in these logarithms."""
LEAST_SPREAD = 0.003
"""Least spread of ln rate between aircraft: those of a simulator may all fly alike."""
LOG_STEP = 1e-3
"""Step of the differences, in logarithms."""


@dataclass(frozen=True)
class SimulatorCoefficients:
    """Logarithms (4,) of what mass, CD0, CD2 and idle thrust are times the type's, and their covariance (4, 4).

    Example:
        >>> known = SimulatorCoefficients.unknown()
        >>> known.ln_factors.tolist(), known.covariance.diagonal().sqrt().tolist()
        ([0.0, 0.0, 0.0, 0.0], [0.12, 0.23, 0.1, 0.8])
    """

    ln_factors: Tensor
    covariance: Tensor

    @classmethod
    def unknown(cls, assumed: Assumptions = ASSUMED) -> "SimulatorCoefficients":
        """Before any flight was seen."""
        prior = torch.tensor(assumed.coefficient_spread, dtype=torch.float64)
        return cls(torch.zeros(4, dtype=torch.float64), torch.diag(prior**2))

    def directions(self) -> Tensor:
        """Columns (4, 4) that span the covariance: each is one standard deviation of an independent part of it.

        Example:
            >>> columns = SimulatorCoefficients.unknown().directions()
            >>> torch.allclose(columns @ columns.T, SimulatorCoefficients.unknown().covariance)
            True
        """
        values, vectors = torch.linalg.eigh(self.covariance)
        columns: Tensor = vectors * values.clamp(min=0.0).sqrt()
        return columns

    def applied(self, state: FlightState) -> FlightState:
        """Flights of the type, looked at with these coefficients.

        Example:
            >>> from descentflow.effects._example_flights import example_flights
            >>> heavier = SimulatorCoefficients(torch.tensor([0.1, 0.0, 0.0, 0.0]), torch.eye(4))
            >>> round(heavier.applied(example_flights()).mass_kg / example_flights().mass_kg, 3)
            1.105
        """
        return scaled(state, self.ln_factors)


def scaled(state: FlightState, ln_factors: Tensor) -> FlightState:
    """The flights with mass, CD0, CD2 and idle thrust times the exponentials of logarithms (4,).

    Example:
        >>> from descentflow.effects._example_flights import example_flights
        >>> state, gauge = example_flights(), torch.tensor([0.1, 0.1, -0.1, 0.1])
        >>> torch.allclose(log_rate(scaled(state, gauge)), log_rate(state))  # nothing that is observed changes
        True
    """
    mass, parasitic, induced, idle = ln_factors.exp().tolist()
    aircraft = state.aircraft.with_factors(parasitic=parasitic, induced=induced, idle=idle)
    return replace(state, aircraft=aircraft, mass_kg=state.mass_kg * mass)


def simulator_coefficients(
    state: FlightState, log_rate_seen: Tensor, airframe: Tensor, assumed: Assumptions = ASSUMED
) -> SimulatorCoefficients:
    """Coefficients that a simulator's own flights show: the most probable ones, and the covariance about them.

    Args:
        state: The flights (n, K), with the type's coefficients and its reference mass.
        log_rate_seen: (n, K) ln of the rate, m/s; NaN where not seen.
        airframe: (n,) aircraft: what its flights share counts once.
        assumed: Constants.

    Example:
        >>> from descentflow.effects._example_flights import example_flights
        >>> state = example_flights(60)
        >>> noise = 0.03 * torch.randn(60, 11, generator=torch.Generator().manual_seed(0)).double()
        >>> seen = log_rate(state, mass=1.2) + noise
        >>> known = simulator_coefficients(state, seen, torch.arange(60))
        >>> apart = [float((log_rate(scaled(state, x)) - seen).mean()) for x in (torch.zeros(4), known.ln_factors)]
        >>> [round(x, 2) for x in apart]  # of ln rate, before and after: the equations may be off as well
        [0.07, -0.02]
    """
    known = SimulatorCoefficients.unknown(assumed)
    bands = torch.nonzero(log_rate_seen.isfinite().sum(0) >= 2)[:, 0]
    if not len(bands):
        return known
    rest = _by_aircraft((log_rate_seen - log_rate(state))[:, bands], airframe)
    there = rest.isfinite()
    weights = Precisions(_spread(rest), there.numpy())
    precision = torch.from_numpy(weights.precision)
    half = 0.5 * assumed.equation_spread**2
    missed = half * (torch.eye(len(bands), dtype=torch.float64) + 1.0)
    common = precision.sum(0) + torch.linalg.inv(missed)
    prior = torch.linalg.inv(known.covariance)
    ln_factors = known.ln_factors
    for _ in range(GAUSS_NEWTON_STEPS):
        columns = torch.where(there[:, :, None], _by_aircraft(_sensitivity(state, ln_factors)[:, bands], airframe), 0.0)
        apart = (log_rate_seen - log_rate(scaled(state, ln_factors)))[:, bands]
        rest = torch.where(there, _by_aircraft(apart, airframe), 0.0)
        products = precision @ columns
        cross, left = products.sum(0), (precision @ rest[:, :, None]).sum(0)
        within = torch.linalg.solve(common, torch.cat([cross, left], 1))
        information = torch.einsum("npj,npk->jk", columns, products) - cross.T @ within[:, :4] + prior
        gradient = torch.einsum("npj,np->j", products, rest) - cross.T @ within[:, 4] - prior @ ln_factors
        ln_factors = ln_factors + torch.linalg.solve(information, gradient)
    return SimulatorCoefficients(ln_factors, torch.linalg.inv(information))


def _by_aircraft(values: Tensor, airframe: Tensor) -> Tensor:
    """Means (a, K, ...) over the flights of each aircraft, NaN where none shows a band."""
    names, index = torch.unique(airframe, return_inverse=True)
    shape = (len(names), *values.shape[1:])
    seen = values.isfinite()
    total = torch.zeros(shape, dtype=values.dtype).index_add_(0, index, values.nan_to_num(0.0))
    count = torch.zeros(shape, dtype=values.dtype).index_add_(0, index, seen.to(values.dtype))
    return total / torch.where(count > 0, count, torch.nan)


def _spread(rest: Tensor) -> Array:
    """Covariance (K, K) between aircraft, their correlations shrunk."""
    centred = (rest - rest.nanmean(0)).nan_to_num(0.0)
    count = (rest.isfinite().sum(0) - 1).clamp(min=1).sqrt()
    return shrunk((centred / count).numpy()) + LEAST_SPREAD**2 * np.eye(rest.shape[1])


def _sensitivity(state: FlightState, ln_factors: Tensor) -> Tensor:
    """D ln rate / d psi (n, K, 4), by central differences."""
    steps = LOG_STEP * torch.eye(4, dtype=torch.float64)
    parts = [
        (log_rate(scaled(state, ln_factors + step)) - log_rate(scaled(state, ln_factors - step))) / (2 * LOG_STEP)
        for step in steps
    ]
    return torch.stack(parts, 2)
