"""Values that a study plants of each cause, for a size (1 is the full one), and the differences between flights."""

import math
from collections.abc import Callable, Mapping

import numpy as np

Draw = Callable[[np.random.Generator, float], dict[str, float]]
"""Draws values of a cause for a size."""


def sign(generator: np.random.Generator) -> float:
    """Plus or minus one.

    Example:
        >>> sorted({sign(np.random.default_rng(seed)) for seed in range(9)})
        [-1.0, 1.0]
    """
    return float(generator.choice([-1.0, 1.0]))


def _factor(full: float) -> Draw:
    return lambda generator, size: {"factor": 1 + full * size * sign(generator)}


def _by_flight(spread: float) -> Callable[[np.random.Generator, float], dict[str, float]]:
    """Of a factor that each flight has of its own, or a share of the flights alone."""

    def vary(generator: np.random.Generator, size: float) -> dict[str, float]:
        return {"spread": spread * size, "share": float(generator.choice([1.0, generator.uniform(0.5, 0.9)]))}

    return vary


def _brake(generator: np.random.Generator, size: float) -> dict[str, float]:
    high = generator.uniform(230, 300)
    low = high - generator.uniform(40, 60)
    return {"factor": 1 + 0.6 * size, "share": generator.uniform(0.4, 0.8), "low_fl": low, "high_fl": high}


def _own_brakes(generator: np.random.Generator, size: float) -> dict[str, float]:
    return {"spread_fl": generator.uniform(10.0, 40.0), "depth_spread": 0.2, "strength_spread": 0.2}


def _wave(generator: np.random.Generator, size: float) -> dict[str, float]:
    return {"gain": 0.2 * size}


def _kept(generator: np.random.Generator, size: float) -> dict[str, float]:
    return {"share": 0.4 * size, "decay_s": generator.uniform(120, 180)}


def _own_keeping(generator: np.random.Generator, size: float) -> dict[str, float]:
    return {"share_range": 0.1 * size, "decay_range_s": 60.0, "of_flights": generator.uniform(0.7, 1.0)}


def _bank(generator: np.random.Generator, size: float) -> dict[str, float]:
    # The square of the load factor, on which drag depends, grows with the size: a bank of 30 degrees is its full size.
    bank = math.acos((1 + size / 3) ** -0.5)
    return {"bank_deg": math.degrees(bank), "share": generator.uniform(0.7, 0.9), "depth_fl": generator.uniform(30, 50)}


def _ice(generator: np.random.Generator, size: float) -> dict[str, float]:
    high = generator.uniform(230, 290)
    return {
        "share": generator.uniform(0.5, 0.9),
        "drag_share": 0.4 * size,
        "low_fl": high - generator.uniform(40, 60),
        "high_fl": high,
        "spread_fl": generator.uniform(5.0, 25.0),
    }


def _powered(generator: np.random.Generator, size: float) -> dict[str, float]:
    return {"share": 0.18 * size, "share_range": 0.06 * size}


def _temperature(generator: np.random.Generator, size: float) -> dict[str, float]:
    return {"deviation_k": 10.0 * size * sign(generator), "spread_k": 4.0 * size}


def _days(generator: np.random.Generator, size: float) -> dict[str, float]:
    return {"spread_k": 1.0 * size, "daily_spread_k": generator.uniform(2.0, 5.0) * size}


def _wind(generator: np.random.Generator, size: float) -> dict[str, float]:
    return {"slope_kt_per_kft": 2.0 * size * sign(generator), "spread_kt_per_kft": 0.7 * size}


def _windy_days(generator: np.random.Generator, size: float) -> dict[str, float]:
    return {"spread_kt_per_kft": 0.3 * size, "daily_spread_kt_per_kft": generator.uniform(0.4, 0.9) * size}


def _bias(generator: np.random.Generator, size: float) -> dict[str, float]:
    side = sign(generator)
    return {"bias_kt": 2.0 * size * side, "slope_kt_per_mach": 25.0 * size * side}


def _own_bias(generator: np.random.Generator, size: float) -> dict[str, float]:
    return {"spread_kt": generator.uniform(0.5, 1.0) * size}


def _lag(generator: np.random.Generator, size: float) -> dict[str, float]:
    return {"lag_s": 12.0 * size}


def _own_lag(generator: np.random.Generator, size: float) -> dict[str, float]:
    return {"spread_s": 3.0 * size}


def _noise(generator: np.random.Generator, size: float) -> dict[str, float]:
    return {"factor": 1 + 2.0 * size}


def _path(generator: np.random.Generator, size: float) -> dict[str, float]:
    return {"share": 0.8 * size, "of_idle": generator.uniform(0.85, 0.95)}


def _own_paths(generator: np.random.Generator, size: float) -> dict[str, float]:
    return {"of_idle": 0.885, "of_idle_range": generator.uniform(0.05, 0.09)}


def _rate(generator: np.random.Generator, size: float) -> dict[str, float]:
    return {"share": 0.8 * size, "of_idle": generator.uniform(0.8, 0.95), "depth_fl": generator.uniform(70, 110)}


def _own_rates(generator: np.random.Generator, size: float) -> dict[str, float]:
    return {"of_idle": 0.86, "of_idle_range": generator.uniform(0.06, 0.1), "depth_range_fl": 30.0}


def _levels(generator: np.random.Generator, size: float) -> dict[str, float]:
    return {"share": 0.6 * size, "duration_s": generator.uniform(60, 150)}


def _own_durations(generator: np.random.Generator, size: float) -> dict[str, float]:
    return {"duration_range_s": 45.0}


def _speeds(generator: np.random.Generator, size: float) -> dict[str, float]:
    side = sign(generator)
    return {"cas_kt": 20.0 * size * side, "mach": 0.02 * size * side}


def _some_crews(generator: np.random.Generator, size: float) -> dict[str, float]:
    return {"spread_kt": 3.0 * size, "share": generator.uniform(0.6, 0.95)}


DRAWN: Mapping[str, tuple[Draw, Draw | None]] = {
    "temperature": (_temperature, _days),
    "wind_gradient": (_wind, _windy_days),
    "mass": (_factor(0.1), _by_flight(0.05)),
    # Only a twentieth of the open A320's retarding force is idle thrust.
    "idle_thrust": (_factor(0.8), _by_flight(0.3)),
    "drag_polar": (_factor(0.1), _by_flight(0.04)),
    "speed_brake": (_brake, _own_brakes),
    "turn": (_bank, None),
    "geometric_path": (_path, _own_paths),
    "vertical_speed_mode": (_rate, _own_rates),
    "level_off": (_levels, _own_durations),
    "speed_schedule": (_speeds, _some_crews),
    "airspeed_bias": (_bias, _own_bias),
    "vertical_rate_lag": (_lag, _own_lag),
    "measurement_noise": (_noise, None),
    "compressibility": (_wave, None),
    "kept_thrust": (_kept, _own_keeping),
    "anti_ice": (_ice, None),
    "induced_drag": (_factor(0.1), None),
    "powered_descent": (_powered, None),
}
"""Cause -> what is alike in all flights that have it, and how flights differ; None for a cause that all have alike."""
OUTSIDE = ("compressibility", "kept_thrust", "anti_ice")
"""Causes that a diagnosis should call unknown."""
BETWEEN = ("induced_drag", "powered_descent")
"""Causes that come so near to one of the catalogue that either answer is right: a polar of the wrong shape is nearly
another mass, and thrust all the way down nearly less drag."""
CATALOGUED = tuple(name for name in DRAWN if name not in (*OUTSIDE, *BETWEEN))
"""Causes that a diagnosis should name, if channels show them."""
