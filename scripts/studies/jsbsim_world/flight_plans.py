"""Plan of each flight of a JSBSim model, drawn from the seed and the flight's own number alone."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace

import numpy as np

from descentflow.core.errors import ConfigError
from descentflow.core.units import FL_M, KT_MPS
from descentflow.simulation.weather import draw_weather
from descentflow.simulation.world_config import WorldConfig
from studies.jsbsim_world.airframes import Airframe

N_WAVES = 3
"""Sine waves that make up the slow wander of the speed held."""
OPERATORS = ("SLO", "MID", "FST")
SHARES = (0.4, 0.35, 0.25)
MACH_STEPS = (-0.01, 0.0, 0.01)
_DRAWS = 32


@dataclass(frozen=True)
class JsbsimConfig:
    """Spreads between flights; defaults are those of :class:`~descentflow.simulation.world_config.WorldConfig`.

    Example:
        >>> JsbsimConfig(deviation_mean_k=10.0).interval_s
        4.0
    """

    cas_spread_kt: float = 3.0
    """Of flights about their operator's CAS."""
    mach_spread: float = 0.004
    wander_kt: float = 1.0
    """Slow deviation of the speed held from the speed planned (root mean square)."""
    thrust_spread: float = 0.12
    """Of the factor of the engines' idle thrust about 1."""
    cd0_spread: float = 0.025
    """Of the factor of the drag at no lift about 1."""
    deviation_mean_k: float = 0.0
    """JSBSim's ``delta-T``: added to the temperature at every geometric height."""
    deviation_spread_k: float = 0.0
    wind_mean_mps: float = 0.0
    """Tailwind at sea level."""
    wind_slope_mean_per_s: float = 0.0
    """Growth of the tailwind with geometric altitude."""
    wind_slope_spread_per_s: float = 0.0
    bottom_fl: float = 95.0
    cruise_s: tuple[float, float] = (80.0, 120.0)
    """Level flight before the descent; of it the first minute is dropped."""
    flights_per_aircraft: int = 5
    step_s: float = 0.1
    """Of the integration and the autopilot. The fastest mode is the 787's pitch, 3 rad/s; a quarter of this step moves
    the time to FL150 by less than 0.001 %."""
    interval_s: float = 4.0
    """Between two rows of truth, and the mean interval of reports."""
    alike: bool = False
    """True for one mass and one planned speed, the means of the fleet."""
    radar: WorldConfig = field(default_factory=WorldConfig)
    """Jitter, losses and noise of the reports, and the winds of days in layers; nothing else of it is used."""

    def __post_init__(self) -> None:
        """Refuse values that make no flights."""
        for each in fields(self):
            value = getattr(self, each.name)
            numbers = value if isinstance(value, tuple) else (value,)
            bad = any(isinstance(v, float | int) and not math.isfinite(v) for v in numbers)
            if bad or ((each.name.endswith("spread") or "_spread_" in each.name) and value < 0):
                raise ConfigError(f"{each.name} = {value!r}", expected="finite, no negative spread", mend="correct it")
        whole = self.interval_s / self.step_s if self.step_s > 0 else 0.0
        if self.step_s <= 0 or self.step_s > 0.2 or whole < 1 or abs(whole - round(whole)) > 1e-6:
            raise ConfigError(
                f"steps of {self.step_s} s and rows every {self.interval_s} s",
                expected="steps of at most 0.2 s, and a whole number of them between two rows",
                mend="correct the settings",
            )


@dataclass(frozen=True)
class FlightPlan:
    """One flight; the fields below ``wander`` are neutral unless an effect is injected.

    Example:
        >>> from studies.jsbsim_world.airframes import airframe_of
        >>> (plan,) = draw_plans(airframe_of("MD11"), [3], seed=0, config=JsbsimConfig())
        >>> plan.number, plan.brake, plan.hold_rate_mps
        (3, 0.0, nan)
    """

    number: int
    operator: int
    """Index in `OPERATORS`."""
    mass_kg: float
    """At the start."""
    idle_factor: float
    """Of the engines' table of idle thrust."""
    cd0_factor: float
    """Of the model's drag at no lift."""
    deviation_k: float
    """JSBSim's ``delta-T``, in kelvin."""
    wind_mps: float
    """Tailwind at sea level."""
    wind_slope_per_s: float
    mach: float
    cas_mps: float
    top_m: float
    """Pressure altitude of the cruise."""
    bottom_m: float
    cruise_s: float
    wander: tuple[tuple[float, float, float], ...]
    """Amplitude (m/s), rate (rad/s) and phase of each wave of the speed's wander."""
    layered_mps: tuple[float, ...] = ()
    """Tailwind of the day besides that, at :data:`descentflow.simulation.weather.HEIGHT_M`; none where empty."""
    cdi_factor: float = 1.0
    """Of the model's induced drag."""
    wave_factor: float = 1.0
    """Of the model's drag due to Mach."""
    brake: float = 0.0
    """Command of the speed brakes (0 to 1) between two pressure altitudes."""
    brake_high_m: float = math.nan
    brake_low_m: float = math.nan
    idle_setting: float = 0.0
    """Thrust lever (0 to 1) in the idle descent."""
    kept_share: float = 0.0
    """Share of drag minus idle thrust that is kept at the top of descent."""
    kept_s: float = 1.0
    """Time in which that decays."""
    ice_share: float = 0.0
    """Share of drag minus idle thrust that is kept between two pressure altitudes."""
    ice_high_m: float = math.nan
    ice_low_m: float = math.nan
    hold_high_m: float = math.nan
    """Pressure altitudes between which a path or a vertical rate is held."""
    hold_low_m: float = math.nan
    hold_of_idle: float = math.nan
    """Share of the shallowest idle descent between them."""
    hold_path: bool = True
    """True if its path angle is held, and not its vertical rate."""
    hold_angle: float = math.nan
    """Path angle over the ground, radians, negative; NaN where a rate is held."""
    hold_rate_mps: float = math.nan
    """Rate of pressure altitude, negative; NaN where an angle is held."""
    cas_bias_mps: float = 0.0
    cas_bias_slope_mps: float = 0.0
    rate_lag_s: float = 0.0
    noise_factor: float = 1.0


def draw_plans(airframe: Airframe, numbers: Sequence[int], seed: int, config: JsbsimConfig) -> list[FlightPlan]:
    """Draw flights; each depends on the seed and its own number only.

    Args:
        airframe: The model.
        numbers: Numbers of the flights.
        seed: Not negative.
        config: Spreads.

    Returns:
        One plan per flight.

    Example:
        >>> from studies.jsbsim_world.airframes import airframe_of
        >>> plans = draw_plans(airframe_of("MD11"), range(2), seed=0, config=JsbsimConfig())
        >>> plans[1] == draw_plans(airframe_of("MD11"), [1], seed=0, config=JsbsimConfig())[0]
        True
    """
    return [_plan(airframe, number, seed, config) for number in numbers]


def _plan(airframe: Airframe, number: int, seed: int, config: JsbsimConfig) -> FlightPlan:
    drawn = _drawn_plan(airframe, number, seed, config)
    if not config.alike:
        return drawn
    mass, cas = sum(airframe.mass_kg) / 2, float(np.dot(SHARES, airframe.cas_kt)) * KT_MPS
    mach = airframe.mach + float(np.dot(SHARES, MACH_STEPS))
    return replace(drawn, operator=1, mass_kg=mass, idle_factor=1.0, cd0_factor=1.0, mach=mach, cas_mps=cas)


def _drawn_plan(airframe: Airframe, number: int, seed: int, config: JsbsimConfig) -> FlightPlan:
    generator = np.random.default_rng((seed, number, 0))
    uniform, normal = generator.random(_DRAWS).tolist(), generator.standard_normal(_DRAWS).tolist()
    own = np.random.default_rng((seed, number // config.flights_per_aircraft, 2)).random()
    operator = int(np.searchsorted(np.cumsum(SHARES), own, side="right").clip(0, len(OPERATORS) - 1))
    low, high = (round(level / 10) for level in airframe.tops_fl)
    top_fl = 10 * (low + math.floor((high - low + 1) * uniform[0]))
    amplitude = config.wander_kt * KT_MPS * math.sqrt(2 / N_WAVES)
    waves = [
        (amplitude * abs(normal[10 + k]), 2 * math.pi / _between((150.0, 600.0), uniform[10 + k]), uniform[20 + k])
        for k in range(N_WAVES)
    ]
    return FlightPlan(
        number=number,
        operator=operator,
        mass_kg=_between(airframe.mass_kg, uniform[1]),
        idle_factor=1 + config.thrust_spread * normal[0],
        cd0_factor=1 + config.cd0_spread * normal[1],
        deviation_k=config.deviation_mean_k + config.deviation_spread_k * normal[2],
        wind_mps=config.wind_mean_mps + 5000 * config.wind_slope_spread_per_s * normal[3],
        wind_slope_per_s=config.wind_slope_mean_per_s + config.wind_slope_spread_per_s * normal[4],
        mach=airframe.mach + MACH_STEPS[operator] + config.mach_spread * normal[5],
        cas_mps=(airframe.cas_kt[operator] + config.cas_spread_kt * normal[6]) * KT_MPS,
        top_m=top_fl * FL_M,
        bottom_m=config.bottom_fl * FL_M,
        cruise_s=float(round(_between(config.cruise_s, uniform[2]))),
        wander=tuple((size, rate, 2 * math.pi * phase) for size, rate, phase in waves),
        layered_mps=tuple(
            draw_weather([number], [day_of(number, config)], seed, config.radar).tailwind_mps[0].tolist()
        ),
    )


def day_of(number: int, config: JsbsimConfig) -> int:
    """Day of a flight: those of one aircraft fly on consecutive days, from one of its own.

    Example:
        >>> [day_of(number, JsbsimConfig()) for number in (0, 4, 5)]
        [0, 4, 0]
    """
    aircraft, own = divmod(number, config.flights_per_aircraft)
    return own + aircraft % max(config.radar.days - config.flights_per_aircraft + 1, 1)


def _between(limits: tuple[float, float], share: float) -> float:
    return limits[0] + (limits[1] - limits[0]) * share
