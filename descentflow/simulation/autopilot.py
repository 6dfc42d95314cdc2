"""The autopilot of an idle descent: speed on elevator at idle thrust, or path on elevator and speed on thrust.

It sees speeds, rates and forces and turns the path by a bounded rate once a period. In idle descent the path angle is
driven by the speed error and its growth alone, as a speed-on-elevator law is: the rate of descent is what comes out.
"""

import math
from dataclasses import dataclass, replace

import torch
from torch import Tensor

from descentflow.core.constants import G0_MPS2
from descentflow.core.units import FPM_MPS
from descentflow.physics.airspeed import cas_to_tas_mps, mach_to_tas_mps
from descentflow.physics.atmosphere import geometric_altitude_m, isa_fraction
from descentflow.simulation.injected import Injected
from descentflow.simulation.motion import Controls, Dynamics, Motion

CRUISE, IDLE, LEVEL_OFF, MANAGED, BOTTOM, DONE, INJECTED, SEGMENT = range(8)
"""Modes of the autopilot."""
TRANSIENT_LABEL, IDLE_LABEL, LEVEL_OFF_LABEL, MANAGED_LABEL, PATH_LABEL = range(5)
LABELS = ("transient", "idle", "level_off", "constant_rate", "constant_path")
"""Names of the labels of truth rows."""

FREQUENCY_RAD_S = 0.12
DAMPING = 0.9
"""Of the speed held by elevator."""
GAMMA_RATE = 0.2 * torch.pi / 180
"""Bound of the path's turn, rad/s: 0.08 g at 230 m/s."""
STEEPEST = -8 * torch.pi / 180
LEAST_FPM = 600.0
"""Least rate of descent where the planned speed changes, ft/min: above the 500 of UK airspace (section 3)."""
PATH_LAG_S = 3.0
CAPTURE_S = 20.0
"""Time constant of the flare onto a level."""
CAPTURED_M = 15.0
SPEED_LAG_S = 12.0
"""Time in which thrust removes a speed error in level flight."""
SPOOL_UP_S, SPOOL_DOWN_S = 4.0, 8.0
"""Lags of thrust; it is taken off as slowly as the path can steepen, so that little speed is lost."""
SETTLED_S = 30.0
"""Labels call it transient until this long after idle descent is selected, half as long for a constant rate."""
BOTTOM_S = 12.0


@dataclass(frozen=True)
class Pilot:
    """Memory of the autopilot, all of shape (n,).

    Example:
        >>> from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
        >>> from descentflow.simulation.parameters import draw_parameters
        >>> aircraft = open_aircraft("A320")
        >>> dynamics = Dynamics(aircraft, draw_parameters(aircraft, range(2), seed=0))
        >>> _, pilot = start(dynamics)
        >>> (pilot.mode == CRUISE).tolist(), pilot.age_s.tolist()
        ([True, True], [0.0, 0.0])
    """

    mode: Tensor
    age_s: Tensor
    """Since the mode was selected."""
    captured_s: Tensor
    """Since the level was captured."""
    gamma: Tensor
    extra_n: Tensor
    speed_error_mps: Tensor
    """At the last period; NaN before the first."""
    rate_mps: Tensor
    """Rate of pressure altitude to hold in managed mode."""
    level_off_done: Tensor
    managed_done: Tensor


def target_tas_mps(dynamics: Dynamics, altitude_m: Tensor, time_s: float) -> Tensor:
    """True airspeed wanted: Mach above the flight's own crossover, CAS below it, with the pilot's slow wander.

    Args:
        dynamics: The flights, n of them.
        altitude_m: (n,) pressure altitude.
        time_s: Time since the start, which the wander depends on.

    Returns:
        (n,) true airspeed, m/s.

    Example:
        >>> from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
        >>> from descentflow.simulation.parameters import draw_parameters
        >>> aircraft = open_aircraft("A320")
        >>> dynamics = Dynamics(aircraft, draw_parameters(aircraft, range(2), seed=0))
        >>> low, high = torch.full((2,), 3000.0), torch.full((2,), 6000.0)
        >>> target_tas_mps(dynamics, low, 0.0) < target_tas_mps(dynamics, high, 0.0)  # one CAS in thinner air
        tensor([True, True])
    """
    p = dynamics.parameters
    wander = (p.wander_mps * torch.sin(p.wander_rad_s * time_s + p.wander_phase)).sum(-1)
    cas, deviation = p.cas_mps * p.speed_changes.factor(altitude_m) + wander, dynamics.deviation_k(altitude_m)
    by_mach = mach_to_tas_mps(p.mach * (cas / p.cas_mps), altitude_m, deviation)
    return torch.minimum(by_mach, cas_to_tas_mps(cas, altitude_m, deviation))


def start(dynamics: Dynamics) -> tuple[Motion, Pilot]:
    """Level cruise at the top, trimmed at the planned speed.

    Args:
        dynamics: The flights, n of them.

    Returns:
        Where the flights are, and the autopilot's memory, each of shape (n,).

    Example:
        >>> from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
        >>> from descentflow.simulation.parameters import draw_parameters
        >>> aircraft = open_aircraft("A320")
        >>> dynamics = Dynamics(aircraft, draw_parameters(aircraft, range(2), seed=0))
        >>> state, pilot = start(dynamics)
        >>> dynamics.rates(state, pilot.gamma, pilot.extra_n).tas_mps.abs() < 1e-9  # neither faster nor slower
        tensor([True, True])
    """
    p = dynamics.parameters
    zero = torch.zeros_like(p.mass_kg)
    column = p.deviation_k + p.weather.mean_deviation_k(p.top_m)
    state = Motion(target_tas_mps(dynamics, p.top_m, 0.0), p.top_m, geometric_altitude_m(p.top_m, column))
    off = torch.zeros_like(zero, dtype=torch.bool)
    mode = torch.full_like(p.operator, CRUISE)
    extra = dynamics.drag_n(state) - dynamics.idle_n(state)
    return state, Pilot(mode, zero, zero, zero, extra, zero, zero, off, off)


def decide(
    dynamics: Dynamics, state: Motion, pilot: Pilot, time_s: float, period_s: float
) -> tuple[Pilot, Controls, Tensor]:
    """Select modes and set the controls of one period.

    Args:
        dynamics: The flights.
        state: Where they are.
        pilot: Memory after the last period.
        time_s: Time since the start.
        period_s: Length of the period.

    Returns:
        The memory at the end of the period, the controls within it, and the drag now.

    Example:
        >>> from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
        >>> from descentflow.simulation.parameters import draw_parameters
        >>> aircraft = open_aircraft("A320")
        >>> dynamics = Dynamics(aircraft, draw_parameters(aircraft, range(2), seed=0))
        >>> pilot, controls, drag_n = decide(dynamics, *start(dynamics), time_s=0.0, period_s=1.0)
        >>> controls.gamma_rate.tolist(), pilot.age_s.tolist()  # still in level cruise
        ([0.0, 0.0], [1.0, 1.0])
    """
    p = dynamics.parameters
    deviation = dynamics.deviation_k(state.altitude_m)
    fraction = isa_fraction(state.altitude_m, deviation)
    rate = state.tas_mps * torch.sin(pilot.gamma) * fraction
    pilot = _select_mode(dynamics, state, pilot, rate, period_s)
    error = state.tas_mps - target_tas_mps(dynamics, state.altitude_m, time_s)
    gamma_rate = _gamma_rate(dynamics, state, pilot, error, fraction, period_s)
    drag, idle = dynamics.drag_n(state), dynamics.idle_n(state)
    limit = dynamics.aircraft.climb_thrust_n(state.altitude_m, state.tas_mps, deviation) - idle
    hold = drag - idle + p.mass_kg * (G0_MPS2 * torch.sin(pilot.gamma) - error / SPEED_LAG_S)
    idling = _kept_n(p.injected, state, pilot, drag - idle) + p.off_idle.power(state.altitude_m) * (drag - idle)
    wanted = torch.where(pilot.mode == IDLE, idling, hold.clamp(min=0.0).minimum(limit.clamp(min=0.0)))
    change = wanted - pilot.extra_n
    extra_rate = change * torch.where(change > 0, _lag(SPOOL_UP_S, period_s), _lag(SPOOL_DOWN_S, period_s))
    controls = Controls(pilot.gamma, gamma_rate, pilot.extra_n, extra_rate)
    after = replace(
        pilot,
        age_s=pilot.age_s + period_s,
        gamma=pilot.gamma + period_s * gamma_rate,
        extra_n=pilot.extra_n + period_s * extra_rate,
        speed_error_mps=error,
    )
    return after, controls, drag


def _lag(constant_s: float, period_s: float) -> float:
    """Share of a change done in a period, for each second of it."""
    return -math.expm1(-period_s / constant_s) / period_s


def _kept_n(injected: Injected, state: Motion, pilot: Pilot, needed_n: Tensor) -> Tensor:
    """Thrust above idle: kept up after the top of descent (not after a level-off or a constant rate), or all along."""
    first = ~pilot.level_off_done & ~pilot.managed_done
    decaying = torch.where(first, injected.kept_share * torch.exp(-pilot.age_s / injected.kept_s), 0.0)
    return (decaying + injected.power(state.altitude_m)) * needed_n


def labels(pilot: Pilot, drag_n: Tensor, injected: Injected) -> Tensor:
    """Phases of flight, as codes of :data:`LABELS`.

    Args:
        pilot: Memory of the autopilot, n flights.
        drag_n: (n,) drag now; an idle descent is settled once the thrust above idle is below 1 % of it.
        injected: Paths and rates that are held on purpose.

    Returns:
        (n,) codes.

    Example:
        >>> from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
        >>> from descentflow.simulation.parameters import draw_parameters
        >>> aircraft = open_aircraft("A320")
        >>> dynamics = Dynamics(aircraft, draw_parameters(aircraft, range(2), seed=0))
        >>> state, pilot = start(dynamics)
        >>> [LABELS[code] for code in labels(pilot, dynamics.drag_n(state), dynamics.parameters.injected)]
        ['transient', 'transient']
    """
    settled = (pilot.mode == IDLE) & (pilot.age_s >= SETTLED_S) & (pilot.extra_n < 0.01 * drag_n)
    level = (pilot.mode == LEVEL_OFF) & (pilot.captured_s > 0)
    managed = ((pilot.mode == MANAGED) | (pilot.mode == SEGMENT)) & (pilot.age_s >= SETTLED_S / 2)
    label = torch.where(settled, IDLE_LABEL, TRANSIENT_LABEL)
    label = torch.where(level, LEVEL_OFF_LABEL, torch.where(managed, MANAGED_LABEL, label))
    held = (pilot.mode == INJECTED) & (pilot.age_s >= SETTLED_S / 2)
    kind = torch.where(injected.hold_angle.isnan(), MANAGED_LABEL, PATH_LABEL)
    return torch.where(held, kind, label)


def _select_mode(dynamics: Dynamics, state: Motion, pilot: Pilot, rate: Tensor, period_s: float) -> Pilot:
    """Pass from mode to mode; comparisons with the NaN of a missing event are false."""
    p, mode = dynamics.parameters, pilot.mode
    flare = -CAPTURE_S * rate
    descends = (mode == IDLE) | (mode == MANAGED) | (mode == INJECTED) | (mode == SEGMENT)
    at_level = descends & ~pilot.level_off_done & (state.altitude_m - p.level_off_m <= flare)
    at_bottom = descends & (state.altitude_m - p.bottom_m <= flare)
    at_managed = (mode == IDLE) & ~pilot.managed_done & (state.altitude_m <= p.managed_m) & (pilot.age_s >= SETTLED_S)
    # The age was counted at the end of the last period, so it is the time in the mode now.
    resumes = (mode == CRUISE) & (pilot.age_s >= p.cruise_s)
    resumes |= (mode == LEVEL_OFF) & (pilot.captured_s >= p.level_off_s)
    resumes |= (mode == MANAGED) & (pilot.age_s >= p.managed_s)
    ends = (mode == BOTTOM) & (pilot.captured_s >= BOTTOM_S)
    resumes |= (mode == INJECTED) & (state.altitude_m <= p.injected.hold_low_m)
    holds = (state.altitude_m <= p.injected.hold_high_m) & (state.altitude_m > p.injected.hold_low_m)
    chosen = torch.where((mode == IDLE) & (pilot.age_s >= SETTLED_S) & holds, INJECTED, mode)
    chosen = torch.where(resumes, IDLE, chosen)
    in_segment = ~p.constant_rates.rate_at_mps(state.altitude_m).isnan()
    chosen = torch.where((chosen == SEGMENT) & ~in_segment, IDLE, chosen)
    chosen = torch.where((chosen == IDLE) & in_segment, SEGMENT, chosen)
    chosen = torch.where(at_managed, MANAGED, chosen)
    chosen = torch.where(at_level, LEVEL_OFF, chosen)
    chosen = torch.where(at_bottom, BOTTOM, chosen)
    chosen = torch.where(ends, DONE, chosen)
    new = chosen != mode
    held = (chosen == LEVEL_OFF) & (state.altitude_m - p.level_off_m < CAPTURED_M)
    held |= (chosen == BOTTOM) & (state.altitude_m - p.bottom_m < CAPTURED_M)
    hundred = 100 * FPM_MPS
    selected = torch.round(p.managed_rate * rate / hundred) * hundred
    return replace(
        pilot,
        mode=chosen,
        age_s=torch.where(new, 0.0, pilot.age_s),
        captured_s=torch.where(held, pilot.captured_s + period_s, 0.0),
        rate_mps=torch.where(new & (chosen == MANAGED), selected, pilot.rate_mps),
        level_off_done=pilot.level_off_done | (chosen == LEVEL_OFF),
        managed_done=pilot.managed_done | (chosen == MANAGED),
    )


def _gamma_rate(
    dynamics: Dynamics, state: Motion, pilot: Pilot, error: Tensor, fraction: Tensor, period_s: float
) -> Tensor:
    """Turn of the path: a damped second-order law in the speed error, or a lag onto the angle of a wanted rate."""
    p = dynamics.parameters
    growth = (error - pilot.speed_error_mps) / period_s
    by_speed = (FREQUENCY_RAD_S**2 * error + 2 * DAMPING * FREQUENCY_RAD_S * growth) / G0_MPS2
    target = torch.where(pilot.mode == BOTTOM, p.bottom_m, p.level_off_m)
    captures = (pilot.mode == LEVEL_OFF) | (pilot.mode == BOTTOM)
    wanted = torch.where(captures, (target - state.altitude_m) / CAPTURE_S, 0.0)
    wanted = torch.where(pilot.mode == MANAGED, pilot.rate_mps, wanted)
    wanted = torch.where(pilot.mode == SEGMENT, p.constant_rates.rate_at_mps(state.altitude_m), wanted)
    sine = wanted / (state.tas_mps * fraction)
    by_angle = torch.tan(p.injected.hold_angle) * (1 + dynamics.wind_mps(state) / state.tas_mps)
    by_rate = p.injected.hold_rate_mps / (state.tas_mps * fraction)
    sine = torch.where(pilot.mode == INJECTED, torch.where(by_angle.isnan(), by_rate, by_angle), sine)
    angle = torch.asin(sine.clamp(-0.3, 0.05))
    by_path = (angle - pilot.gamma) / PATH_LAG_S
    turn = torch.where(pilot.mode == IDLE, by_speed, by_path).clamp(-GAMMA_RATE, GAMMA_RATE)
    if p.speed_changes.share.numel():
        # Who has to lose much speed, or cannot at idle thrust, keeps descending.
        shallowest = -torch.asin((LEAST_FPM * FPM_MPS / (state.tas_mps * fraction)).clamp(max=0.3))
        descends = (pilot.mode == IDLE) & (pilot.gamma + period_s * turn > shallowest)
        back = ((shallowest - pilot.gamma) / period_s).clamp(-GAMMA_RATE, GAMMA_RATE)
        turn = torch.where(descends, back, turn)
    return ((pilot.gamma + period_s * turn).clamp(STEEPEST, 0.02) - pilot.gamma) / period_s
