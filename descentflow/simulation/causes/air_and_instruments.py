"""Air that differs from the simulator's, and instruments that report other than what is flown."""

import torch

from descentflow.core.units import FT_M, KT_MPS
from descentflow.simulation.causes.cause import Fleet, Own, normal
from descentflow.simulation.parameters import FlightParameters
from descentflow.simulation.plantable import Values

KT_PER_KFT = KT_MPS / (1000 * FT_M)
"""1 kt in 1,000 ft, in 1/s."""


def warm(fleet: Fleet, v: Values) -> tuple[FlightParameters, Own]:
    """Warm the air, by flight and by day."""
    own = v["deviation_k"] + v["spread_k"] * fleet.normal[:, 0] + v["daily_spread_k"] * normal(fleet.daily[:, 0])
    return fleet.with_parameters(deviation_k=fleet.parameters.deviation_k + own), {"deviation_k": own}


def blow(fleet: Fleet, v: Values) -> tuple[FlightParameters, Own]:
    """Let wind grow with height, by flight and by day."""
    daily = v["daily_spread_kt_per_kft"] * normal(fleet.daily[:, 0])
    own = v["slope_kt_per_kft"] + v["spread_kt_per_kft"] * fleet.normal[:, 0] + daily
    slope = fleet.parameters.wind_slope_per_s + KT_PER_KFT * own
    return fleet.with_parameters(wind_slope_per_s=slope), {"slope_kt_per_kft": own}


def misread(fleet: Fleet, v: Values) -> tuple[FlightParameters, Own]:
    """Bias the reported IAS, by airframe."""
    bias = v["bias_kt"] + v["spread_kt"] * normal(fleet.airframe[:, 0])
    slope = v["slope_kt_per_mach"] * torch.ones_like(bias)
    changed = fleet.with_injected(cas_bias_mps=bias * KT_MPS, cas_bias_slope_mps=slope * KT_MPS)
    return changed, {"bias_kt": bias, "slope_kt_per_mach": slope}


def delay(fleet: Fleet, v: Values) -> tuple[FlightParameters, Own]:
    """Lag the reported rate, by airframe."""
    lag = (v["lag_s"] + v["spread_s"] * normal(fleet.airframe[:, 0])).clamp(min=0.0)
    return fleet.with_injected(rate_lag_s=lag), {"lag_s": lag}


def scatter(fleet: Fleet, v: Values) -> tuple[FlightParameters, Own]:
    """Multiply the noise of every reported field."""
    own = v["factor"] * torch.ones_like(fleet.parameters.mass_kg)
    return fleet.with_injected(noise_factor=own), {"factor": own}
