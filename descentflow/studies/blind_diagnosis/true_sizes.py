"""What was injected in the units in which a diagnosis reports it, where the two mean the same thing."""

import math
from collections.abc import Callable, Mapping
from typing import Final

from descentflow.simulation.causes.air import KT_PER_KFT
from descentflow.simulation.injected import REFERENCE_MACH
from descentflow.simulation.observe import QUANTA
from descentflow.simulation.world_config import WorldConfig

Values = Mapping[str, float]
_BIAS_MACH: Final = 0.65
"""Mach number at which a diagnosis states the constant part of a bias."""


def _relative(values: Values) -> dict[str, float]:
    return {"relative_change": values["factor"] - 1}


def _brake(values: Values) -> dict[str, float]:
    # A diagnosis reports the mean over all flights, those without brakes included.
    extra = values["share"] * (values["factor"] - 1)
    window = {"low_fl": values["low_fl"], "high_fl": values["high_fl"]}
    return {"extra_cd0": extra, **window, "share": values["share"]}


def _bias(values: Values) -> dict[str, float]:
    slope = values["slope_kt_per_mach"]
    return {"bias_kt": values["bias_kt"] + slope * (_BIAS_MACH - REFERENCE_MACH), "growth_kt": 0.1 * slope}


def _noise(values: Values) -> dict[str, float]:
    config = WorldConfig()
    # Not of the rate: what a descent itself does within a few seconds is as large as the noise of its report.
    own = {"cas": config.cas_noise_kt, "mach": config.mach_noise, "tas": config.tas_noise_kt}
    quanta = {"cas": QUANTA["IAS"], "mach": QUANTA["Mach"], "tas": QUANTA["TAS"]}
    found = {}
    for name, noise in own.items():
        # Rounding adds a twelfth of its step squared to both variances.
        rounding = quanta[name] ** 2 / 12
        ratio = ((values["factor"] * noise) ** 2 + rounding) / (noise**2 + rounding)
        found[f"ln_ratio_{name}"] = 0.5 * math.log(ratio)
    return found


REPORTED: dict[str, Callable[[Values], dict[str, float]]] = {
    "temperature": lambda v: {"deviation_k": v["deviation_k"]},
    "wind_gradient": lambda v: {"slope_per_s": KT_PER_KFT * v["slope_kt_per_kft"]},
    "mass": _relative,
    "idle_thrust": _relative,
    "drag_polar": _relative,
    "speed_brake": _brake,
    "speed_schedule": lambda v: {"cas_kt": v["cas_kt"], "mach": v["mach"]},
    "airspeed_bias": _bias,
    "vertical_rate_lag": lambda v: {"lag_s": v["lag_s"]},
    "measurement_noise": _noise,
}
"""By cause; held paths and rates and level-offs are missing, for their sizes are shares of flights that hold them,
and a diagnosis reports what cleaning leaves of them."""


def reported(cause: str, values: Values) -> dict[str, float]:
    """Sizes that a diagnosis should report for an injected cause; empty where they are not comparable.

    Example:
        >>> reported("mass", {"factor": 0.9})
        {'relative_change': -0.09999999999999998}
    """
    return REPORTED[cause](values) if cause in REPORTED else {}
