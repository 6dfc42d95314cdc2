"""Fly sampled descents in bluebird-dt 0.4: one sample for each flight, the same one for the same random seed.

Written by `descentflow export --to bluebird`; it reads the samples from the .json file of its own name. This file is
MIT; bluebird-dt, which it imports, is AGPL-3.0, and so is whatever you pass on that has both.
"""

import json
import zlib
from pathlib import Path
from typing import Any

import numpy as np
from bluebird_dt.core import Aircraft, FlightState
from bluebird_dt.predictor.linear_predictor import LinearPredictor
from bluebird_dt.utility.convert import KT_TO_MPS, cas_to_tas

CHOSEN = "descentflow_sample"
"""Key of a flight's sample and of the speeds instructed then: bluebird copies it along with every prediction."""
FLOWN = ("level_fl", "vertical_rate", "CAS")
NEAREST = 50
"""One in so many samples is near to an instructed speed, and one at least."""


class SampledDescents(LinearPredictor):  # type: ignore[misc]
    """Descents of the types by samples; all else, and what a controller instructs, as LinearPredictor flies it.

    A flight at an instructed speed descends at the rates of a sample among the nearest in speed at its level.
    """

    def __init__(self, *positional: Any, **settings: Any) -> None:
        super().__init__(*positional, **settings)
        data = json.loads(Path(__file__).with_suffix(".json").read_text(encoding="utf-8"))
        self.samples: dict[str, list[Any]] = {}
        for part in data["fleet"]:
            ascending = [[np.array(sample[name], dtype=float)[::-1] for name in FLOWN] for sample in part["samples"]]
            self.samples.update((name, ascending) for name in part["types"])

    def sample_of(self, aircraft: Aircraft) -> Any:
        """The flight's sample while it descends within the sample's levels; empty otherwise."""
        samples = self.samples.get(aircraft.aircraft_type, [])
        if aircraft.flight_state is not FlightState.DESCEND or not samples:
            return []
        instructed = aircraft.selected_instructions.cas, aircraft.selected_instructions.mach
        before, number = aircraft.predictor_params.get(CHOSEN, ((), 0))
        if before != instructed or samples[number][0][-1] < aircraft.fl:
            among = [i for i, sample in enumerate(samples) if sample[0][-1] >= aircraft.fl]
            if not among:
                return []
            if any(instructed):
                among = self.nearest(aircraft, samples, among)
            number = among[drawn(aircraft, len(among))]
            aircraft.predictor_params[CHOSEN] = instructed, number
        return samples[number] if aircraft.fl > samples[number][0][0] else []

    def nearest(self, aircraft: Aircraft, samples: list[Any], among: list[int]) -> list[int]:
        """Samples whose speed at the flight's level is nearest to the flight's, which a controller instructed."""

        def off_mps(number: int) -> float:
            cas_mps = KT_TO_MPS * np.interp(aircraft.fl, samples[number][0], samples[number][2])
            return float(abs(cas_to_tas(aircraft.fl, cas_mps, self.delta_T) - KT_TO_MPS * aircraft.speed_tas))

        return sorted(among, key=off_mps)[: len(among) // NEAREST + 1]

    def update_vertical_speeds(self, aircraft: Aircraft) -> None:
        """Rate of descent (ft/min, negative): the instructed one, or the sample's."""
        sample = self.sample_of(aircraft) if aircraft.selected_instructions.vertical_speed is None else []
        if not sample:
            super().update_vertical_speeds(aircraft)
        else:
            aircraft.vertical_speed = float(np.interp(aircraft.fl, sample[0], sample[1]))

    def get_aircraft_cas_mach_speeds(self, aircraft: Aircraft) -> tuple[float, float | None]:
        """CAS (kt) and Mach number as instructed, or the sample's CAS at every level."""
        said = aircraft.selected_instructions
        sample = self.sample_of(aircraft) if said.cas is None and said.mach is None else []
        if not sample:
            speeds: tuple[float, float | None] = super().get_aircraft_cas_mach_speeds(aircraft)
            return speeds
        return float(np.interp(aircraft.fl, sample[0], sample[2])), None


def drawn(aircraft: Aircraft, n: int) -> int:
    """A number below n, the same for the same random seed, or callsign of a flight without one."""
    seed = zlib.crc32(str(aircraft.callsign).encode()) if aircraft.random_seed is None else aircraft.random_seed
    return int(np.random.default_rng(seed).integers(n))
