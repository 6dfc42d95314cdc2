"""The parameters of every flight, as batched tensors that later work may change to inject an effect."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields

import torch
from torch import Tensor

from descentflow.core.errors import ConfigError
from descentflow.core.units import FL_M, FT_M, KT_MPS
from descentflow.physics.performance_model import PerformanceModel
from descentflow.simulation.injected import Injected, neutral
from descentflow.simulation.planned_changes import (
    ConstantRates,
    OffIdle,
    SpeedChanges,
    draw_constant_rates,
    draw_off_idle,
    draw_speed_changes,
    ranged,
    uniform_of,
)
from descentflow.simulation.weather import Weather, draw_weather
from descentflow.simulation.world_config import Operator, WorldConfig, default_operators, largest_landing_mass_kg

N_WAVES = 3
"""Sine waves that make up the pilot's slow wander."""
WIDTH = 64
"""Batches are filled up to a multiple of this: the last few entries of a vector take another path through the
processor, and with it another last bit, so that a flight's numbers would depend on its place in the batch."""
PARTS = ("constant_rates", "weather", "speed_changes", "off_idle", "injected")
"""Parameters that are tables of their own."""
_DRAWS = 40
_THOUSAND_FT_M = 1000 * FT_M


@dataclass(frozen=True)
class FlightParameters:
    """Parameters of the flights, one entry per flight; all float64 of shape (n,) unless said otherwise.

    Example:
        >>> from dataclasses import replace
        >>> from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
        >>> parameters = draw_parameters(open_aircraft("A320"), range(3), seed=0)
        >>> heavier = replace(parameters, mass_kg=1.1 * parameters.mass_kg)
        >>> len(heavier.rows(torch.tensor([0, 2])))
        2
    """

    mass_kg: Tensor
    thrust_factor: Tensor
    """Of the idle thrust."""
    cd0_factor: Tensor
    deviation_k: Tensor
    wind_mps: Tensor
    """Tailwind at sea level."""
    wind_slope_per_s: Tensor
    """Growth of the tailwind with geometric altitude."""
    mach: Tensor
    """Planned Mach number of the upper descent; inf for none."""
    cas_mps: Tensor
    """Planned CAS below the crossover."""
    operator: Tensor
    """Index of the operator, int64."""
    top_m: Tensor
    """Pressure altitude of the cruise before the descent."""
    bottom_m: Tensor
    cruise_s: Tensor
    wander_mps: Tensor
    """Amplitudes, (n, waves)."""
    wander_rad_s: Tensor
    wander_phase: Tensor
    level_off_m: Tensor
    """Pressure altitude of the level-off; NaN for none."""
    level_off_s: Tensor
    managed_m: Tensor
    """Pressure altitude where a constant vertical rate is selected; NaN for none."""
    managed_s: Tensor
    managed_rate: Tensor
    """Rate held in units of the rate when selected."""
    number: Tensor
    """Number of the flight in its world, int64: what an effect draws from, so that a flight depends on nothing else."""
    airframe: Tensor
    """Number of the airframe in the world, int64."""
    day: Tensor
    """Number of the day, int64: an airframe flies once a day."""
    constant_rates: ConstantRates
    """Constant-rate segments from the top of descent."""
    weather: Weather
    """Wind and temperature that change with height, besides those above."""
    speed_changes: SpeedChanges
    off_idle: OffIdle
    """Stretches with thrust or brakes."""
    injected: Injected
    """Effects beyond these parameters."""
    planted: Mapping[str, Tensor] = field(default_factory=dict)
    """Planted causes of each flight, by ``cause_value``; NaN for none."""

    def __len__(self) -> int:
        """Number of flights."""
        return len(self.mass_kg)

    def rows(self, index: Tensor) -> "FlightParameters":
        """Return the flights of an index tensor."""
        plain = [f.name for f in fields(self) if f.name not in (*PARTS, "planted")]
        return FlightParameters(
            **{name: getattr(self, name)[index] for name in plain},
            **{name: getattr(self, name).rows(index) for name in PARTS},
            planted={name: values[index] for name, values in self.planted.items()},
        )


def draw_parameters(
    aircraft: PerformanceModel, numbers: Sequence[int], seed: int, config: WorldConfig | None = None
) -> FlightParameters:
    """Draw flights; each depends on the seed and its own number only, never on which others are drawn with it.

    Args:
        aircraft: Coefficients of the type.
        numbers: Numbers of the flights in the world.
        seed: Seed of the world, not negative.
        config: Spreads and shares.

    Returns:
        Parameters of shape (len(numbers),).

    Raises:
        ConfigError: If the type cannot start a descent above the bottom.

    Example:
        >>> from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
        >>> len(draw_parameters(open_aircraft("A320"), range(5), seed=0))
        5
    """
    # Filled up as flights are flown, so that no number depends on its place in the vector.
    width = -(-len(numbers) // WIDTH) * WIDTH
    padded = [*numbers, *[numbers[-1]] * (width - len(numbers))] if numbers else []
    return _draw(aircraft, padded, seed, config or WorldConfig()).rows(torch.arange(len(numbers)))


def _draw(aircraft: PerformanceModel, numbers: Sequence[int], seed: int, config: WorldConfig) -> FlightParameters:
    own = uniform_of(numbers, seed, (0,), _DRAWS)
    normal = torch.special.ndtri(own.clamp(1e-9, 1 - 1e-9))
    n = len(numbers)
    airframes = [number // config.flights_per_aircraft for number in numbers]
    of_airframe = uniform_of(airframes, seed, (2,), _DRAWS)
    operator, cas_kt, mach = _schedules(config.operators or default_operators(aircraft), of_airframe)
    cas_mps = (cas_kt + config.cas_spread_kt * normal[:, 14]) * KT_MPS
    days = _days(numbers, of_airframe[:, 1], config)
    deviation = config.deviation_mean_k + config.deviation_spread_k * normal[:, 3]
    slope = config.wind_slope_mean_per_s + config.wind_slope_spread_per_s * normal[:, 4]
    lowest, heaviest = (share * largest_landing_mass_kg(aircraft) for share in config.mass_range)
    lowest = max(lowest, float(aircraft.mass_minimum_kg))
    mass = lowest + (max(heaviest, lowest) - lowest) * own[:, 0]
    bottom = torch.full((n,), config.bottom_fl * FL_M, dtype=torch.float64)
    top = _tops(aircraft, mass, deviation, own[:, 5:7], bottom, config)
    has_level = (own[:, 8] < config.level_off_share) & (top - bottom > 6 * _THOUSAND_FT_M)
    has_managed = own[:, 9] < config.managed_share
    level = ranged((bottom + 2 * _THOUSAND_FT_M, top - 3 * _THOUSAND_FT_M), own[:, 10])
    level = (level / _THOUSAND_FT_M).round() * _THOUSAND_FT_M
    managed = ranged((bottom + 0.1 * (top - bottom), top - 0.1 * (top - bottom)), own[:, 11])
    waves = slice(20, 20 + N_WAVES), slice(25, 25 + N_WAVES), slice(30, 30 + N_WAVES)
    return FlightParameters(
        mass_kg=mass,
        thrust_factor=1 + config.thrust_spread * normal[:, 1],
        cd0_factor=1 + config.cd0_spread * normal[:, 2],
        deviation_k=deviation,
        wind_mps=config.wind_mean_mps + 5000 * config.wind_slope_spread_per_s * normal[:, 12],
        wind_slope_per_s=slope,
        mach=mach + config.mach_spread * normal[:, 13],
        cas_mps=cas_mps,
        operator=operator,
        top_m=top,
        bottom_m=bottom,
        cruise_s=ranged(config.cruise_s, own[:, 15]).round(),
        wander_mps=config.wander_kt * KT_MPS * math.sqrt(2 / N_WAVES) * normal[:, waves[0]].abs(),
        wander_rad_s=2 * torch.pi / ranged((150.0, 600.0), own[:, waves[1]]),
        wander_phase=2 * torch.pi * own[:, waves[2]],
        level_off_m=torch.where(has_level, level, torch.nan),
        level_off_s=ranged(config.level_off_s, own[:, 16]).round(),
        managed_m=torch.where(has_managed, managed, torch.nan),
        managed_s=ranged(config.managed_s, own[:, 17]).round(),
        managed_rate=ranged(config.managed_rate, own[:, 18]),
        number=torch.tensor(numbers, dtype=torch.int64),
        airframe=torch.tensor(airframes, dtype=torch.int64),
        day=torch.tensor(days, dtype=torch.int64),
        constant_rates=draw_constant_rates(numbers, seed, config, top, bottom),
        weather=draw_weather(numbers, days, seed, config),
        speed_changes=draw_speed_changes(numbers, seed, config, cas_mps, top),
        off_idle=draw_off_idle(numbers, seed, config, top, bottom),
        injected=neutral(n),
    )


def _days(numbers: Sequence[int], of_airframe: Tensor, config: WorldConfig) -> list[int]:
    """Day of each flight: an airframe flies on consecutive days from one of its own, or from the first."""
    first = (of_airframe * (config.days - config.flights_per_aircraft + 1)).floor().clamp(min=0).long().tolist()
    return [begin + number % config.flights_per_aircraft for begin, number in zip(first, numbers, strict=True)]


def _schedules(operators: Sequence[Operator], uniform: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Operator of each airframe, with its CAS and Mach number."""
    shares = torch.tensor([o.share for o in operators], dtype=torch.float64).cumsum(0)
    index = torch.searchsorted(shares / shares[-1], uniform[:, 0].contiguous()).clamp(max=len(operators) - 1)
    cas = torch.tensor([o.cas_kt for o in operators], dtype=torch.float64)
    mach = torch.tensor([o.mach for o in operators], dtype=torch.float64)
    return index, cas[index], mach[index]


def _tops(
    aircraft: PerformanceModel, mass: Tensor, deviation: Tensor, uniform: Tensor, bottom: Tensor, config: WorldConfig
) -> Tensor:
    """Tops on whole thousands of feet within the range, some of them lower, none above what the mass allows."""
    ceiling_kft = float(aircraft.altitude_maximum_ft) / 1000
    low, high = (round(share * ceiling_kft) for share in config.top_range)
    is_low = uniform[:, 0] < config.low_top_share
    lowest = torch.where(is_low, round(config.low_top * ceiling_kft), low)
    levels = torch.where(is_low, low - lowest, high - low + 1)
    wanted = lowest + (levels * uniform[:, 1]).floor()
    able = (aircraft.maximum_altitude_m(mass, deviation) / _THOUSAND_FT_M).floor()
    top = torch.minimum(wanted.double(), able) * _THOUSAND_FT_M
    if bool((top <= bottom + _THOUSAND_FT_M).any()):
        raise ConfigError(
            f"a top of descent at FL{float(top.min()) / FL_M:.0f} for {aircraft.typecode} with the bottom at "
            f"FL{config.bottom_fl:g}",
            expected="tops more than 1,000 ft above the bottom",
            mend="lower bottom_fl or raise low_top and top_range",
        )
    return top
