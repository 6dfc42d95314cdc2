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
STEP_M, SLACK_M = 1000 * FEET, 10 * FEET
SLOWEST_MPS = 0.1
"""BlueSky takes slower selected rates for none."""
FASTEST_MACH = 2.0
"""Selected speeds below are Mach numbers."""
NEAREST = 50
"""One in so many samples is near to a commanded speed, and one at least."""


class Samples:
    """The samples of a model in BlueSky's units."""

    def __init__(self, samples: list[dict[str, list[float]]]) -> None:
        self.level_m = [100 * FEET * np.array(sample["level_fl"])[::-1] for sample in samples]
        self.rates = [FPM * np.array(sample["vertical_rate"])[::-1] for sample in samples]
        self.speeds = [KNOT * np.array(sample["CAS"])[::-1] for sample in samples]
        self.lowest_m, self.highest_m = (np.array([level_m[k] for level_m in self.level_m]) for k in (0, -1))

    def __len__(self) -> int:
        return len(self.level_m)

    def rate(self, k: int, altitude_m: float) -> float:
        """Rate (m/s, negative) of a sample."""
        return float(np.interp(altitude_m, self.level_m[k], self.rates[k]))

    def cas(self, k: int, altitude_m: float) -> float:
        """CAS (m/s) of a sample."""
        return float(np.interp(altitude_m, self.level_m[k], self.speeds[k]))

    def within(self, altitude_m: float) -> list[int]:
        """Samples that have an altitude; a flight that holds a level may be some feet above it."""
        inside = (self.lowest_m <= altitude_m) & (altitude_m <= self.highest_m + SLACK_M)
        return [int(k) for k in np.flatnonzero(inside)]


FLOWN: dict[str, Samples] = vars(bluesky).setdefault("descentflow_samples", {})
"""Type -> its samples, of every plugin of this kind; the one that was loaded first flies them all."""


def init_plugin() -> Any:
    """BlueSky calls this."""
    first = not FLOWN
    fleet = json.loads(Path(__file__).with_suffix(".json").read_text(encoding="utf-8"))["fleet"]
    for twice in [name for part in fleet for name in part["types"] if name in FLOWN]:
        stack.echo(f"DESCENTFLOW is not loaded: another plugin flies {twice}. Export all types into one.")
        raise ImportError(f"another plugin of descentflow flies {twice}")
    for part in fleet:
        samples = Samples(part["samples"])
        FLOWN.update((name, samples) for name in part["types"])
    config = {"plugin_name": "DESCENTFLOW", "plugin_type": "sim"}
    if not first:
        return config
    core.timed_function(Descents().fly, name="descentflow.fly", hook="preupdate")
    usage = "DFSAMPLE acid,number"
    commands = {"DFSAMPLE": [usage, "acid,int", Descents().choose, "Set the sample that a flight descends by"]}
    return config, commands


class Descents(core.Entity):  # type: ignore[misc]
    """Sample of each flight's descent; BlueSky adds, removes and resets it with the aircraft.

    A speed that is commanded in a descent (SPD) is kept, and the rate becomes that of a sample among the nearest in
    speed at the flight's level. A rate that is commanded (VS, or ALT with one) is kept, and VS 0 gives it back.
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
        known = len(FLOWN.get(traf.type[i], ()))
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
            self.own_rate[i] = False
            self.end(i)
        for i in np.flatnonzero(descending).tolist():
            if traf.type[i] in FLOWN:
                self.descend(i, FLOWN[traf.type[i]])

    def descend(self, i: int, samples: Samples) -> None:
        """Begin or go on with a descent, unless the flight is above or below all samples."""
        if not self.active[i] and not self.begin(i, samples):
            return
        self.hear(i, samples)
        k = self.number[i] - 1
        if traf.alt[i] < samples.lowest_m[k]:
            self.end(i)
            return
        # 1.1.1 limits the speed as if the flight was at the selected altitude.
        traf.selalt[i] = self.altitude_m[i] = max(self.final_m[i], traf.alt[i] - STEP_M)
        # The rate of the middle of the step, not of its beginning.
        middle_m = traf.alt[i] + 0.5 * bluesky.sim.simdt * traf.vs[i]
        if not self.own_rate[i]:
            # BlueSky 1.1.1 holds descents to the type's largest rate of climb, and beyond it to twice that or to none
            # while the speed changes.
            traf.perf.vsmax[i] = max(traf.perf.vsmax[i], -1.01 * samples.rates[k].min())
            traf.selvs[i] = self.rate[i] = samples.rate(k, middle_m)
        if not self.own_speed[i]:
            traf.selspd[i] = self.speed[i] = samples.cas(k, middle_m)

    def begin(self, i: int, samples: Samples) -> bool:
        """Choose a sample among those from the flight's level or above, and say whether there is one."""
        among = samples.within(traf.alt[i])
        if self.number[i] - 1 not in among:
            if self.set[i] or not among:
                return False
            self.number[i] = 1 + picked(among, traf.id[i])
        self.active[i], self.own_speed[i] = True, False
        self.own_rate[i] = traf.selvs[i] < -SLOWEST_MPS
        self.final_m[i] = self.altitude_m[i] = traf.selalt[i]
        self.rate[i], self.speed[i] = traf.selvs[i], traf.selspd[i]
        return True

    def hear(self, i: int, samples: Samples) -> None:
        """Take up what was commanded since the last step."""
        if traf.selalt[i] != self.altitude_m[i]:
            self.final_m[i] = traf.selalt[i]
        if traf.selvs[i] != self.rate[i]:
            self.own_rate[i], self.rate[i] = abs(traf.selvs[i]) > SLOWEST_MPS, traf.selvs[i]
        if traf.selspd[i] != self.speed[i]:
            self.own_speed[i], self.speed[i] = True, traf.selspd[i]
            said, altitude_m = traf.selspd[i], traf.alt[i]
            cas = mach2cas(said, altitude_m) if said < FASTEST_MACH else said
            among = samples.within(altitude_m) or [self.number[i] - 1]
            nearest = sorted(among, key=lambda k: abs(samples.cas(k, altitude_m) - cas))
            self.number[i], self.set[i] = 1 + picked(nearest[: len(among) // NEAREST + 1], traf.id[i]), False

    def end(self, i: int) -> None:
        """Give the flight back to BlueSky, with the altitude that was selected."""
        if traf.selalt[i] == self.altitude_m[i]:
            traf.selalt[i] = self.final_m[i]
        if traf.selvs[i] == self.rate[i] and not self.own_rate[i]:
            traf.selvs[i] = 0.0
        self.active[i] = False


def picked(among: list[int], callsign: str) -> int:
    """One of some samples, by callsign."""
    return among[zlib.crc32(callsign.encode()) % len(among)]
