"""The two worlds of a study: what is flown in each, what can be planted there, and the forms of its simulators."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from descentflow.aircraft_types.registry import aircraft as find_aircraft
from descentflow.simulation.world_config import Operator, WorldConfig, default_operators
from studies.blind_diagnosis.blind_plan import Form, World
from studies.blind_diagnosis.drawn_causes import CATALOGUED, DRAWN, OUTSIDE, Draw
from studies.jsbsim_world.airframes import AIRFRAMES
from studies.jsbsim_world.flight_plans import JsbsimConfig

_OF_JSBSIM: Mapping[str, Draw] = {
    "idle_setting": lambda generator, size: {"lever": 0.2 * size},
    "wave_drag": lambda generator, size: {"factor": 1 + 3.0 * size},
}
"""In JSBSim's own terms. Full sizes: a lever left at 20 %, which slows a descent by some 10 % at all levels and so is
nearly more idle thrust; four times the drag due to Mach, which adds a quarter and more to the rate near the top."""

NO_NOISE = WorldConfig(
    level_off_share=0.0,
    managed_share=0.0,
    gap_share=0.0,
    dropout_share=0.0,
    rate_noise_fpm=0.0,
    rate_smoothing_s=0.0,
    cas_noise_kt=0.0,
    mach_noise=0.0,
    tas_noise_kt=0.0,
    altitude_noise_ft=0.0,
    wander_kt=0.0,
    cas_spread_kt=5.0,
)
"""A simulator that writes what it flies: no weather, noise of reports, level-offs or held rates."""
DAYS_OF_WEATHER = replace(
    WorldConfig(),
    cas_spread_kt=5.0,
    deviation_spread_k=1.0,
    shear_spread_per_s=0.003,
    layer_spread_k=1.5,
    layers_own_share=0.3,
    jet_mps=(15.0, 65.0),
    jet_depth_m=4700.0,
    daily_spread_k=3.5,
    days=40,
)
"""Forty days of winter: a mostly westerly jet of 30 to 130 kt, its core between FL300 and FL400, and layers of wind and
temperature that are mostly the day's."""


def own_scenario(form: Form, model: str) -> WorldConfig:
    """Settings of our world for the real flights (those of ``flights``) and for each form of a simulator.

    Example:
        >>> own_scenario("one", "A320").thrust_spread
        0.0
    """
    if form == "no_air":
        return WorldConfig(cas_spread_kt=5.0)
    if form == "bare":
        return NO_NOISE
    if form == "one":
        alike = replace(NO_NOISE, cas_spread_kt=0.0, mach_spread=0.0, thrust_spread=0.0, cd0_spread=0.0)
        return replace(alike, operators=(_mean_operator(model),), mass_range=(0.875, 0.875))
    return DAYS_OF_WEATHER


def _mean_operator(model: str) -> Operator:
    """Mean of the operators' planned speeds: a simulator of one trajectory is set to the fleet's."""
    every = default_operators(find_aircraft(model))
    shares = np.array([operator.share for operator in every]) / sum(operator.share for operator in every)
    cas, mach = (float(shares @ [getattr(operator, name) for operator in every]) for name in ("cas_kt", "mach"))
    return Operator("ONE", 1.0, cas, mach)


def foreign_scenario(form: Form, model: str) -> JsbsimConfig:
    """The same of JSBSim's aircraft.

    Example:
        >>> foreign_scenario("flights", "787-8").deviation_spread_k, foreign_scenario("one", "787-8").alike
        (3.0, True)
    """
    step_s = AIRFRAMES[model].step_s
    if form == "no_air":
        return JsbsimConfig(step_s=step_s)
    if form in ("bare", "one"):
        return JsbsimConfig(step_s=step_s, wander_kt=0.0, radar=NO_NOISE, alike=form == "one")
    return JsbsimConfig(step_s=step_s, deviation_spread_k=3.0, radar=DAYS_OF_WEATHER)


@dataclass(frozen=True)
class StudyWorld:
    """World of a study: its flights and the causes planted in them.

    Example:
        >>> OWN.values(np.random.default_rng(0), "mass", 1.0, vary=False)
        {'factor': 1.1}
        >>> sorted(FOREIGN.models)
        ['B747', 'MD11', 'fokker100']
    """

    name: World
    models: Mapping[str, float]
    """Types or models flown, and the share of each."""
    catalogued: tuple[str, ...]
    outside: tuple[str, ...]
    flights: tuple[tuple[int, float], ...]
    """Flights of a set, and how often."""
    reference_flights: int
    """Of a simulator."""
    pool: int
    """Simulators of a model that sets with a cause share."""
    null_pool: int | None
    """Simulators of a model that sets without a cause share; None for one each."""
    always_vary: tuple[str, ...] = ()
    """Causes that always differ between flights."""
    only: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    """Models in which a cause shows, where it does not in all."""

    def model(self, generator: np.random.Generator, causes: Sequence[str]) -> str:
        """Draw a model in which causes show.

        Args:
            generator: Of random numbers.
            causes: Their names.
        """
        models = [m for m in self.models if all(m in self.only.get(cause, self.models) for cause in causes)]
        odds = np.array([self.models[m] for m in models])
        return str(generator.choice(models, p=odds / odds.sum()))

    def values(self, generator: np.random.Generator, name: str, size: float, *, vary: bool) -> dict[str, float]:
        """Draw what is planted of a cause.

        Args:
            generator: Of random numbers.
            name: Of the cause.
            size: 1 for full.
            vary: Whether flights are to differ, where they can.

        Returns:
            Its values.
        """
        if name in _OF_JSBSIM:
            return _OF_JSBSIM[name](generator, size)
        draw, differ = DRAWN[name]
        values = draw(generator, size)
        if differ is None or not (vary or name in self.always_vary):
            return values
        return values | differ(generator, size)


_NAMED = tuple(name for name in CATALOGUED if name != "measurement_noise")
"""Noise of reports is no cause: it is listed as what the simulator lacks."""
OWN = StudyWorld(
    name="own",
    models={"A320": 0.4, "B738": 0.2, "E190": 0.2, "B772": 0.2},
    catalogued=_NAMED,
    outside=OUTSIDE,
    flights=((120, 1.0),),
    reference_flights=160,
    pool=2,
    null_pool=2,
)
FOREIGN = StudyWorld(
    name="foreign",
    models=dict.fromkeys(("MD11", "B747", "fokker100"), 1 / 3),
    # Idle thrust of these models is nothing below FL200, and level-offs and turns are not flown.
    catalogued=tuple(name for name in _NAMED if name not in ("idle_thrust", "level_off", "turn")),
    outside=("kept_thrust", "anti_ice", "wave_drag"),
    flights=((50, 1.0),),
    reference_flights=60,
    pool=1,
    null_pool=1,
    always_vary=("speed_brake",),
    # The drag due to Mach of the Fokker adds little at its speeds.
    only={"wave_drag": ("MD11", "B747")},
)
