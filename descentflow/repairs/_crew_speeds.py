"""The speeds that crews hold, as the file's descent schedule has them: Mach number, CAS above and below 10,000 ft."""

from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from descentflow.core.linear_gaussian import Array
from descentflow.core.units import FT_M, KT_MPS
from descentflow.effects.flight_state import CHANGING, NEAR_MACH, constant_mach_slope
from descentflow.repairs.flight_evidence import FlightEvidence
from descentflow.repairs.mixed_model import Z_90

SPREADS = {"des_mach": 0.03, "des_cas_high_kt": 20.0, "des_cas_low_kt": 20.0}
"""Prior standard deviation of a fleet's mean speed about the file's: operators differ by as much."""
LOW_M = 10_000 * FT_M
"""The schedule's lower speed holds below."""
FEWEST_AIRCRAFT = 3


@dataclass(frozen=True)
class CrewSpeed:
    """Estimate of one speed with its 90 % interval, in the unit of the coefficient.

    Example:
        >>> CrewSpeed(0.78, 0.77, 0.79, 12).aircraft
        12
    """

    estimate: float
    low: float
    high: float
    aircraft: int


def crew_speeds(evidence: FlightEvidence, prior: dict[str, float]) -> dict[str, CrewSpeed]:
    """Mean speeds of the aircraft, drawn towards the file's by as much as they are uncertain.

    Args:
        evidence: Flights of one type.
        prior: The file's speeds, by the name of the coefficient.

    Returns:
        By the name of the coefficient; a speed that fewer than three aircraft show is left out.

    Example:
        >>> import polars as pl
        >>> from descentflow.aircraft_types.registry import aircraft
        >>> from descentflow.repairs.flight_evidence import flight_evidence
        >>> evidence = flight_evidence(pl.read_parquet("descents.parquet"), aircraft("A320"))
        >>> round(crew_speeds(evidence, {"des_mach": 0.77})["des_mach"].estimate, 2)
        0.77
    """
    held = _held(evidence)
    return {name: speed for name in prior if (speed := _pooled(held[name], evidence, prior[name], SPREADS[name]))}


def _held(evidence: FlightEvidence) -> dict[str, Tensor]:
    """Speeds (n, K) in the bands where each is held, NaN elsewhere."""
    state, nan = evidence.state, torch.nan
    mach, cas_kt = state.mach(), state.cas_mps / KT_MPS
    ratio = state.cas_slope_per_s / constant_mach_slope(mach, state.altitude_m)
    fastest = torch.where(state.mask, mach, 0.0).amax(1, keepdim=True)
    low = state.altitude_m < LOW_M
    at_cas = state.mask & (ratio.abs() < CHANGING)
    return {
        "des_mach": torch.where(state.mask & (ratio > 1 - CHANGING) & (mach > fastest - NEAR_MACH), mach, nan),
        "des_cas_high_kt": torch.where(at_cas & ~low, cas_kt, nan),
        "des_cas_low_kt": torch.where(at_cas & low, cas_kt, nan),
    }


def _pooled(held: Tensor, evidence: FlightEvidence, prior: float, spread: float) -> CrewSpeed | None:
    by_flight: Array = held.nanmean(1).numpy()
    shown = np.isfinite(by_flight)
    tails = evidence.quantities.airframe.numpy()
    means = np.array([by_flight[shown & (tails == tail)].mean() for tail in np.unique(tails[shown])])
    if len(means) < FEWEST_AIRCRAFT:
        return None
    error = means.std(ddof=1) / np.sqrt(len(means))
    weight = spread**2 / (spread**2 + error**2)
    estimate, half = prior + weight * (means.mean() - prior), Z_90 * np.sqrt(weight) * error
    return CrewSpeed(float(estimate), float(estimate - half), float(estimate + half), len(means))
