"""Time that a model needs over the runs of real flights, at their own speeds and in the air that they measured.

A run is a stretch of at least 4,000 ft of one free descent without a gap. Its error is the model's time over its levels
over the flight's own, minus one.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
import polars as pl
import torch
from torch import Tensor

from descentflow.air.measured_air import measured_airs
from descentflow.aircraft_types.bada3.bada3_aircraft import Bada3Aircraft
from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft, open_type
from descentflow.core.errors import DataError
from descentflow.core.units import FL_M, KT_MPS
from descentflow.physics.airspeed import cas_to_mach, mach_to_tas_mps
from descentflow.physics.energy import descent_rate_mps, energy_share_factor_exact
from descentflow.physics.nominal_descent import nominal_descent
from descentflow.physics.performance_model import PerformanceModel

FEWEST_LEVELS = 41
HALF_WINDOW = 8
"""Levels on either side of the line that gives the CAS at a level: reports are whole knots, up to 30 s apart."""
SLOWEST_MPS = 0.5


@dataclass(frozen=True)
class Run:
    """One run: levels ascending, (L,) each.

    Attributes:
        source: Name of the place.
        typecode: Type of the aircraft.
        icao24: Its address.
        levels_fl: Flight levels.
        cas_mps: Smoothed CAS.
        deviation_k: Temperature deviation that the flight measured, or the mean of the others'.
        tailwind_mps: Wind along the track, likewise; zero where unknown.
        seconds: From its top to its bottom.
        rows: Levels of the prepared table, for models that need more.
    """

    source: str
    typecode: str
    icao24: str
    levels_fl: Tensor
    cas_mps: Tensor
    deviation_k: Tensor
    tailwind_mps: Tensor
    seconds: float
    rows: pl.DataFrame


@cache
def before(typecode: str) -> Bada3Aircraft:
    """An open type as it was before flights were used, by the facts of its file.

    Example:
        >>> before("A20N").cd0_cr, before("A20N").ct_des_low, before("A320") == open_aircraft("A320")
        (0.01568, 0.03, True)
    """
    read, now = open_type(typecode), open_aircraft(typecode)
    old: dict[str, Any] = {
        entry.name.removesuffix("_before"): float(entry.value)  # type: ignore[arg-type]  # facts of coefficients are numbers
        for entry in read.facts
        if entry.name.endswith("_before")
    }
    fitted = {entry.name for entry in read.coefficients if entry.confidence == "fitted"}
    old = {name: value for name, value in old.items() if name in fitted}
    if "ct_des_high" in fitted:
        high = old.setdefault("ct_des_high", float(open_aircraft("A320").ct_des_high))
        old["ct_des_low"] = round(high * float(now.ct_des_low) / float(now.ct_des_high), 4)
    return replace(now, **old)


def runs_of(frame: pl.DataFrame, source: str) -> list[Run]:
    """All runs of prepared descents of one place."""
    low, high = (int(end) for end in (frame["level_fl"].to_numpy().min(), frame["level_fl"].to_numpy().max()))
    levels = torch.arange(low, high + 1, dtype=torch.float64)
    deviation, tailwind = _airs(frame, levels)
    runs = []
    for flight in frame.sort("flight_id", "level_fl").partition_by("flight_id", maintain_order=True):
        level = flight["level_fl"].to_numpy().astype(float)
        for part in np.split(np.arange(len(level)), np.flatnonzero(np.diff(level) > 1) + 1):
            if len(part) < FEWEST_LEVELS:
                continue
            rows = flight[part.tolist()]
            own, at = torch.from_numpy(level[part]), (torch.from_numpy(level[part]) - low).long()
            name = flight["flight_id"][0]
            time = rows["time_s"].to_numpy()
            runs.append(
                Run(
                    source,
                    flight["typecode"][0],
                    flight["icao24"][0] or "",
                    own,
                    torch.from_numpy(_smoothed(level[part], rows["IAS"].to_numpy() * KT_MPS)),
                    deviation.get(name, deviation[""])[at],
                    tailwind.get(name, tailwind[""])[at],
                    float(time[0] - time[-1]),
                    rows,
                )
            )
    return runs


def _airs(frame: pl.DataFrame, levels: Tensor) -> tuple[dict[str, Tensor], dict[str, Tensor]]:
    """Deviation and tailwind by flight, and for others (empty name) the mean deviation without wind."""
    try:
        airs = measured_airs(frame, levels)
    except DataError:
        return {"": 0.0 * levels}, {"": 0.0 * levels}
    names = [*airs.flight_ids, ""]
    both = airs.air.deviation_k, airs.air.tailwind_mps
    others = both[0].mean(0), 0.0 * levels
    first, second = (
        dict(zip(names, [*values, other], strict=True)) for values, other in zip(both, others, strict=True)
    )
    return first, second


def _smoothed(level: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Lines through the values about each level."""
    smooth = np.empty(len(values))
    for i in range(len(values)):
        near = slice(max(0, i - HALF_WINDOW), i + HALF_WINDOW + 1)
        smooth[i] = np.polyval(np.polyfit(level[near], values[near], 1), level[i])
    return smooth


def own_speed_error(run: Run, aircraft: PerformanceModel) -> float:
    """Error of the time at the flight's own CAS, with the exact energy share in its own air."""
    altitude = run.levels_fl * FL_M
    share = energy_share_factor_exact(run.cas_mps, altitude, run.deviation_k, run.tailwind_mps)
    tas = mach_to_tas_mps(cas_to_mach(run.cas_mps, altitude), altitude, run.deviation_k)
    drag = aircraft.drag_n(tas, altitude, run.deviation_k)
    thrust = aircraft.idle_thrust_n(altitude, tas, run.deviation_k)
    rate = -descent_rate_mps(aircraft, drag, thrust, tas, share, altitude, run.deviation_k)
    return float(torch.trapezoid(1 / rate.clamp(min=SLOWEST_MPS), altitude)) / run.seconds - 1.0


def nominal_error(run: Run, aircraft: PerformanceModel) -> float:
    """Error of the time on the type's own schedule, in standard air."""
    return float(nominal_descent(aircraft, run.levels_fl).time_s[0]) / run.seconds - 1.0


def by_aircraft(errors: Sequence[float], tails: Sequence[str], draws: int = 2000) -> tuple[float, float, float]:
    """Median, and its 90 % interval by whole aircraft drawn anew."""
    values, names = np.array(errors), np.array(tails)
    parts = [values[names == name] for name in np.unique(names)]
    rng = np.random.default_rng(0)
    drawn = [
        np.median(np.concatenate([parts[i] for i in rng.integers(0, len(parts), len(parts))])) for _ in range(draws)
    ]
    low, high = np.quantile(drawn, [0.05, 0.95])
    return float(np.median(values)), float(low), float(high)


def table(runs: Sequence[Run], errors: dict[str, Sequence[float]]) -> list[list[str]]:
    """Rows by place and type: number of runs, then median error with its interval for each model."""
    rows = []
    for key in sorted({(run.source, run.typecode) for run in runs}):
        mine = [i for i, run in enumerate(runs) if (run.source, run.typecode) == key]
        tails = [runs[i].icao24 for i in mine]
        row = [*key, str(len(mine))]
        for values in errors.values():
            if np.isfinite(values[mine[0]]):
                interval = (100 * x for x in by_aircraft([values[i] for i in mine], tails))
                row.append("{:+.0f} ({:+.0f} to {:+.0f})".format(*interval))
            else:
                row.append("no such type")
        rows.append(row)
    return rows
