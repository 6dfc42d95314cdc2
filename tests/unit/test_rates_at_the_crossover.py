"""Rates of flights beyond the polar's at the crossover from Mach number to CAS."""

from dataclasses import replace

import numpy as np
import torch

from descentflow.aircraft_types.registry import aircraft
from descentflow.effects.flight_state import FlightState
from descentflow.measurements.quantities import quantities_of
from descentflow.simulation.world import simulate
from descentflow.simulation.world_config import Operator, WorldConfig
from descentflow.surveillance.prepare import prepare


def test_one_trajectory_flies_the_polars_rate_on_both_sides_of_its_crossover() -> None:
    """Its flights all cross over in one band, and what each loses of its height there does not average out."""
    still = {"level_off_share": 0.0, "managed_share": 0.0, "thrust_spread": 0.0, "cd0_spread": 0.0, "mach_spread": 0.0}
    quiet = replace(WorldConfig(), **still, cas_spread_kt=0.0, wander_kt=0.0, rate_smoothing_s=0.0)
    one = replace(quiet, operators=(Operator("ONE", 1.0, 289.0, 0.797),), mass_range=(0.875, 0.875))
    frame = prepare(simulate("B738", 40, 3, one)).frame
    found = quantities_of(frame, 150, 360, ["IAS", "Mach", "vertical_rate"])
    physics = found.physics
    cas = physics["cas_mps"]
    middles = (150 + (torch.arange(cas.shape[1], dtype=torch.float64) + 0.5) * found.band_fl) * 30.48
    mass_kg = 0.875 * 66_349
    state = FlightState(
        aircraft("B738"),
        mass_kg,
        middles,
        found.band_fl * 30.48,
        cas,
        physics["cas_slope_per_s"],
        torch.zeros_like(cas),
        cas.isfinite(),
        physics["depth_m"],
    )
    beyond = np.nanmean((physics["log_rate"] - state.own_log_rate).numpy(), 0)
    # A step of the energy share is 0.3; a line through more than a band leaves 0.06 of it.
    assert np.abs(np.diff(beyond)[4:13]).max() < 0.03
