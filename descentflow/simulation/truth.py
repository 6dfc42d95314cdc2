"""Truth as tables: one row per flight with everything drawn, one row per time step with everything that happened."""

import zlib
from collections.abc import Sequence
from dataclasses import dataclass, fields
from datetime import UTC, datetime

import numpy as np
import polars as pl
import torch
from torch import Tensor

from descentflow.core.units import FL_M, FPM_MPS, KT_MPS
from descentflow.simulation.autopilot import LABELS
from descentflow.simulation.flight import Flown
from descentflow.simulation.parameters import PARTS, FlightParameters
from descentflow.simulation.world_config import Operator

FIRST_DAY = datetime(2024, 3, 4, tzinfo=UTC)
"""A world's first day; an aircraft flies once a day."""
DAY_S = 86400
_FIRST_ADDRESS, _N_ADDRESSES = 0xF10000, 0xEFFFF
_START_STREAM = 3
_FLOWN = tuple(f.name for f in fields(Flown) if f.name not in ("time_s", "label", "flying"))


@dataclass(frozen=True)
class Flight:
    """Identity and time of a flight.

    Example:
        >>> (flight,) = name_flights("A320", [12], seed=0, flights_per_aircraft=5, prefixes=["SLO"])
        >>> flight.callsign, datetime.fromtimestamp(flight.start_us / 1e6, UTC).date().isoformat()
        ('SLO0012', '2024-03-06')
    """

    flight_id: str
    icao24: str
    callsign: str
    typecode: str
    start_us: int
    """Microseconds since 1970 of the first truth row."""


def name_flights(
    typecode: str,
    numbers: Sequence[int],
    seed: int,
    flights_per_aircraft: int,
    prefixes: Sequence[str],
    days: Sequence[int] | None = None,
) -> list[Flight]:
    """Give flights their names, aircraft and start times, which depend on seed and number alone.

    Args:
        typecode: Type designator.
        numbers: Numbers of the flights in the world.
        seed: Seed of the world.
        flights_per_aircraft: Consecutive numbers share an aircraft and fly on consecutive days.
        prefixes: First letters of each flight's callsign.
        days: Day of each flight; that of its number among those of its aircraft if not given.

    Returns:
        One entry per flight.

    Example:
        >>> name_flights("A320", [12], 0, 5, ["SLO"])[0].flight_id
        'A320-0-00012'
    """
    offset = zlib.crc32(f"{typecode}-{seed}".encode())
    first_us = int(FIRST_DAY.timestamp()) * 1_000_000
    named = []
    if days is None:
        days = [number % flights_per_aircraft for number in numbers]
    for number, prefix, day in zip(numbers, prefixes, days, strict=True):
        airframe = number // flights_per_aircraft
        hour = np.random.default_rng((seed, number, _START_STREAM)).uniform(5, 22)
        start = first_us + int((day * DAY_S + hour * 3600) * 1e6)
        address = f"{_FIRST_ADDRESS + (offset + airframe) % _N_ADDRESSES:06x}"
        callsign = f"{prefix}{number % 10000:04d}"
        named.append(Flight(f"{typecode}-{seed}-{number:05d}", address, callsign, typecode, start))
    return named


def flights_table(named: Sequence[Flight], parameters: FlightParameters, operators: Sequence[Operator]) -> pl.DataFrame:
    """One row per flight: names and parameters, in field units for levels and speeds, and ``planted_...``.

    Example:
        >>> from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
        >>> from descentflow.simulation.parameters import draw_parameters
        >>> from descentflow.simulation.world_config import default_operators
        >>> aircraft = open_aircraft("A320")
        >>> parameters, named = draw_parameters(aircraft, [0], seed=0), name_flights("A320", [0], 0, 5, ["SLO"])
        >>> flights_table(named, parameters, default_operators(aircraft)).columns[:3]
        ['flight_id', 'icao24', 'callsign']
    """
    table = pl.DataFrame(
        {
            "flight_id": [f.flight_id for f in named],
            "icao24": [f.icao24 for f in named],
            "callsign": [f.callsign for f in named],
            "typecode": [f.typecode for f in named],
            "start": pl.Series([f.start_us for f in named]).cast(pl.Datetime("us", "UTC")),
            "operator": [operators[i].name for i in parameters.operator.tolist()],
            "cas_kt": (parameters.cas_mps / KT_MPS).numpy(),
            "top_fl": (parameters.top_m / FL_M).numpy(),
            "bottom_fl": (parameters.bottom_m / FL_M).numpy(),
            "level_off_fl": (parameters.level_off_m / FL_M).numpy(),
            "managed_fl": (parameters.managed_m / FL_M).numpy(),
        }
    )
    already = {
        "operator",
        "cas_mps",
        "top_m",
        "bottom_m",
        "level_off_m",
        "managed_m",
        "number",
        "airframe",
        "day",
        "planted",
        *PARTS,
    }
    plain = [f.name for f in fields(parameters) if f.name not in already and not f.name.startswith("wander")]
    more = [pl.Series(name, getattr(parameters, name).numpy()) for name in plain]
    rates = {"rate_fpm": parameters.constant_rates.rate_mps / FPM_MPS, "low_fl": parameters.constant_rates.low_m / FL_M}
    more += [
        pl.Series(f"{which}_{name}", column.numpy()).fill_nan(None)
        for name, values in rates.items()
        for which, column in zip(("first", "second"), values.unbind(1), strict=False)
    ]
    more += _tables(parameters)
    more += [pl.Series(f"planted_{name}", value.numpy()).fill_nan(None) for name, value in parameters.planted.items()]
    return table.with_columns(more).with_columns(pl.col("level_off_fl", "managed_fl").fill_nan(None))


def _tables(parameters: FlightParameters) -> list[pl.Series]:
    """Changes of speed and stretches off idle, a column for each number of each; the weather is too long for a row."""
    parts = {"speed_change": parameters.speed_changes, "off_idle": parameters.off_idle}
    return [
        pl.Series(f"{name}_{k + 1}_{f.name}", column.numpy())
        for name, part in parts.items()
        for f in fields(part)
        for k, column in enumerate(getattr(part, f.name).unbind(1))
    ]


def truth_table(named: Sequence[Flight], flown: Flown) -> pl.DataFrame:
    """One row per flight and time step, sorted by flight and time.

    Columns: ``flight_id``, ``timestamp``, ``time_s``, ``altitude_m`` (pressure), ``height_m`` (geometric), ``cas_mps``,
    ``mach``, ``tas_mps``, ``groundspeed_mps``, ``rate_mps`` (of pressure altitude), ``gamma`` (radians), ``drag_n``,
    ``thrust_n``, ``label``.

    Args:
        named: The flights.
        flown: What they did.

    Returns:
        The table.

    Example:
        >>> from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
        >>> from descentflow.simulation.flight import fly
        >>> from descentflow.simulation.parameters import draw_parameters
        >>> from descentflow.simulation.world_config import WorldConfig
        >>> aircraft, config = open_aircraft("A320"), WorldConfig(bottom_fl=290.0, low_top_share=0.0)
        >>> flown = fly(aircraft, draw_parameters(aircraft, [0], 0, config), config)
        >>> truth_table(name_flights("A320", [0], 0, 5, ["SLO"]), flown)["label"].unique(maintain_order=True).to_list()
        ['transient', 'idle']
    """
    flying = flown.flying.T
    flight, step = flying.nonzero(as_tuple=True)

    def column(values: Tensor) -> Tensor:
        return values.T[flight, step]

    time = flown.time_s[step]
    start = torch.tensor([f.start_us for f in named])[flight]
    values = {"timestamp": start + (time * 1e6).round().long(), "time_s": time}
    values |= {name: column(getattr(flown, name)) for name in _FLOWN}
    names = pl.Series("flight_id", [f.flight_id for f in named])
    columns = [names.gather(pl.Series(flight.numpy()).cast(pl.UInt32))]
    columns += [pl.Series(name, value.numpy()) for name, value in values.items()]
    kinds = pl.Series("label", list(LABELS), dtype=pl.Enum(LABELS))
    columns.append(kinds.gather(pl.Series(column(flown.label).numpy()).cast(pl.UInt32)))
    return pl.DataFrame(columns).with_columns(pl.col("timestamp").cast(pl.Datetime("us", "UTC")))
