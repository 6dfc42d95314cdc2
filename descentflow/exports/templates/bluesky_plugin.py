"""Fly sampled descents in BlueSky: every descent of the type takes one sample's rate and speed at every step.

Written by `descentflow export --to bluesky` for BlueSky 1.1; it reads the samples from the .json file of its own name.
Put both into BlueSky's plugin folder and load it: PLUGINS LOAD DESCENTFLOW. An aircraft flies a sample while it is
above the altitude that is selected for it and within the sample's levels; which one depends on its callsign alone, or
is set by DFSAMPLE callsign number.
"""

import json
import zlib
from pathlib import Path
from typing import Any

import numpy as np
from bluesky import traf

FPM, KNOT, FEET = 0.3048 / 60, 0.514444, 0.3048
LEAD_S = 0.25
"""Half of a step of 0.5 s: the rate of the middle of the step, not of its beginning."""

DATA = json.loads(Path(__file__).with_suffix(".json").read_text(encoding="utf-8"))
SAMPLES = [
    {
        "level_ft": 100.0 * np.array(one["level_fl"])[::-1],
        "rate": np.array(one["vertical_rate"])[::-1] * FPM,
        "cas": np.array(one["CAS"])[::-1] * KNOT,
        "steepest": -min(one["vertical_rate"]) * FPM,
    }
    for one in DATA["samples"]
]
CHOSEN: dict[str, int] = {}
STEP_M = 1000 * FEET
STEPPED: dict[str, tuple[float, float]] = {}
"""Callsign -> the altitude (m) that was selected for it, and the one that stands in its place for now."""


def init_plugin() -> Any:
    """BlueSky calls this."""
    config = {"plugin_name": "DESCENTFLOW", "plugin_type": "sim", "update_interval": 0.0, "preupdate": fly}
    commands = {"DFSAMPLE": ["DFSAMPLE acid,number", "acid,int", choose, "Set the sample that a flight descends by"]}
    return config, commands


def choose(index: int, number: int) -> tuple[bool, str]:
    """The command DFSAMPLE."""
    if not 0 <= number < len(SAMPLES):
        return False, f"samples are numbered 0 to {len(SAMPLES) - 1}"
    CHOSEN[traf.id[index]] = number
    return True, f"{traf.id[index]} descends by sample {number}"


def fly() -> None:
    """Before every step: rate and CAS of each descending flight's sample at its level."""
    for i in np.flatnonzero(traf.selalt < traf.alt - 1.0):
        if traf.type[i] != DATA["typecode"]:
            continue
        callsign = traf.id[i]
        sample = SAMPLES[CHOSEN.get(callsign, zlib.crc32(callsign.encode()) % len(SAMPLES))]
        feet = (traf.alt[i] + LEAD_S * traf.vs[i]) / FEET
        if feet < sample["level_ft"][0]:
            if callsign in STEPPED:
                traf.selalt[i], traf.selvs[i] = STEPPED.pop(callsign)[0], 0.0
            continue
        traf.selalt[i] = stepped(callsign, traf.selalt[i], traf.alt[i])
        # BlueSky 1.1.1 holds descents to the type's largest rate of climb, and beyond it to twice that or to none while
        # the speed changes.
        traf.perf.vsmax[i] = max(traf.perf.vsmax[i], 1.01 * sample["steepest"])
        traf.selvs[i] = np.interp(feet, sample["level_ft"], sample["rate"])
        traf.selspd[i] = np.interp(feet, sample["level_ft"], sample["cas"])


def stepped(callsign: str, selected_m: float, altitude_m: float) -> float:
    """The selected altitude, or one 1,000 ft below the flight: 1.1.1 limits the speed as if the flight was there."""
    final_m, standing_m = STEPPED.get(callsign, (selected_m, selected_m))
    if selected_m != standing_m:
        final_m = selected_m
    now_m = max(final_m, altitude_m - STEP_M)
    STEPPED[callsign] = final_m, now_m
    return now_m
