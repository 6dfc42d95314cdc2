"""Instruments that report other than what is flown."""

from collections.abc import Mapping

import numpy as np

from descentflow.core.units import KT_MPS
from descentflow.simulation.causes.cause import Cause, Fleet, sign
from descentflow.simulation.parameters import FlightParameters


def _bias(generator: np.random.Generator, size: float) -> dict[str, float]:
    side = sign(generator)
    return {"bias_kt": 2.0 * size * side, "slope_kt_per_mach": 25.0 * size * side}


def _misread(fleet: Fleet, values: Mapping[str, float]) -> FlightParameters:
    bias, slope = values["bias_kt"] * KT_MPS, values["slope_kt_per_mach"] * KT_MPS
    return fleet.with_injected(cas_bias_mps=bias, cas_bias_slope_mps=slope)


def _lag(generator: np.random.Generator, size: float) -> dict[str, float]:
    return {"lag_s": 12.0 * size}


def _delay(fleet: Fleet, values: Mapping[str, float]) -> FlightParameters:
    return fleet.with_injected(rate_lag_s=values["lag_s"])


def _noise(generator: np.random.Generator, size: float) -> dict[str, float]:
    return {"factor": 1 + 2.0 * size}


def _scatter(fleet: Fleet, values: Mapping[str, float]) -> FlightParameters:
    return fleet.with_injected(noise_factor=values["factor"])


AIRSPEED_BIAS = Cause("airspeed_bias", {"bias_kt": "kt", "slope_kt_per_mach": "kt"}, _bias, _misread)
"""IAS off by 2 kt at M 0.6 and by 7 kt at M 0.8 at full size."""
VERTICAL_RATE_LAG = Cause("vertical_rate_lag", {"lag_s": "s"}, _lag, _delay)
"""12 s more in the time constant of the reported rate at full size."""
MEASUREMENT_NOISE = Cause("measurement_noise", {"factor": "1"}, _noise, _scatter)
"""Three times the standard deviation of every reported field at full size."""
