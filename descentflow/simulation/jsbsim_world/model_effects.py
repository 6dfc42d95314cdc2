"""Effects that are injected in flights of JSBSim's models, in JSBSim's own terms.

Names and values are those of :mod:`descentflow.simulation.causes` where the meaning is the same. Of some the size
differs a little from what the same number means there:

- ``temperature`` is JSBSim's ``delta-T``, added at every geometric height. Pressure follows from it, so the deviation
  from ISA at a *pressure* altitude is smaller aloft: of +10 K some 8 K are left at FL300; the truth table has it.
- ``idle_thrust`` multiplies the engine's table of idle thrust, which is zero below FL200 at descent speeds.
- ``speed_brake`` moves the model's own speed brakes so far that their drag is that share of its drag at no lift; the
  lift that they spoil is lost too. All four models have speed brakes.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from statistics import NormalDist

import numpy as np

from descentflow.core.errors import ConfigError
from descentflow.core.units import FL_M, KT_MPS
from descentflow.simulation.causes.air import KT_PER_KFT
from descentflow.simulation.jsbsim_world.airframes import Airframe
from descentflow.simulation.jsbsim_world.flight_plans import FlightPlan

_STREAM = 4
_DRAWS = 6
Values = Mapping[str, float]


@dataclass(frozen=True)
class Case:
    """One flight that an effect is injected in.

    Example:
        >>> from descentflow.simulation.jsbsim_world.airframes import airframe_of
        >>> from descentflow.simulation.jsbsim_world.flight_plans import JsbsimConfig, draw_plans
        >>> model = airframe_of("MD11")
        >>> case = Case(model, draw_plans(model, [0], 0, JsbsimConfig())[0], uniform=[0.5, 0.3])
        >>> case.chosen(0.4), case.chosen(0.2), case.normal()
        (True, False, 0.0)
    """

    airframe: Airframe
    plan: FlightPlan
    uniform: Sequence[float]
    """Random numbers of this flight for this effect."""

    def chosen(self, share: float) -> bool:
        """Whether the effect takes the flight; the last random number decides."""
        return self.uniform[-1] < share

    def normal(self, index: int = 0) -> float:
        """A random number as a standard normal one."""
        return NormalDist().inv_cdf(min(max(self.uniform[index], 1e-9), 1 - 1e-9))


@dataclass(frozen=True)
class ModelEffect:
    """An effect, the units of its values, and those values that may be left out.

    Example:
        >>> EFFECTS["temperature"].units
        {'mean_k': 'K', 'spread_k': 'K'}
    """

    name: str
    units: Mapping[str, str]
    inject: Callable[[Case, Values], FlightPlan]
    optional: Mapping[str, float] = field(default_factory=dict)
    """Value -> what it is if left out."""


def _warm(case: Case, v: Values) -> FlightPlan:
    return replace(case.plan, deviation_k=case.plan.deviation_k + v["mean_k"] + v["spread_k"] * case.normal())


def _blow(case: Case, v: Values) -> FlightPlan:
    slope = KT_PER_KFT * (v["mean_kt_per_kft"] + v["spread_kt_per_kft"] * case.normal())
    return replace(case.plan, wind_slope_per_s=case.plan.wind_slope_per_s + slope)


def _load(case: Case, v: Values) -> FlightPlan:
    return replace(case.plan, mass_kg=case.plan.mass_kg * v["factor"])


def _idle(case: Case, v: Values) -> FlightPlan:
    return replace(case.plan, idle_factor=case.plan.idle_factor * v["factor"])


def _polar(case: Case, v: Values) -> FlightPlan:
    return replace(case.plan, cd0_factor=case.plan.cd0_factor * v["factor"])


def _induced(case: Case, v: Values) -> FlightPlan:
    return replace(case.plan, cdi_factor=case.plan.cdi_factor * v["factor"])


def _wave(case: Case, v: Values) -> FlightPlan:
    return replace(case.plan, wave_factor=case.plan.wave_factor * v["factor"])


def _extend(case: Case, v: Values) -> FlightPlan:
    command = (v["factor"] - 1) * case.airframe.zero_lift_drag / case.airframe.brake_drag
    if not 0 <= command <= 1:
        most = 1 + case.airframe.brake_drag / case.airframe.zero_lift_drag
        raise ConfigError(
            f"speed brakes of the {case.airframe.name} at a factor of {v['factor']:g}",
            expected=f"a factor from 1 to {most:.2f}, brakes fully out",
            mend="choose a factor within it",
        )
    if not case.chosen(v["share"]):
        return case.plan
    shift = v["spread_fl"] * case.normal()
    high, low = ((v[name] + shift) * FL_M for name in ("high_fl", "low_fl"))
    return replace(case.plan, brake=command, brake_high_m=high, brake_low_m=low)


def _hold_path(case: Case, v: Values) -> FlightPlan:
    p = case.plan
    if not case.chosen(v["share"]):
        return p
    return replace(p, hold_high_m=p.top_m, hold_low_m=p.bottom_m, hold_of_idle=v["of_idle"], hold_path=True)


def _hold_rate(case: Case, v: Values) -> FlightPlan:
    p, depth = case.plan, v["depth_fl"] * FL_M
    if not case.chosen(v["share"]):
        return p
    room = max(p.top_m - p.bottom_m - depth - 50 * FL_M, 0.0)
    low = p.bottom_m + 20 * FL_M + room * case.uniform[0]
    high = min(low + depth, p.top_m - 20 * FL_M)
    return replace(p, hold_high_m=high, hold_low_m=low, hold_of_idle=v["of_idle"], hold_path=False)


def _keep(case: Case, v: Values) -> FlightPlan:
    return replace(case.plan, kept_share=v["share"], kept_s=v["decay_s"])


def _set_idle(case: Case, v: Values) -> FlightPlan:
    return replace(case.plan, idle_setting=v["lever"])


def _speeds(case: Case, v: Values) -> FlightPlan:
    return replace(case.plan, cas_mps=case.plan.cas_mps + v["cas_kt"] * KT_MPS, mach=case.plan.mach + v["mach"])


def _misread(case: Case, v: Values) -> FlightPlan:
    slope = v["slope_kt_per_mach"] * KT_MPS
    return replace(case.plan, cas_bias_mps=v["bias_kt"] * KT_MPS, cas_bias_slope_mps=slope)


def _delay(case: Case, v: Values) -> FlightPlan:
    return replace(case.plan, rate_lag_s=v["lag_s"])


def _scatter(case: Case, v: Values) -> FlightPlan:
    return replace(case.plan, noise_factor=v["factor"])


_FACTOR = {"factor": "1"}
_WIND = {"mean_kt_per_kft": "kt/1000 ft", "spread_kt_per_kft": "kt/1000 ft"}
_BRAKE = {"factor": "1", "share": "1", "low_fl": "FL", "high_fl": "FL", "spread_fl": "FL"}

EFFECTS = {
    effect.name: effect
    for effect in (
        ModelEffect("temperature", {"mean_k": "K", "spread_k": "K"}, _warm),
        ModelEffect("wind_gradient", _WIND, _blow),
        ModelEffect("mass", _FACTOR, _load),
        ModelEffect("idle_thrust", _FACTOR, _idle),
        ModelEffect("drag_polar", _FACTOR, _polar),
        ModelEffect("speed_brake", _BRAKE, _extend, {"spread_fl": 0.0}),
        ModelEffect("geometric_path", {"share": "1", "of_idle": "1"}, _hold_path),
        ModelEffect("vertical_speed_mode", {"share": "1", "of_idle": "1", "depth_fl": "FL"}, _hold_rate),
        ModelEffect("speed_schedule", {"cas_kt": "kt", "mach": "1"}, _speeds),
        ModelEffect("airspeed_bias", {"bias_kt": "kt", "slope_kt_per_mach": "kt"}, _misread),
        ModelEffect("vertical_rate_lag", {"lag_s": "s"}, _delay),
        ModelEffect("measurement_noise", _FACTOR, _scatter),
        ModelEffect("kept_thrust", {"share": "1", "decay_s": "s"}, _keep),
        ModelEffect("idle_setting", {"lever": "1"}, _set_idle),
        ModelEffect("induced_drag", _FACTOR, _induced),
        ModelEffect("wave_drag", _FACTOR, _wave),
    )
}
"""Effects by name, in the order in which they are injected. The last four have no entry in the diagnosis's catalogue:
thrust kept up after the top of descent, a thrust lever left at a setting (0 to 1), and factors of the model's induced
drag and of its drag due to Mach. ``spread_fl`` of the speed brakes shifts each flight's window by its own amount."""


def checked(effects: Mapping[str, Values]) -> dict[str, dict[str, float]]:
    """Complete the values of effects by those that may be left out.

    Args:
        effects: Values by the name of the effect.

    Raises:
        ConfigError: If an effect or a value is unknown, missing or not finite.

    Example:
        >>> checked({"speed_brake": {"factor": 1.6, "share": 1, "low_fl": 240, "high_fl": 290}})
        {'speed_brake': {'spread_fl': 0.0, 'factor': 1.6, 'share': 1, 'low_fl': 240, 'high_fl': 290}}
    """
    complete = {}
    for name, values in effects.items():
        effect = EFFECTS.get(name)
        given = {**effect.optional, **values} if effect else {}
        if effect is None or set(given) != set(effect.units) or not all(map(math.isfinite, given.values())):
            raise ConfigError(
                f"to inject {name} with {', '.join(f'{k}={v}' for k, v in values.items()) or 'nothing'}",
                expected="; ".join(f"{one.name} with {', '.join(one.units)}" for one in EFFECTS.values()),
                mend="name an effect and all of its values, each a finite number",
            )
        complete[name] = given
    return complete


def inject(
    airframe: Airframe, plans: Sequence[FlightPlan], effects: Mapping[str, Values], seed: int
) -> list[FlightPlan]:
    """Inject effects; what a flight gets depends on the seed, its number and the effect alone.

    Args:
        airframe: The model.
        plans: The flights.
        effects: Values by the name of the effect.
        seed: Seed of the flights.

    Returns:
        The flights with the effects.

    Raises:
        ConfigError: If an effect is unknown or its values cannot be.

    Example:
        >>> from descentflow.simulation.jsbsim_world.airframes import airframe_of
        >>> from descentflow.simulation.jsbsim_world.flight_plans import JsbsimConfig, draw_plans
        >>> plans = draw_plans(airframe_of("MD11"), range(1), 0, JsbsimConfig())
        >>> heavier = inject(airframe_of("MD11"), plans, {"mass": {"factor": 1.1}}, seed=0)
        >>> round(heavier[0].mass_kg / plans[0].mass_kg, 6)
        1.1
    """
    complete, changed = checked(effects), list(plans)
    for index, (name, effect) in enumerate(EFFECTS.items()):
        if name in complete:
            uniform = [np.random.default_rng((seed, p.number, _STREAM, index)).random(_DRAWS).tolist() for p in changed]
            changed = [
                effect.inject(Case(airframe, p, u), complete[name]) for p, u in zip(changed, uniform, strict=True)
            ]
    return changed
