"""The two worlds of a study: what is flown in each, what can be planted there, and how its simulators are wrong."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from descentflow.simulation.causes import CATALOGUED, CAUSES, OUTSIDE
from studies.blind_diagnosis.blind_plan import REFERENCE_FLIGHTS, Causes, World
from studies.jsbsim_world.airframes import AIRFRAMES

Draw = Callable[[np.random.Generator, float], dict[str, float]]
_OF_JSBSIM: Mapping[str, Draw] = {
    "idle_setting": lambda generator, size: {"lever": 0.2 * size},
    "wave_drag": lambda generator, size: {"factor": 1 + 3.0 * size},
}
"""In JSBSim's own terms. Full sizes: a lever left at 20 %, which slows a descent by some 10 % at all levels and so is
nearly more idle thrust; four times the drag due to Mach, which adds a quarter and more to the rate near the top."""


@dataclass(frozen=True)
class StudyWorld:
    """World of a study: its flights and the causes planted in them.

    Example:
        >>> OWN.values(np.random.default_rng(0), "mass", 1.0, vary=False)
        ({'factor': 1.1}, False)
        >>> sorted(FOREIGN.models)
        ['787-8', 'B747', 'MD11', 'fokker100', 'global5000']
    """

    name: World
    models: Mapping[str, float]
    """Types or models flown, and the share of each."""
    catalogued: tuple[str, ...]
    outside: tuple[str, ...]
    strong: tuple[str, ...]
    """Catalogued causes that may hide another."""
    beside: tuple[str, ...]
    """The causes that they may hide, which the catalogue does not have."""
    flights: tuple[tuple[int, float], ...]
    """Flights of a set, and how often."""
    reference_flights: int
    """Of a simulator."""
    pool: tuple[int, int]
    """Simulators of a model that sets with a cause share: with the right polar, and with a wrong one."""
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

    def values(
        self, generator: np.random.Generator, name: str, size: float, *, vary: bool
    ) -> tuple[dict[str, float], bool]:
        """Draw what is planted of a cause.

        Args:
            generator: Of random numbers.
            name: Of the cause.
            size: 1 for full.
            vary: Whether flights are to differ, where they can.

        Returns:
            Its values, and whether flights differ.
        """
        if name in _OF_JSBSIM:
            return _OF_JSBSIM[name](generator, size), False
        cause = CAUSES[name]
        values = cause.draw(generator, size)
        if cause.vary is None or not (vary or name in self.always_vary):
            return values, False
        return values | cause.vary(generator, size), True

    def wrong_polar(self, generator: np.random.Generator) -> Causes:
        """Draw how the polar of a simulator is wrong: CD0, CD2, or drag due to Mach."""
        return {"own": _own_polar, "foreign": _foreign_polar}[self.name](generator)


def _own_polar(generator: np.random.Generator) -> Causes:
    return [
        {"drag_polar": {"factor": float(generator.choice([0.96, 1.04]))}},
        {"induced_drag": {"factor": float(generator.choice([0.9, 1.1]))}},
        {"compressibility": {"gain": 0.1, "onset_below": float(generator.uniform(0.06, 0.12))}},
    ][int(generator.integers(3))]


def _foreign_polar(generator: np.random.Generator) -> Causes:
    return [
        {"drag_polar": {"factor": float(generator.choice([0.96, 1.04]))}},
        {"induced_drag": {"factor": float(generator.choice([0.9, 1.1]))}},
    ][int(generator.integers(2))]


OWN = StudyWorld(
    name="own",
    models={"A320": 0.5, "B738": 0.2, "E190": 0.2, "B772": 0.1},
    catalogued=tuple(cause.name for cause in CATALOGUED),
    outside=tuple(cause.name for cause in OUTSIDE),
    strong=("temperature", "speed_brake", "airspeed_bias", "speed_schedule"),
    beside=("kept_thrust", "anti_ice", "powered_descent"),
    flights=((400, 0.8), (200, 0.1), (1000, 0.08), (2000, 0.02)),
    reference_flights=REFERENCE_FLIGHTS,
    pool=(6, 3),
)
FOREIGN = StudyWorld(
    name="foreign",
    models=dict.fromkeys(AIRFRAMES, 1 / len(AIRFRAMES)),
    # Idle thrust of these models is nothing below FL200, and level-offs and turns are not flown.
    catalogued=tuple(cause.name for cause in CATALOGUED if cause.name not in ("idle_thrust", "level_off", "turn")),
    outside=("kept_thrust", "anti_ice", "wave_drag"),
    strong=("temperature", "speed_brake", "airspeed_bias"),
    beside=("kept_thrust", "idle_setting"),
    flights=((150, 1.0),),
    reference_flights=200,
    pool=(3, 1),
    always_vary=("speed_brake",),
    # The drag due to Mach of the business jet adds 4 % to the rate at the very top.
    only={"wave_drag": ("787-8", "MD11", "B747")},
)
WORLDS = (OWN, FOREIGN)
"""Both."""
