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

CHOSEN = "descentflow_sample"
"""Where a flight keeps the number of its sample: bluebird copies it along with every prediction."""
FLOWN = ("level_fl", "vertical_rate", "CAS")


class SampledDescents(LinearPredictor):  # type: ignore[misc]
    """Free descents of the types by samples; all else, and what a controller commands, as LinearPredictor flies it."""

    def __init__(self, *positional: Any, **settings: Any) -> None:
        super().__init__(*positional, **settings)
        data = json.loads(Path(__file__).with_suffix(".json").read_text(encoding="utf-8"))
        self.samples: dict[str, list[Any]] = {}
        for one in data["fleet"]:
            ascending = [[np.array(sample[name], dtype=float)[::-1] for name in FLOWN] for sample in one["samples"]]
            self.samples.update((name, ascending) for name in one["types"])

    def sample_of(self, aircraft: Aircraft) -> Any:
        """The flight's sample while it descends freely within the sample's levels; None otherwise."""
        said, samples = aircraft.selected_instructions, self.samples.get(aircraft.aircraft_type)
        free = said.vertical_speed is None and said.cas is None and said.mach is None
        if not free or aircraft.flight_state is not FlightState.DESCEND or samples is None:
            return None
        if CHOSEN not in aircraft.predictor_params:
            own = zlib.crc32(str(aircraft.callsign).encode()) if aircraft.random_seed is None else aircraft.random_seed
            among = [i for i, sample in enumerate(samples) if sample[0][-1] >= aircraft.fl]
            if not among:
                return None
            aircraft.predictor_params[CHOSEN] = among[int(np.random.default_rng(own).integers(len(among)))]
        sample = samples[aircraft.predictor_params[CHOSEN]]
        return sample if aircraft.fl > sample[0][0] else None

    def update_vertical_speeds(self, aircraft: Aircraft) -> None:
        """Rate of descent (ft/min, negative) by the sample."""
        sample = self.sample_of(aircraft)
        if sample is None:
            super().update_vertical_speeds(aircraft)
        else:
            aircraft.vertical_speed = float(np.interp(aircraft.fl, sample[0], sample[1]))

    def get_aircraft_cas_mach_speeds(self, aircraft: Aircraft) -> tuple[float, float | None]:
        """CAS (kt) by the sample, at every level."""
        sample = self.sample_of(aircraft)
        if sample is None:
            found: tuple[float, float | None] = super().get_aircraft_cas_mach_speeds(aircraft)
            return found
        return float(np.interp(aircraft.fl, sample[0], sample[2])), None
