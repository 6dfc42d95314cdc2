"""Coefficients of types by their flights: the mixed model about the energy equation, which is nearly linear in them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Protocol, Self

import numpy as np
import polars as pl
import torch

from descentflow.core.errors import DataError
from descentflow.core.linear_gaussian import Array
from descentflow.core.tensors import Number
from descentflow.diagnosis.inference.flight_effects import FlightShapes, differing
from descentflow.diagnosis.inference.moments import moments
from descentflow.diagnosis.inference.signatures import Signatures
from descentflow.diagnosis.sides.two_sides import compare
from descentflow.effects import EFFECTS
from descentflow.physics.performance_model import PerformanceModel
from descentflow.repairs.flight_evidence import FlightEvidence, flight_evidence
from descentflow.repairs.mixed_model import Flights, MixedModelPosterior, fit, joined

GAUSS_NEWTON_STEPS = 3
"""Gauss-Newton steps: ln rate is close to linear in these parameters."""
LARGE_SHIFT = 0.03
"""Of mean ln rate in a band by brakes, from which the band is left out: what is missed of them would pass for drag.
Where brakes are out in most bands, what is found of them is taken out instead."""
LEAST_IDLE = -3.0
"""Idle thrust relative to the file's, minus one: below, engines would brake more than they idle."""


FAMILIES = (
    ("A318", "A319", "A320", "A321", "A19N", "A20N", "A21N"),
    ("B736", "B737", "B738", "B739", "B37M", "B38M", "B39M", "B3XM"),
    ("E170", "E75S", "E75L"),
    ("E190", "E195", "E290", "E295"),
    ("A332", "A333", "A338", "A339"),
    ("A343", "A345", "A346"),
    ("A359", "A35K"),
    ("B762", "B763", "B764"),
    ("B772", "B773", "B77L", "B77W"),
    ("B788", "B789", "B78X"),
    ("AT43", "AT45", "AT72", "AT75", "AT76"),
)
"""Types whose files are likely to be wrong alike: of one family, or of one generation of engines."""
NEW_ENGINES = (
    ("A19N", "A20N", "A21N", "B37M", "B38M", "B39M", "B3XM", "E290", "E295"),
    ("A338", "A339", "A359", "A35K", "B788", "B789", "B78X", "BCS1", "BCS3"),
)
"""Turbofans with a bypass ratio of nine and more."""


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
    evidence: FlightEvidence
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

    def linear(self, theta: Array, kind: int, groups: np.ndarray) -> Flights:
        """Flights that are linear about coefficients (3,) of their type, which has this number in groups of types."""
        value, by_theta, by_mass = self.evidence.columns(theta)
        y = self.log_rate - value + by_theta @ theta
        seen = np.isfinite(y)
        y, x = np.where(seen, y, 0.0), np.where(seen[:, :, None], by_theta, 0.0)
        kinds, altitude_m = np.full(len(y), kind), self.evidence.state.altitude_m.numpy()
        return Flights(y, x, np.where(seen, by_mass, 0.0), seen, kinds, self.tails, altitude_m, groups)


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


def unusual_shifts(evidence: FlightEvidence, aircraft: PerformanceModel) -> tuple[Array, dict[str, float]]:
    """Expected shift (n, K) of ln rate by what each flight does of its own, and the share of the flights by effect.

    Flights are compared with the equations of the aircraft, each in its own shape about the mean of all, so a drag that
    all flights have at all levels is no brake. Where no band has ten flights, they are taken as they are.

    Args:
        evidence: Flights of one type.
        aircraft: Coefficients.

    Example:
        >>> from descentflow.aircraft_types.registry import aircraft
        >>> evidence = flight_evidence(pl.read_parquet("descents.parquet"), aircraft("A320"))
        >>> shifts, shares = unusual_shifts(evidence, aircraft("A320"))
        >>> shifts.shape, shares
        ((120, 11), {})
    """
    shifts = np.zeros(evidence.log_rate.shape)
    log_rate = evidence.quantities.physics["log_rate"]
    physics = {**evidence.quantities.physics, "log_rate": torch.where(evidence.seen, log_rate, torch.nan)}
    try:
        compared = compare(None, replace(evidence.quantities, physics=physics), aircraft)
    except DataError:
        return shifts, {}
    if "rate" not in compared.quantities():
        return shifts, {}
    known = moments(compared)
    shapes = FlightShapes(compared, known, differing(EFFECTS))
    names = [one.name for one in shapes.candidates(Signatures(compared, known))]
    if names:
        shifts[np.ix_(shapes.real.index, shapes.rates.bands)] = shapes.shifts_by_flight(names)
    shares = shapes.fit(shapes.real, tuple(names)).shares if names else {}
    return shifts, {name: float(share) for name, share in shares.items()}


def codes_of(types: Sequence[TypeFlights]) -> list[str]:
    """Designators of the types, each once; the flights of a type may be in several parts, of a place each."""
    return list(dict.fromkeys(one.aircraft.typecode for one in types))


def groups_of(typecodes: Sequence[str]) -> np.ndarray:
    """Groups (3, T): all types alike, those of a family, and those of a generation of engines; none for one type alone.

    Example:
        >>> groups_of(["A320", "A20N", "B738"]).tolist()
        [[0, 0, 0], [0, 0, 1], [0, 1, 0]]
        >>> groups_of(["A320"]).shape
        (0, 1)
    """
    if len(typecodes) == 1:
        return np.zeros((0, 1), dtype=int)
    # A type of no family is one of its own.
    names = [next((family[0] for family in FAMILIES if code in family), code) for code in typecodes]
    family = [names.index(name) for name in names]
    renumbered = [sorted(set(family)).index(number) for number in family]
    return np.array(
        [[0] * len(typecodes), renumbered, [int(any(code in some for some in NEW_ENGINES)) for code in typecodes]]
    )


def linearised(types: Sequence[TypeFlights], theta: Array) -> Flights:
    """All flights about coefficients (T, 3), with aircraft of different parts apart."""
    codes = codes_of(types)
    groups, kinds = groups_of(codes), [codes.index(one.aircraft.typecode) for one in types]
    return joined([one.linear(theta[kind], kind, groups) for one, kind in zip(types, kinds, strict=True)], groups)


def fit_types(types: Sequence[TypeFlights]) -> MixedModelPosterior:
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
    for _ in range(GAUSS_NEWTON_STEPS):
        posterior = fit(linearised(types, theta))
        theta = posterior.mean.copy()
        theta[:, 2] = np.maximum(theta[:, 2], LEAST_IDLE)
    return posterior
