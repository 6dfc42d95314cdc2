"""Flights of worlds that were flown before, for tests of what is done with them: many take the same few worlds.

What flies them has tests of its own, which fly each time (``tests/unit/test_simulation_*.py``); flights are identified
by everything that they are flown by, to the bit.
"""

from pathlib import Path

import pytest
from kept_by_workers import digest, once

from descentflow.aircraft_types.bada3.bada3_aircraft import Bada3Aircraft
from descentflow.simulation import world
from descentflow.simulation.flight import Flown
from descentflow.simulation.parameters import FlightParameters
from descentflow.simulation.world_config import WorldConfig

FLY = world.fly


def keep_worlds(patch: pytest.MonkeyPatch, folder: Path) -> None:
    """Let flights of equal parameters be flown once in a session."""

    def fly(aircraft: Bada3Aircraft, parameters: FlightParameters, config: WorldConfig | None = None) -> Flown:
        name = digest(aircraft, parameters, config)
        return once(folder, name, lambda: FLY(aircraft, parameters, config))

    patch.setattr(world, "fly", fly)
