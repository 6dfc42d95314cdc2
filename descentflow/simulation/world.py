"""A world: flights of known truth, and the surveillance rows that a radar would have of them."""

from collections.abc import Callable
from dataclasses import dataclass, fields

import polars as pl

from descentflow.aircraft_types.aircraft import Aircraft
from descentflow.core.errors import ConfigError
from descentflow.simulation.flight import fly
from descentflow.simulation.observe import observe
from descentflow.simulation.parameters import FlightParameters, draw_parameters
from descentflow.simulation.truth import flights_table, name_flights, truth_table
from descentflow.simulation.world_config import WorldConfig, default_operators

CHUNK = 2000
"""Flights flown together: fewer waste time on overhead, more on memory and on waiting for the longest."""


@dataclass(frozen=True)
class World:
    """Rows, and the truth behind them."""

    rows: pl.DataFrame
    """Surveillance reports in the package's row schema."""
    flights: pl.DataFrame
    """One row a flight: every parameter."""
    truth: pl.DataFrame
    """One row a flight and time step, see :func:`descentflow.simulation.truth.truth_table`."""


def simulate(
    aircraft: Aircraft,
    n_flights: int,
    seed: int,
    config: WorldConfig | None = None,
    *,
    plant: Callable[[FlightParameters], FlightParameters] | None = None,
    chunk: int = CHUNK,
    progress: Callable[[int], object] | None = None,
) -> World:
    """Fly a world.

    Args:
        aircraft: Coefficients of the type, floats.
        n_flights: Flights wanted, at least one.
        seed: Not negative; flight number k of a seed is the same in any world that has it.
        config: Spreads and shares; the defaults are those of :class:`WorldConfig`.
        plant: Changes the parameters of each chunk of flights before they are flown: the place to plant an effect. It
            sees flights chunk by chunk, so to keep results free of the chunk it must act on each flight by itself.
        chunk: Flights flown together; without effect on the result.
        progress: Called with the number of flights just finished.

    Returns:
        The world.

    Raises:
        ConfigError: If the count or the seed cannot be, or the aircraft does not descend.

    Example:
        >>> from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
        >>> simulate(open_aircraft("A320"), n_flights=2, seed=0).flights["flight_id"].to_list()
        ['A320-0-00000', 'A320-0-00001']
    """
    config = config or WorldConfig()
    if n_flights < 1 or seed < 0 or chunk < 1:
        raise ConfigError(
            f"{n_flights} flights with seed {seed} in chunks of {chunk}",
            expected="at least one flight, a seed of at least 0 and chunks of at least one",
            mend="pass positive numbers",
        )
    parts = []
    for first in range(0, n_flights, chunk):
        numbers = range(first, min(first + chunk, n_flights))
        parts.append(_chunk(aircraft, numbers, seed, config, plant))
        if progress is not None:
            progress(len(numbers))
    return World(**{f.name: pl.concat([getattr(part, f.name) for part in parts]) for f in fields(World)})


def _chunk(
    aircraft: Aircraft,
    numbers: range,
    seed: int,
    config: WorldConfig,
    plant: Callable[[FlightParameters], FlightParameters] | None,
) -> World:
    operators = config.operators or default_operators(aircraft)
    parameters = draw_parameters(aircraft, numbers, seed, config)
    if plant is not None:
        parameters = plant(parameters)
    prefixes = [operators[i].name for i in parameters.operator.tolist()]
    named = name_flights(aircraft.typecode, numbers, seed, config.flights_per_aircraft, prefixes)
    truth = truth_table(named, fly(aircraft, parameters, config))
    rows = observe(named, truth, seed, numbers, config, parameters.planted)
    return World(rows, flights_table(named, parameters, operators), truth)
