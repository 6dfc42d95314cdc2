"""Coefficients of types by their flights: the mixed model about the energy equation, which is nearly linear in them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Protocol, Self

import numpy as np
import polars as pl

from descentflow.core.tensors import Number
from descentflow.diagnosis.inference.linear_gaussian import Array
from descentflow.physics.performance_model import PerformanceModel
from descentflow.repairs.flight_evidence import Evidence, flight_evidence
from descentflow.repairs.mixed_model import Flights, Posterior, fit, stacked
from descentflow.repairs.sisters import groups_of
from descentflow.repairs.unusual_flights import unusual_shifts

ROUNDS = 3
"""Gauss-Newton steps: ln rate is close to linear in these parameters."""
LARGE_SHIFT = 0.03
"""Of mean ln rate in a band by brakes, from which the band is left out: what is missed of them would pass for drag.
Where brakes are out in most bands, what is found of them is taken out instead."""
LEAST_IDLE = -3.0
"""Idle thrust relative to the file's, minus one: below, engines would brake more than they idle."""


class Repairable(PerformanceModel, Protocol):
    """A performance model whose files have numbers that are repaired."""

    @property
    def engine(self) -> str:
        """Kind of engines."""

    @property
    def des_cas_low_kt(self) -> Number:
        """CAS of the descent below 10,000 ft."""

    def repaired_numbers(self) -> Mapping[str, tuple[str, float]]:
        """Numbers by name: the factor that changes each, and its value in the file."""

    def with_numbers(self, **numbers: float) -> Self:
        """The aircraft with other numbers of these, and other speeds."""


@dataclass(frozen=True)
class TypeFlights:
    """Flights of one type, with the coefficients that are to be repaired.

    Attributes:
        aircraft: Coefficients before.
        evidence: Its flights.
        shifts: (n, K) of ln rate by brakes and held paths of single flights; NaN in bands left out for them.
        unusual: Share of the flights with each of these.

    Example:
        >>> from descentflow.aircraft_types.registry import aircraft
        >>> flights = type_flights(pl.read_parquet("descents.parquet"), aircraft("A320"))
        >>> len(flights.evidence), flights.unusual
        (120, {})
    """

    aircraft: Repairable
    evidence: Evidence
    shifts: Array
    unusual: Mapping[str, float]

    @property
    def log_rate(self) -> Array:
        """Ln of the rate (n, K) without brakes and held paths; NaN where not seen."""
        return np.asarray(self.evidence.log_rate.numpy()) - self.shifts

    @property
    def tails(self) -> np.ndarray:
        """(n,) numbers of the aircraft."""
        return np.asarray(self.evidence.quantities.airframe.numpy())

    def rows(self, index: np.ndarray) -> "TypeFlights":
        """Some of the flights."""
        return replace(self, evidence=self.evidence.rows(index), shifts=self.shifts[index])

    def linear(self, theta: Array) -> tuple[Array, Array, Array, np.ndarray, np.ndarray, Array]:
        """Arrays for :func:`~descentflow.repairs.mixed_model.stacked`, linear about coefficients (3,)."""
        value, by_theta, by_mass = self.evidence.columns(theta)
        y = self.log_rate - value + by_theta @ theta
        seen = np.isfinite(y)
        return np.where(seen, y, 0.0), by_theta, by_mass, seen, self.tails, self.evidence.state.altitude_m.numpy()


def type_flights(frame: pl.DataFrame, aircraft: Repairable, around: pl.DataFrame | None = None) -> TypeFlights:
    """Measure the flights of one type, brakes and held paths of single flights apart.

    Args:
        frame: Prepared descents of the type.
        aircraft: Coefficients.
        around: Descents of all types there, see :func:`~descentflow.repairs.flight_evidence.flight_evidence`.

    Raises:
        DataError: If no flight shows a whole band.

    Example:
        >>> from descentflow.aircraft_types.registry import aircraft
        >>> type_flights(pl.read_parquet("descents.parquet"), aircraft("A320")).log_rate.shape
        (120, 11)
    """
    evidence = flight_evidence(frame, aircraft, around)
    shifts, shares = unusual_shifts(evidence, aircraft)
    crowded = shifts.mean(0) > LARGE_SHIFT
    if crowded.any() and crowded.sum() <= len(crowded) / 2:
        shifts[:, crowded] = np.nan
    return TypeFlights(aircraft, evidence, shifts, shares)


def codes_of(types: Sequence[TypeFlights]) -> list[str]:
    """Designators of the types, each once; the flights of a type may be in several parts, of a place each."""
    return list(dict.fromkeys(one.aircraft.typecode for one in types))


def linearised(types: Sequence[TypeFlights], theta: Array) -> Flights:
    """All flights about coefficients (T, 3), with aircraft of different parts apart."""
    codes, parts, first = codes_of(types), [], 0
    for one in types:
        y, x, by_mass, seen, tails, altitude = one.linear(theta[codes.index(one.aircraft.typecode)])
        parts.append((y, x, by_mass, seen, tails + first, altitude))
        first += int(tails.max()) + 1
    kinds = [codes.index(one.aircraft.typecode) for one in types]
    return stacked(parts, kinds, groups_of(codes))


def fit_types(types: Sequence[TypeFlights]) -> Posterior:
    """Ln CD0, ln CD2 and relative idle thrust of each type, over the file's, at the reference mass.

    Args:
        types: Flights by type; sisters share a prior that is learnt.

    Example:
        >>> from descentflow.aircraft_types.registry import aircraft
        >>> flights = type_flights(pl.read_parquet("descents.parquet"), aircraft("A320"))
        >>> fit_types([flights]).mean.shape
        (1, 3)
    """
    theta = np.zeros((len(codes_of(types)), 3))
    for _ in range(ROUNDS):
        found = fit(linearised(types, theta))
        theta = found.mean.copy()
        theta[:, 2] = np.maximum(theta[:, 2], LEAST_IDLE)
    return found
