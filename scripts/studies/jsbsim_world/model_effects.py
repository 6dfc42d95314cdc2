"""Effects that are injected in flights of JSBSim's models, in JSBSim's own terms.

Names and values are those of :mod:`descentflow.simulation.causes` where the meaning is the same. Of some the size
differs a little from what the same number means there:

- ``temperature`` is JSBSim's ``delta-T``, added at every geometric height. Pressure follows from it, so the deviation
  from ISA at a *pressure* altitude is smaller aloft: of +10 K some 8 K are left at FL300; the truth table has it.
- ``idle_thrust`` multiplies the engine's table of idle thrust, which is zero below FL200 at descent speeds.
- ``speed_brake`` moves the model's own speed brakes so far that their drag is that share of its drag at no lift; the
  lift that they spoil is lost too. All four models have speed brakes.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from statistics import NormalDist
from typing import Any

import numpy as np

from descentflow.core.errors import ConfigError
from descentflow.core.units import FL_M, KT_MPS
from descentflow.simulation.causes.air_and_instruments import KT_PER_KFT
from descentflow.simulation.causes.forces import LEAST_FACTOR, NARROWEST_FL
from descentflow.simulation.plantable import PLANTABLE, CauseValue, Plantable, Values, complete
from studies.jsbsim_world.airframes import Airframe
from studies.jsbsim_world.flight_plans import FlightPlan

_STREAM, _DAY_STREAM, _AIRFRAME_STREAM = 4, 6, 7
_DRAWS = 6


@dataclass(frozen=True)
class Case:
    """One flight that an effect is injected in.

    Example:
        >>> from studies.jsbsim_world.airframes import airframe_of
        >>> from studies.jsbsim_world.flight_plans import JsbsimConfig, draw_plans
        >>> model = airframe_of("MD11")
        >>> plan = draw_plans(model, [0], 0, JsbsimConfig())[0]
        >>> case = Case(model, plan, uniform=[0.5, 0.3], daily=0.0, by_airframe=0.0)
        >>> case.chosen(0.4), case.chosen(0.2), case.normal()
        (True, False, 0.0)
    """

    airframe: Airframe
    plan: FlightPlan
    uniform: Sequence[float]
    """Random numbers of this flight for this effect."""
    daily: float
    """A standard normal number that flights of the day share."""
    by_airframe: float
    """One that flights of the airframe share."""

    def chosen(self, share: float) -> bool:
        """True if the effect takes the flight; the last random number decides."""
        return self.uniform[-1] < share

    def normal(self, index: int = 0) -> float:
        """A random number as a standard normal one."""
        return _normal(self.uniform[index])

    def about(self, middle: float, half_width: float, index: int) -> float:
        """A number of the flight's own, uniform about a middle."""
        return middle + half_width * (2 * self.uniform[index] - 1)


def _normal(uniform: float) -> float:
    return NormalDist().inv_cdf(min(max(uniform, 1e-9), 1 - 1e-9))


def _warm(case: Case, v: Values) -> FlightPlan:
    own = v["deviation_k"] + v["spread_k"] * case.normal() + v["daily_spread_k"] * case.daily
    return replace(case.plan, deviation_k=case.plan.deviation_k + own)


def _blow(case: Case, v: Values) -> FlightPlan:
    own = v["slope_kt_per_kft"] + v["spread_kt_per_kft"] * case.normal() + v["daily_spread_kt_per_kft"] * case.daily
    return replace(case.plan, wind_slope_per_s=case.plan.wind_slope_per_s + KT_PER_KFT * own)


def _multiply(name: str) -> Callable[[Case, Values], FlightPlan]:
    """Multiply a number of the plan by a factor of the flight's own, if it is taken."""

    def inject(case: Case, v: Values) -> FlightPlan:
        factor = max(v["factor"] + v["spread"] * case.normal(), LEAST_FACTOR) if case.chosen(v["share"]) else 1.0
        changed: dict[str, Any] = {name: getattr(case.plan, name) * factor}
        return replace(case.plan, **changed)

    return inject


def _induced(case: Case, v: Values) -> FlightPlan:
    return replace(case.plan, cdi_factor=case.plan.cdi_factor * v["factor"])


def _wave(case: Case, v: Values) -> FlightPlan:
    return replace(case.plan, wave_factor=case.plan.wave_factor * v["factor"])


def _extend(case: Case, v: Values) -> FlightPlan:
    full = case.airframe.brake_drag / case.airframe.zero_lift_drag
    if v["factor"] - 1 > full:
        raise ConfigError(
            f"speed brakes of the {case.airframe.name} at a factor of {v['factor']:g}",
            expected=f"a factor from 1 to {1 + full:.2f}, brakes fully out",
            mend="choose a factor within it",
        )
    if not case.chosen(v["share"]):
        return case.plan
    shift, deeper, stronger = (max(-3.0, min(3.0, case.normal(k))) for k in range(3))
    command = (v["factor"] - 1) / full * (1 + v["strength_spread"] * stronger)
    middle = (v["low_fl"] + v["high_fl"]) / 2 + v["spread_fl"] * shift
    half = max((v["high_fl"] - v["low_fl"]) * (1 + v["depth_spread"] * deeper), NARROWEST_FL) / 2
    high, low = (middle + half) * FL_M, (middle - half) * FL_M
    return replace(case.plan, brake=max(0.0, min(1.0, command)), brake_high_m=high, brake_low_m=low)


def _hold_path(case: Case, v: Values) -> FlightPlan:
    p = case.plan
    if not case.chosen(v["share"]):
        return p
    of_idle = case.about(v["of_idle"], v["of_idle_range"], 1)
    return replace(p, hold_high_m=p.top_m, hold_low_m=p.bottom_m, hold_of_idle=of_idle, hold_path=True)


def _hold_rate(case: Case, v: Values) -> FlightPlan:
    p, depth = case.plan, case.about(v["depth_fl"], v["depth_range_fl"], 2) * FL_M
    if not case.chosen(v["share"]):
        return p
    room = max(p.top_m - p.bottom_m - depth - 50 * FL_M, 0.0)
    low = p.bottom_m + 20 * FL_M + room * case.uniform[0]
    high = min(low + depth, p.top_m - 20 * FL_M)
    of_idle = case.about(v["of_idle"], v["of_idle_range"], 1)
    return replace(p, hold_high_m=high, hold_low_m=low, hold_of_idle=of_idle, hold_path=False)


def _keep(case: Case, v: Values) -> FlightPlan:
    if not case.chosen(v["of_flights"]):
        return case.plan
    share, decay = case.about(v["share"], v["share_range"], 0), case.about(v["decay_s"], v["decay_range_s"], 1)
    return replace(case.plan, kept_share=share, kept_s=decay)


def _heat(case: Case, v: Values) -> FlightPlan:
    if not case.chosen(v["share"]):
        return case.plan
    shift = v["spread_fl"] * case.normal()
    low, high = ((v[f"{end}_fl"] + shift) * FL_M for end in ("low", "high"))
    return replace(case.plan, ice_share=v["drag_share"], ice_low_m=low, ice_high_m=high)


def _set_idle(case: Case, v: Values) -> FlightPlan:
    return replace(case.plan, idle_setting=v["lever"])


def _speeds(case: Case, v: Values) -> FlightPlan:
    if not case.chosen(v["share"]):
        return case.plan
    cas = (v["cas_kt"] + v["spread_kt"] * case.normal()) * KT_MPS
    return replace(case.plan, cas_mps=case.plan.cas_mps + cas, mach=case.plan.mach + v["mach"])


def _misread(case: Case, v: Values) -> FlightPlan:
    bias, slope = v["bias_kt"] + v["spread_kt"] * case.by_airframe, v["slope_kt_per_mach"]
    return replace(case.plan, cas_bias_mps=bias * KT_MPS, cas_bias_slope_mps=slope * KT_MPS)


def _delay(case: Case, v: Values) -> FlightPlan:
    return replace(case.plan, rate_lag_s=max(v["lag_s"] + v["spread_s"] * case.by_airframe, 0.0))


def _scatter(case: Case, v: Values) -> FlightPlan:
    return replace(case.plan, noise_factor=v["factor"])


_INJECT: dict[str, Callable[[Case, Values], FlightPlan]] = {
    "temperature": _warm,
    "wind_gradient": _blow,
    "mass": _multiply("mass_kg"),
    "idle_thrust": _multiply("idle_factor"),
    "drag_polar": _multiply("cd0_factor"),
    "speed_brake": _extend,
    "geometric_path": _hold_path,
    "vertical_speed_mode": _hold_rate,
    "speed_schedule": _speeds,
    "airspeed_bias": _misread,
    "vertical_rate_lag": _delay,
    "measurement_noise": _scatter,
    "kept_thrust": _keep,
    "idle_setting": _set_idle,
    "induced_drag": _induced,
    "wave_drag": _wave,
    "anti_ice": _heat,
}
"""In the order in which they are injected."""
_OWN = {
    "idle_setting": Plantable(
        "the thrust lever left at a setting in the descent",
        (CauseValue("lever", "1", 0.12, 0.0, 1.0, "lever, 0 at idle and 1 at full thrust"),),
    ),
    "wave_drag": Plantable(
        "more or less of the model's drag due to Mach",
        (CauseValue("factor", "1", 3.0, 0.0, 20.0, "factor of that drag"),),
    ),
}
EFFECTS: dict[str, Plantable] = {name: _OWN.get(name) or PLANTABLE[name] for name in _INJECT}
"""Effects by name. The last five have no entry in the diagnosis's catalogue: thrust kept up after the top of descent, a
thrust lever left at a setting, factors of the model's induced drag and of its drag due to Mach, and anti-ice."""


def inject(
    airframe: Airframe,
    plans: Sequence[FlightPlan],
    effects: Mapping[str, Values],
    seed: int,
    flights_per_aircraft: int = 5,
) -> list[FlightPlan]:
    """Inject effects; what a flight gets depends on the seed, its number and the effect alone.

    Args:
        airframe: The model.
        plans: The flights.
        effects: Values by the name of the effect.
        seed: Seed of the flights.
        flights_per_aircraft: Consecutive numbers are an aircraft's, on consecutive days.

    Returns:
        The flights with the effects.

    Raises:
        ConfigError: If there is no such effect or value, or it cannot be flown.

    Example:
        >>> from studies.jsbsim_world.airframes import airframe_of
        >>> from studies.jsbsim_world.flight_plans import JsbsimConfig, draw_plans
        >>> plans = draw_plans(airframe_of("MD11"), range(1), 0, JsbsimConfig())
        >>> heavier = inject(airframe_of("MD11"), plans, {"mass": {"factor": 1.1}}, seed=0)
        >>> round(heavier[0].mass_kg / plans[0].mass_kg, 6)
        1.1
    """
    values = complete(effects, EFFECTS)
    changed = list(plans)
    for index, (name, change) in enumerate(_INJECT.items()):
        if name in values:
            cases = [_case(airframe, plan, seed, index, flights_per_aircraft) for plan in changed]
            changed = [change(case, values[name]) for case in cases]
    return changed


def _case(airframe: Airframe, plan: FlightPlan, seed: int, index: int, flights_per_aircraft: int) -> Case:
    """A flight with its random numbers for an effect."""
    number, day = divmod(plan.number, flights_per_aircraft)
    uniform = np.random.default_rng((seed, plan.number, _STREAM, index)).random(_DRAWS).tolist()
    shared = ((day, _DAY_STREAM), (number, _AIRFRAME_STREAM))
    daily, by_airframe = (_normal(np.random.default_rng((seed, k, stream, index)).random()) for k, stream in shared)
    return Case(airframe, plan, uniform, daily, by_airframe)
