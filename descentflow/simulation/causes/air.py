"""Air that differs from the simulator's: temperature and wind."""

from collections.abc import Mapping

import numpy as np

from descentflow.core.units import FT_M, KT_MPS
from descentflow.simulation.causes.cause import Cause, Fleet, sign
from descentflow.simulation.parameters import FlightParameters

KT_PER_KFT = KT_MPS / (1000 * FT_M)
"""1 kt in 1,000 ft, in 1/s."""


def _temperature(generator: np.random.Generator, size: float) -> dict[str, float]:
    return {"mean_k": 10.0 * size * sign(generator), "spread_k": 4.0 * size}


def _warm(fleet: Fleet, values: Mapping[str, float]) -> FlightParameters:
    change = values["mean_k"] + values["spread_k"] * fleet.normal[:, 0]
    return fleet.with_parameters(deviation_k=fleet.parameters.deviation_k + change)


def _wind(generator: np.random.Generator, size: float) -> dict[str, float]:
    return {"mean_kt_per_kft": 2.0 * size * sign(generator), "spread_kt_per_kft": 0.7 * size}


def _blow(fleet: Fleet, values: Mapping[str, float]) -> FlightParameters:
    slope = values["mean_kt_per_kft"] + values["spread_kt_per_kft"] * fleet.normal[:, 0]
    return fleet.with_parameters(wind_slope_per_s=fleet.parameters.wind_slope_per_s + KT_PER_KFT * slope)


TEMPERATURE = Cause("temperature", {"mean_k": "K", "spread_k": "K"}, _temperature, _warm, ("TAS",))
"""Deviation from ISA at all heights, of each flight its own: mean 10 K at full size."""

WIND_GRADIENT = Cause(
    "wind_gradient",
    {"mean_kt_per_kft": "kt/1000 ft", "spread_kt_per_kft": "kt/1000 ft"},
    _wind,
    _blow,
    ("TAS", "groundspeed"),
)
"""Growth of the tailwind with height, of each flight its own: mean 2 kt/1,000 ft at full size."""
