"""Descents by a table of rates and speeds, as simulators without a performance model fly them.

Tables are JSON: a profile `{"aircraft": {"MEDIUM": {"flight_level": [0, 100, ...], "cas_des": [kt], "mach_des": [...],
"rocd_des": ft/min, positive, one or one a level}}}`, a mapping `{"A320": "MEDIUM"}`, and spreads
`{"aircraft": {"MEDIUM": {"rocd_des": {"norm_mean": , "sigma": , "minimum": , "maximum": }}}}`.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from scipy import stats

from descentflow.core.errors import DataError
from descentflow.core.units import FL_M, KT_MPS
from descentflow.physics.airspeed import cas_to_mach, mach_to_cas_mps, mach_to_tas_mps
from flying.flight_plans import FlightPlan

Array = NDArray[np.float64]

KEYS = ("cas_des", "mach_des", "rocd_des")
SLOWEST_FPM = 500.0
"""Drawn rates are no slower."""
STEP_S = 1.0


@dataclass(frozen=True)
class DescentTable:
    """Speeds and rates of one class by flight level; linear between the levels, held outside."""

    levels_fl: Array
    cas_kt: Array
    mach: Array
    """NaN where the class flies by CAS alone."""
    rate_fpm: Array
    """Positive."""

    def at(self, name: str, level_fl: Array) -> Array:
        """`cas_kt`, `mach` or `rate_fpm` at levels."""
        return np.interp(level_fl, self.levels_fl, getattr(self, name))


def read_tables(profile: Path) -> dict[str, DescentTable]:
    """Tables by class.

    Raises:
        DataError: If the file is no such table.
    """
    try:
        return {name: _table(one) for name, one in json.loads(profile.read_text())["aircraft"].items()}
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise DataError(
            f"{profile}: {error!r}", expected='{"aircraft": {class: {"flight_level", ...}}}', mend="name another file"
        ) from error


def _table(one: Mapping[str, Any]) -> DescentTable:
    levels = np.array(one["flight_level"], dtype=float)
    if (np.diff(levels) <= 0).any():
        raise ValueError("flight_level does not grow")
    cas, mach, rate = (
        np.broadcast_to(np.array(one[key], dtype=float), levels.shape) for key in KEYS
    )  # null becomes NaN
    if not ((cas > 0).all() and (rate > 0).all()):
        raise ValueError("a speed or rate that is not above zero")
    return DescentTable(levels, cas, mach, rate)


def drawn(
    table: DescentTable, spreads: Mapping[str, Mapping[str, float]], generator: np.random.Generator
) -> DescentTable:
    """The table as one flight flies it: each column moved by a draw from its truncated normal, minus the mean of it."""
    moved = {}
    for key, name in zip(KEYS, ("cas_kt", "mach", "rate_fpm"), strict=True):
        values = getattr(table, name)
        if key in spreads and np.isfinite(values).all():
            law = spreads[key]
            ends = [(law[end] - law["norm_mean"]) / law["sigma"] for end in ("minimum", "maximum")]
            change = law["sigma"] * stats.truncnorm.ppf(generator.random(), *ends)
            values = values + change
        moved[name] = np.maximum(values, SLOWEST_FPM) if key == "rocd_des" else values
    return replace(table, **moved)


def fly(table: DescentTable, plan: FlightPlan) -> dict[str, Array]:
    """States a second apart from the plan's highest to its lowest level, in still standard air, heading east.

    The rate is the table's, CAS and Mach number the lower of the table's two; TAS follows by the equations of this
    package.
    """
    levels = [plan.top_fl]
    while levels[-1] > plan.bottom_fl:
        levels.append(levels[-1] - float(table.at("rate_fpm", np.array(levels[-1]))) * STEP_S / 6000.0)
    level = np.array(levels)
    height = torch.from_numpy(level * FL_M)
    cas_mach = cas_to_mach(torch.from_numpy(table.at("cas_kt", level) * KT_MPS), height).numpy()
    mach = np.fmin(table.at("mach", level), cas_mach)
    tas = mach_to_tas_mps(torch.from_numpy(mach), height).numpy() / KT_MPS
    time = STEP_S * np.arange(len(level))
    east_deg = np.concatenate([[0.0], np.cumsum(tas[:-1] * STEP_S / 3600.0 / 60.0)])
    return {
        "time_s": time,
        "altitude": level * 100.0,
        "IAS": mach_to_cas_mps(torch.from_numpy(mach), height).numpy() / KT_MPS,
        "Mach": mach,
        "TAS": tas,
        "groundspeed": tas,
        "vertical_rate": -table.at("rate_fpm", level),
        "track": np.full_like(level, 90.0),
        "heading": np.full_like(level, 90.0),
        "geoaltitude": level * 100.0,
        "latitude": np.zeros_like(level),
        "longitude": east_deg,
    }
