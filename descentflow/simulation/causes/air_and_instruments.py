"""Air that differs from the simulator's, and instruments that report other than what is flown."""

import numpy as np
import torch

from descentflow.core.units import FT_M, KT_MPS
from descentflow.simulation.cause_values import Values
from descentflow.simulation.causes.cause import Cause, Fleet, Own, normal, sign
from descentflow.simulation.parameters import FlightParameters

KT_PER_KFT = KT_MPS / (1000 * FT_M)
"""1 kt in 1,000 ft, in 1/s."""


def _temperature(generator: np.random.Generator, size: float) -> dict[str, float]:
    return {"deviation_k": 10.0 * size * sign(generator), "spread_k": 4.0 * size}


def _days(generator: np.random.Generator, size: float) -> dict[str, float]:
    return {"spread_k": 1.0 * size, "daily_spread_k": generator.uniform(2.0, 5.0) * size}


def _warm(fleet: Fleet, v: Values) -> tuple[FlightParameters, Own]:
    own = v["deviation_k"] + v["spread_k"] * fleet.normal[:, 0] + v["daily_spread_k"] * normal(fleet.daily[:, 0])
    return fleet.with_parameters(deviation_k=fleet.parameters.deviation_k + own), {"deviation_k": own}


def _wind(generator: np.random.Generator, size: float) -> dict[str, float]:
    return {"slope_kt_per_kft": 2.0 * size * sign(generator), "spread_kt_per_kft": 0.7 * size}


def _windy_days(generator: np.random.Generator, size: float) -> dict[str, float]:
    return {"spread_kt_per_kft": 0.3 * size, "daily_spread_kt_per_kft": generator.uniform(0.4, 0.9) * size}


def _blow(fleet: Fleet, v: Values) -> tuple[FlightParameters, Own]:
    daily = v["daily_spread_kt_per_kft"] * normal(fleet.daily[:, 0])
    own = v["slope_kt_per_kft"] + v["spread_kt_per_kft"] * fleet.normal[:, 0] + daily
    slope = fleet.parameters.wind_slope_per_s + KT_PER_KFT * own
    return fleet.with_parameters(wind_slope_per_s=slope), {"slope_kt_per_kft": own}


TEMPERATURE = Cause("temperature", _temperature, _warm, stream=0, vary=_days, channels=("TAS",))
"""Mean 10 K at full size; the deviation of each flight its own, or of each day its own."""

WIND_GRADIENT = Cause("wind_gradient", _wind, _blow, stream=1, vary=_windy_days, channels=("TAS", "groundspeed"))
"""Mean 2 kt/1,000 ft at full size; the growth of each flight its own, or of each day its own."""


def _bias(generator: np.random.Generator, size: float) -> dict[str, float]:
    side = sign(generator)
    return {"bias_kt": 2.0 * size * side, "slope_kt_per_mach": 25.0 * size * side}


def _own_bias(generator: np.random.Generator, size: float) -> dict[str, float]:
    return {"spread_kt": generator.uniform(0.5, 1.0) * size}


def _misread(fleet: Fleet, v: Values) -> tuple[FlightParameters, Own]:
    bias = v["bias_kt"] + v["spread_kt"] * normal(fleet.airframe[:, 0])
    slope = v["slope_kt_per_mach"] * torch.ones_like(bias)
    changed = fleet.with_injected(cas_bias_mps=bias * KT_MPS, cas_bias_slope_mps=slope * KT_MPS)
    return changed, {"bias_kt": bias, "slope_kt_per_mach": slope}


def _lag(generator: np.random.Generator, size: float) -> dict[str, float]:
    return {"lag_s": 12.0 * size}


def _own_lag(generator: np.random.Generator, size: float) -> dict[str, float]:
    return {"spread_s": 3.0 * size}


def _delay(fleet: Fleet, v: Values) -> tuple[FlightParameters, Own]:
    lag = (v["lag_s"] + v["spread_s"] * normal(fleet.airframe[:, 0])).clamp(min=0.0)
    return fleet.with_injected(rate_lag_s=lag), {"lag_s": lag}


def _noise(generator: np.random.Generator, size: float) -> dict[str, float]:
    return {"factor": 1 + 2.0 * size}


def _scatter(fleet: Fleet, v: Values) -> tuple[FlightParameters, Own]:
    own = v["factor"] * torch.ones_like(fleet.parameters.mass_kg)
    return fleet.with_injected(noise_factor=own), {"factor": own}


AIRSPEED_BIAS = Cause("airspeed_bias", _bias, _misread, stream=10, vary=_own_bias)
"""IAS off by 2 kt at M 0.6 and by 7 kt at M 0.8 at full size."""
VERTICAL_RATE_LAG = Cause("vertical_rate_lag", _lag, _delay, stream=11, vary=_own_lag)
"""12 s more in the time constant of the reported rate at full size."""
MEASUREMENT_NOISE = Cause("measurement_noise", _noise, _scatter, stream=12)
"""Three times the standard deviation of every reported field at full size."""
