"""Fly sampled descents in BlueSky: every descent of the types takes one sample's rate and speed at every step.

Written by `descentflow export --to bluesky` for BlueSky 1.1; it reads the samples from the .json file of its own name.
Put both into BlueSky's plugin folder and load it: PLUGINS LOAD DESCENTFLOW. An aircraft flies a sample while it is
above the altitude that is selected for it and within the sample's levels. Which one depends on its callsign alone, or
is set by DFSAMPLE callsign number. SPD and VS are heard: see Descents.
"""

import json
import zlib
from pathlib import Path
from typing import Any

import bluesky
import numpy as np
from bluesky import core, stack, traf
from bluesky.tools.aero import mach2cas

FPM, KNOT, FEET = 0.3048 / 60, 0.514444, 0.3048
STEP_M = 1000 * FEET
SLOWEST_MPS = 0.1
"""BlueSky takes slower selected rates for none."""
FASTEST_MACH = 2.0
"""Selected speeds below are Mach numbers."""

SAMPLES: dict[str, list[dict[str, Any]]] = vars(bluesky).setdefault("descentflow_samples", {})
"""Type -> its samples, of every plugin of this kind; the one that was loaded first flies them all."""


def init_plugin() -> Any:
    """BlueSky calls this."""
    first = not SAMPLES
    fleet = json.loads(Path(__file__).with_suffix(".json").read_text(encoding="utf-8"))["fleet"]
    for twice in [name for one in fleet for name in one["types"] if name in SAMPLES]:
        stack.echo(f"DESCENTFLOW is not loaded: another plugin flies {twice}. Export all types into one.")
        raise ImportError(f"another plugin of descentflow flies {twice}")
    for one in fleet:
        samples = [ascending(sample) for sample in one["samples"]]
        SAMPLES.update((name, samples) for name in one["types"])
    config = {"plugin_name": "DESCENTFLOW", "plugin_type": "sim"}
    if not first:
        return config
    core.timed_function(Descents().fly, name="descentflow.fly", hook="preupdate")
    usage = "DFSAMPLE acid,number"
    commands = {"DFSAMPLE": [usage, "acid,int", Descents().choose, "Set the sample that a flight descends by"]}
    return config, commands


def ascending(sample: dict[str, list[float]]) -> dict[str, Any]:
    """Levels, rates and speeds of a sample in BlueSky's units, from the lowest level up."""
    return {
        "level_m": 100 * FEET * np.array(sample["level_fl"])[::-1],
        "rate": FPM * np.array(sample["vertical_rate"])[::-1],
        "cas": KNOT * np.array(sample["CAS"])[::-1],
        "steepest": -FPM * min(sample["vertical_rate"]),
    }


class Descents(core.Entity):  # type: ignore[misc]
    """What each flight descends by; BlueSky adds, removes and resets it with the aircraft.

    A speed that is commanded in a descent (SPD) is kept, and the rate becomes that of the sample whose speed at the
    flight's level is nearest. A rate that is commanded (VS, or ALT with one) is kept, and VS 0 gives it back.
    DFSAMPLE gives both back. A flight that has levelled off begins its next descent afresh, with the same sample.
    """

    def __init__(self) -> None:
        super().__init__()
        with self.settrafarrays():
            self.number = np.array([], dtype=int)  # of the sample, from 1; 0 while there is none
            self.set = np.array([], dtype=bool)  # by DFSAMPLE
            self.active = np.array([], dtype=bool)
            self.own_speed = np.array([], dtype=bool)  # commanded in this descent
            self.own_rate = np.array([], dtype=bool)
            self.final_m = np.array([])  # the altitude that was selected
            # What this plugin has selected: something else there is a command.
            self.altitude_m, self.rate, self.speed = np.array([]), np.array([]), np.array([])

    def choose(self, i: int, number: int) -> tuple[bool, str]:
        """The command DFSAMPLE: a sample of the user's choice, in place of commanded speeds and rates."""
        known = len(SAMPLES.get(traf.type[i], ()))
        if not 0 <= number < known:
            return False, f"{traf.type[i]} has {known} samples, numbered from 0"
        self.number[i], self.set[i] = number + 1, True
        self.own_speed[i] = self.own_rate[i] = False
        self.rate[i], self.speed[i] = traf.selvs[i], traf.selspd[i]
        return True, f"{traf.id[i]} descends by sample {number}"

    def fly(self) -> None:
        """Before every step of BlueSky, however long it is."""
        descending = traf.selalt < traf.alt - 1.0
        for i in np.flatnonzero(self.active & ~descending).tolist():
            self.end(i)
        for i in np.flatnonzero(descending).tolist():
            if traf.type[i] in SAMPLES:
                self.descend(i, SAMPLES[traf.type[i]])

    def descend(self, i: int, samples: list[dict[str, Any]]) -> None:
        """Begin or go on with a descent, unless the flight is above or below all samples."""
        if not self.active[i] and not self.begin(i, samples):
            return
        self.hear(i, samples)
        sample = samples[self.number[i] - 1]
        if traf.alt[i] < sample["level_m"][0]:
            self.end(i)
            return
        # 1.1.1 limits the speed as if the flight was at the selected altitude.
        traf.selalt[i] = self.altitude_m[i] = max(self.final_m[i], traf.alt[i] - STEP_M)
        # The rate of the middle of the step, not of its beginning.
        middle_m = traf.alt[i] + 0.5 * bluesky.sim.simdt * traf.vs[i]
        if not self.own_rate[i]:
            # BlueSky 1.1.1 holds descents to the type's largest rate of climb, and beyond it to twice that or to none
            # while the speed changes.
            traf.perf.vsmax[i] = max(traf.perf.vsmax[i], 1.01 * sample["steepest"])
            traf.selvs[i] = self.rate[i] = np.interp(middle_m, sample["level_m"], sample["rate"])
        if not self.own_speed[i]:
            traf.selspd[i] = self.speed[i] = np.interp(middle_m, sample["level_m"], sample["cas"])

    def begin(self, i: int, samples: list[dict[str, Any]]) -> bool:
        """Choose a sample among those from the flight's level or above, and say whether there is one."""
        among = [k for k, sample in enumerate(samples) if within(sample, traf.alt[i])]
        if self.number[i] - 1 not in among:
            if self.set[i] or not among:
                return False
            self.number[i] = 1 + among[zlib.crc32(traf.id[i].encode()) % len(among)]
        self.active[i], self.own_speed[i] = True, False
        self.own_rate[i] = traf.selvs[i] < -SLOWEST_MPS
        self.final_m[i] = self.altitude_m[i] = traf.selalt[i]
        self.rate[i], self.speed[i] = traf.selvs[i], traf.selspd[i]
        return True

    def hear(self, i: int, samples: list[dict[str, Any]]) -> None:
        """Take up what was commanded since the last step."""
        if traf.selalt[i] != self.altitude_m[i]:
            self.final_m[i] = traf.selalt[i]
        if traf.selvs[i] != self.rate[i]:
            self.own_rate[i], self.rate[i] = abs(traf.selvs[i]) > SLOWEST_MPS, traf.selvs[i]
        if traf.selspd[i] != self.speed[i]:
            self.own_speed[i], self.speed[i] = True, traf.selspd[i]
            said = traf.selspd[i]
            cas = mach2cas(said, traf.alt[i]) if said < FASTEST_MACH else said
            among = [k for k, sample in enumerate(samples) if within(sample, traf.alt[i])]
            nearest = min(
                among, key=lambda k: abs(np.interp(traf.alt[i], samples[k]["level_m"], samples[k]["cas"]) - cas)
            )
            self.number[i], self.set[i] = 1 + nearest, False

    def end(self, i: int) -> None:
        """Give the flight back to BlueSky, with the altitude that was selected."""
        if traf.selalt[i] == self.altitude_m[i]:
            traf.selalt[i] = self.final_m[i]
        if not self.own_rate[i]:
            traf.selvs[i] = 0.0
        self.active[i] = False


def within(sample: dict[str, Any], altitude_m: float) -> bool:
    """Whether an altitude is one of the sample's; a flight that holds a level may be some feet off."""
    return bool(sample["level_m"][0] <= altitude_m <= sample["level_m"][-1] + 10 * FEET)
