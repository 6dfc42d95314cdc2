"""Radar reports of flights whose state is known every second: sampled, quantised as Mode S is."""

from collections.abc import Mapping, Sequence
from datetime import timedelta
from itertools import accumulate, cycle

import numpy as np
import polars as pl
from numpy.typing import NDArray

from descentflow.core.mode_s_steps import STEPS
from descentflow.simulation.world_config import WorldConfig
from flying.flight_plans import FlightPlan

Array = NDArray[np.float64]
State = Mapping[str, Array]
"""By column of the rows, and `time_s`; one value a second or so."""


NOISE = {
    "altitude": WorldConfig.altitude_noise_ft,
    "vertical_rate": WorldConfig.rate_noise_fpm,
    "IAS": WorldConfig.cas_noise_kt,
    "Mach": WorldConfig.mach_noise,
    "TAS": WorldConfig.tas_noise_kt,
}
"""Standard deviations of the simulated world's instruments, in the channels' units."""


def reports(plan: FlightPlan, state: State, number: int = 0, noise: float = 0.0) -> pl.DataFrame:
    """Rows of one flight that `descentflow prepare` reads.

    Args:
        plan: Whose intervals and channels it reports with.
        state: What was flown.
        number: Flown so many days after the plan's flight, so that flights of one aircraft stay apart.
        noise: Instruments as noisy as those of the simulated world, times this.
    """
    last = float(state["time_s"][-1])
    due = _due_s(plan.intervals_s, last)
    fields = {}
    generator = np.random.default_rng([number, *plan.flight_id.encode()])
    for name in ("altitude", "IAS", *plan.channels):
        if name in state:
            values = _interpolated(due, state["time_s"], state[name], turns=name in ("track", "heading"))
            values = values + noise * NOISE.get(name, 0.0) * generator.standard_normal(len(due))
            fields[name] = np.rint(values / STEPS[name]) * STEPS[name]
    start = plan.start.replace(tzinfo=None) + timedelta(days=number)
    stamps = [start + timedelta(seconds=float(second)) for second in due]
    place = {name: np.interp(due, state["time_s"], state[name]) for name in ("latitude", "longitude") if name in state}
    return pl.DataFrame(
        {
            "timestamp": pl.Series(stamps, dtype=pl.Datetime("us")).dt.replace_time_zone("UTC"),
            "icao24": [plan.icao24] * len(due),
            "typecode": [plan.typecode] * len(due),
            **fields,
            **place,
        }
    )


def table(parts: Sequence[pl.DataFrame]) -> pl.DataFrame:
    """Rows of all flights, in order of time; channels that a flight lacks are missing."""
    return pl.concat(parts, how="diagonal").sort("icao24", "timestamp")


def _due_s(intervals_s: Sequence[float], last_s: float) -> Array:
    """Times of reports, the intervals over and over."""
    due = [0.0]
    for second in accumulate(cycle(intervals_s)):
        if second > last_s:
            return np.array(due)
        due.append(second)
    return np.array(due)


def _interpolated(at: Array, time_s: Array, values: Array, turns: bool) -> Array:
    if not turns:
        return np.interp(at, time_s, values)
    return np.degrees(np.interp(at, time_s, np.unwrap(np.radians(values)))) % 360
