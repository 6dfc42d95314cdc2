"""Settings of a world: its operators and the spreads from which every flight is drawn."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

from descentflow.core.arguments import Count, NotNegativeFloat, NotNegativeInt, Within, checked_settings
from descentflow.core.errors import ConfigError
from descentflow.physics.performance_model import PerformanceModel

Share = Annotated[float, Within(0, 1)]
Range = tuple[NotNegativeFloat, NotNegativeFloat]
FASTEST_CAS = 310 / 280
"""Speed of the fastest operator in standard descent speeds: 310 kt where the type's own is 280 kt."""
CAS_STEPS = (270 / 310, 290 / 310, 1.0)
"""Operators' speeds in units of the fastest."""
VMO_SHARE = 0.96
"""No operator plans faster than this share of V_MO and M_MO."""
MACH_STEPS = (-0.01, 0.0, 0.01)
SHARES = (0.4, 0.35, 0.25)


@dataclass(frozen=True)
class Operator:
    """One operator's descent schedule and its share of the aircraft.

    Example:
        >>> fast = Operator("FST", share=1.0, cas_kt=310.0, mach=0.79)
        >>> [operator.cas_kt for operator in WorldConfig(operators=(fast,)).operators]
        [310.0]
    """

    name: str
    """Three letters, the prefix of its callsigns."""
    share: float
    """Relative frequency; the shares of a world need not add up to one."""
    cas_kt: float
    mach: float
    """``inf`` for a descent at constant CAS from the top."""


@checked_settings
@dataclass(frozen=True)
class WorldConfig:
    """Everything that a world may vary; a spread is a standard deviation, a range is uniform.

    Example:
        >>> WorldConfig(deviation_mean_k=10.0).level_off_share
        0.15
    """

    operators: Sequence[Operator] | None = None
    """None for :func:`default_operators` of the type."""
    cas_spread_kt: NotNegativeFloat = 3.0
    """Of flights about their operator's CAS."""
    mach_spread: NotNegativeFloat = 0.004
    wander_kt: NotNegativeFloat = 1.0
    """Slow deviation of the speed held from the speed planned (root mean square over a long descent)."""
    mass_range: Range = (0.75, 1.0)
    """In units of the largest landing mass, see :func:`largest_landing_mass_kg`; never below the minimum mass."""
    thrust_spread: NotNegativeFloat = 0.12
    """Of the idle thrust factor about 1."""
    cd0_spread: NotNegativeFloat = 0.025
    """Of the parasitic drag factor about 1."""
    deviation_mean_k: float = 0.0
    deviation_spread_k: NotNegativeFloat = 0.0
    wind_mean_mps: float = 0.0
    """Tailwind at sea level; its spread is that of the slope times 5 km."""
    wind_slope_mean_per_s: float = 0.0
    """Growth of the tailwind with geometric altitude, m/s per m (0.002 is 20 m/s more at 10 km)."""
    wind_slope_spread_per_s: NotNegativeFloat = 0.0
    top_range: Range = (0.732, 0.952)
    """Tops in units of the type's ceiling (FL300 to FL390 for 41,000 ft), on whole thousands of feet."""
    low_top_share: Share = 0.15
    """Flights that start lower, down to ``low_top`` of the ceiling."""
    low_top: NotNegativeFloat = 0.5
    bottom_fl: NotNegativeFloat = 90.0
    level_off_share: Share = 0.15
    level_off_s: Range = (30.0, 120.0)
    managed_share: Share = 0.15
    """Flights with a stretch of constant vertical rate."""
    managed_s: Range = (60.0, 180.0)
    managed_rate: Range = (0.55, 0.9)
    """Rate held, in units of the rate flown when it is selected; rounded to 100 ft/min."""
    slow_start_share: Share = 0.0
    """Flights that hold a slow rate from the top before they descend at idle."""
    slow_start_fpm: Range = (600.0, 1200.0)
    slow_start_fl: Range = (20.0, 80.0)
    """Height of that stretch, flight levels."""
    two_rates_share: Share = 0.0
    """Flights that hold one rate from the top and another to the bottom, as turboprops do."""
    first_rate_fpm: Range = (700.0, 1100.0)
    second_rate_fpm: Range = (1200.0, 1500.0)
    switch_fl: Range = (160.0, 220.0)
    """Flight level where the second rate takes over; from the top on for flights that start below it."""
    speed_change_share: Share = 0.0
    """Chance of each of two changes of the planned speed on the way down."""
    faster_share: Share = 0.25
    """Of the changes; the others are slow-downs."""
    speed_change_kt: Range = (10.0, 30.0)
    speed_change_fl: Range = (160.0, 330.0)
    """Flight level where a change begins."""
    speed_change_kt_per_kft: Range = (6.0, 14.0)
    """CAS by which it changes in 1,000 ft, kt."""
    thrust_share: Share = 0.0
    """Chance of each of two stretches with thrust above idle."""
    thrust_of_needed: Range = (0.1, 0.4)
    """Share of drag minus idle thrust that thrust keeps there."""
    brakes_share: Share = 0.0
    """Chance of each of two stretches with speed brakes."""
    brake_gain: Range = (0.2, 0.6)
    """Share by which these raise CD0."""
    off_idle_fl: Range = (20.0, 70.0)
    """Height of such stretches, flight levels."""
    shear_spread_per_s: NotNegativeFloat = 0.0
    """Of the growth of wind with height in layers, m/s per m, in any one direction."""
    layer_m: Range = (600.0, 6000.0)
    """Vertical wavelengths of layers of wind and temperature."""
    layer_spread_k: NotNegativeFloat = 0.0
    """Of the temperature in layers."""
    layers_own_share: Share = 0.5
    """Share of the layers' variance that is each flight's own; the rest is its day's."""
    jet_mps: Range = (0.0, 0.0)
    """Wind at the core of the day's jet stream, mostly westerly."""
    jet_fl: Range = (300.0, 400.0)
    jet_depth_m: NotNegativeFloat = 3000.0
    """Height above and below its core where a jet has 1/e of its wind."""
    daily_spread_k: NotNegativeFloat = 0.0
    """Of the day's deviation from the standard atmosphere."""
    days: NotNegativeInt = 0
    """Days over which airframes' first flights are spread; 0 for all on the first."""
    cruise_s: Range = (20.0, 60.0)
    """Level flight before the descent."""
    flights_per_aircraft: Count = 5
    step_s: Annotated[float, Within(1e-3)] = 1.0
    """Period of the autopilot, and longest step of the integration."""
    substeps: Count = 1
    """Runge-Kutta steps in one autopilot period."""
    interval_s: Count = 4
    """Autopilot periods between two truth rows, and mean interval of surveillance reports (in periods)."""
    jitter_s: NotNegativeFloat = 0.8
    """Reports come this much before or after their due time, uniformly."""
    dropout_share: Share = 0.03
    """Reports lost one by one."""
    gap_share: Share = 0.1
    """Flights that lose all reports for a while."""
    gap_s: Range = (20.0, 60.0)
    rate_noise_fpm: NotNegativeFloat = 40.0
    rate_smoothing_s: NotNegativeFloat = 3.0
    """Time constant of the transponder's smoothing of vertical rate."""
    cas_noise_kt: NotNegativeFloat = 0.4
    mach_noise: NotNegativeFloat = 0.0008
    tas_noise_kt: NotNegativeFloat = 0.6
    altitude_noise_ft: NotNegativeFloat = 5.0

    def __post_init__(self) -> None:
        """Refuse values that make no world together."""
        for name, value in vars(self).items():
            if isinstance(value, tuple) and name != "operators" and value[0] > value[1]:
                raise ConfigError(f"{name} = {value}", expected="a range from low to high", mend="correct the setting")
        if self.operators is not None and sum(operator.share for operator in self.operators) <= 0:
            raise ConfigError("no operator with a share", expected="at least one", mend="add an operator")


def default_operators(aircraft: PerformanceModel) -> tuple[Operator, ...]:
    """Three operators whose descent speeds are those of a jet at 270, 290 and 310 kt, scaled to the type.

    Args:
        aircraft: Coefficients of the type; its standard descent speeds and limits are used.

    Returns:
        Operators in order of speed, all below V_MO and M_MO.

    Example:
        >>> from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
        >>> [round(o.cas_kt) for o in default_operators(open_aircraft("A320"))]
        [270, 290, 310]
    """
    fastest = min(FASTEST_CAS * float(aircraft.des_cas_high_kt), VMO_SHARE * float(aircraft.vmo_kt))
    planned, limit = float(aircraft.des_mach), float(aircraft.mmo)
    machs = [min(planned + step, VMO_SHARE * limit) if planned > 0 else math.inf for step in MACH_STEPS]
    names = ("SLO", "MID", "FST")
    return tuple(
        Operator(name, share, step * fastest, mach)
        for name, share, step, mach in zip(names, SHARES, CAS_STEPS, machs, strict=True)
    )


def largest_landing_mass_kg(aircraft: PerformanceModel) -> float:
    """Mass like a maximum landing mass: 1.07 times the minimum mass with full payload, at most the maximum mass.

    BADA gives no landing mass; for the A320, B777-200 and A380 this comes within 2 % of the printed ones. Nine tenths
    of the maximum mass where the payload is not given.

    Example:
        >>> from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
        >>> 60e3 < largest_landing_mass_kg(open_aircraft("A320")) < 68e3
        True
    """
    payload, heaviest = float(aircraft.mass_payload_kg), float(aircraft.mass_maximum_kg)
    return min(heaviest, 1.07 * (float(aircraft.mass_minimum_kg) + payload)) if payload > 0 else 0.9 * heaviest
