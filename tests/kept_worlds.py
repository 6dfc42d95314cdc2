"""Flights of worlds that were flown before, for tests of what is done with them: many take the same few worlds.

What flies them has tests of its own, which fly each time (``tests/unit/test_simulation_*.py``). A flight is the same in
every world that has its seed and number, and to fly many takes little longer than to fly a few: a seed is flown once,
and a test gets the first flights of it. Worlds are known by all that they are flown by, to the bit.
"""

from collections.abc import Callable
from pathlib import Path

import polars as pl
import pytest
from kept_by_workers import digest, once

from descentflow.physics.performance_model import PerformanceModel
from descentflow.simulation import world
from descentflow.simulation.parameters import FlightParameters, draw_parameters
from descentflow.simulation.world_config import WorldConfig

WHOLE = range(320)
Tables = tuple[pl.DataFrame, pl.DataFrame, pl.DataFrame]
Change = Callable[[FlightParameters], FlightParameters]


def keep_worlds(patch: pytest.MonkeyPatch, folder: Path) -> None:
    """Let flights of equal parameters be flown once in a session."""
    fly_and_observe = world._chunk

    def kept(aircraft: PerformanceModel, numbers: range, seed: int, config: WorldConfig, change: Change) -> Tables:
        if numbers.start or numbers.stop > WHOLE.stop:
            return fly_and_observe(aircraft, numbers, seed, config, change)
        name = digest(aircraft, change(draw_parameters(aircraft, WHOLE, seed, config)), config, seed)
        rows, flights, truth = once(folder, name, lambda: fly_and_observe(aircraft, WHOLE, seed, config, change))
        asked = pl.col("flight_id").is_in(flights["flight_id"].head(len(numbers)).implode())
        return rows.filter(asked), flights.filter(asked), truth.filter(asked)

    patch.setattr(world, "_chunk", kept)
