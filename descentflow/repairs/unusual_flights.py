"""Brakes and held paths of single flights, found as the diagnosis finds them, so that no coefficient absorbs them."""

from dataclasses import replace

import numpy as np
import torch

from descentflow.core.errors import DataError
from descentflow.diagnosis.inference.flight_effects import FlightShapes, differing
from descentflow.diagnosis.inference.linear_gaussian import Array
from descentflow.diagnosis.inference.moments import moments
from descentflow.diagnosis.inference.signatures import Signatures
from descentflow.diagnosis.inference.two_sides import compare
from descentflow.effects import EFFECTS
from descentflow.physics.performance_model import PerformanceModel
from descentflow.repairs.flight_evidence import Evidence


def unusual_shifts(evidence: Evidence, aircraft: PerformanceModel) -> tuple[Array, dict[str, float]]:
    """Expected shift (n, K) of ln rate by what each flight does of its own, and the share of the flights by effect.

    Flights are compared with the equations of the aircraft, each in its own shape about the mean of all, so a drag that
    all flights have at all levels is no brake. Where no band has ten flights, they are taken as they are.

    Args:
        evidence: Flights of one type.
        aircraft: Coefficients.

    Example:
        >>> import polars as pl
        >>> from descentflow.aircraft_types.registry import aircraft
        >>> from descentflow.repairs.flight_evidence import flight_evidence
        >>> found = flight_evidence(pl.read_parquet("descents.parquet"), aircraft("A320"))
        >>> shifts, shares = unusual_shifts(found, aircraft("A320"))
        >>> shifts.shape, shares
        ((120, 11), {})
    """
    found = np.zeros(evidence.log_rate.shape)
    log_rate = evidence.quantities.physics["log_rate"]
    physics = {**evidence.quantities.physics, "log_rate": torch.where(evidence.seen, log_rate, torch.nan)}
    try:
        compared = compare(None, replace(evidence.quantities, physics=physics), aircraft)
    except DataError:
        return found, {}
    if "rate" not in compared.quantities():
        return found, {}
    known = moments(compared)
    shapes = FlightShapes(compared, known, differing(EFFECTS))
    names = [one.name for one in shapes.candidates(Signatures(compared, known))]
    if names:
        found[np.ix_(shapes.real.index, shapes.rates.bands)] = shapes.shifts_by_flight(names)
    shares = shapes.fit(shapes.real, tuple(names)).shares if names else {}
    return found, {name: float(share) for name, share in shares.items()}
