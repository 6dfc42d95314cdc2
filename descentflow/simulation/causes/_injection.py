"""One or several causes injected in the flights of a world."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

from descentflow.physics.performance_model import PerformanceModel
from descentflow.simulation.causes._operation import hold_path, hold_rate, level_off, plan
from descentflow.simulation.causes.air_and_instruments import blow, delay, misread, scatter, warm
from descentflow.simulation.causes.cause import Fleet, Inject
from descentflow.simulation.causes.forces import compress, extend, heat, induce, keep, multiply, power, turn
from descentflow.simulation.parameters import FlightParameters
from descentflow.simulation.planned_changes import uniform_of
from descentflow.simulation.plantable import Values, complete

_STREAM, _DAY_STREAM, _AIRFRAME_STREAM = 4, 6, 7
"""Of random numbers of flights, days and airframes; a flight's own in the world are 0 to 3, and 5."""
_DRAWS = 6
CAUSES: dict[str, tuple[int, Inject]] = {
    "temperature": (0, warm),
    "wind_gradient": (1, blow),
    "mass": (2, multiply("mass_kg")),
    "idle_thrust": (3, multiply("thrust_factor")),
    "drag_polar": (4, multiply("cd0_factor")),
    "speed_brake": (5, extend),
    "turn": (15, turn),
    "level_off": (8, level_off),
    "speed_schedule": (9, plan),
    "airspeed_bias": (10, misread),
    "vertical_rate_lag": (11, delay),
    "measurement_noise": (12, scatter),
    "compressibility": (13, compress),
    "kept_thrust": (14, keep),
    "anti_ice": (17, heat),
    "induced_drag": (16, induce),
    "powered_descent": (18, power),
    "geometric_path": (6, hold_path),
    "vertical_speed_mode": (7, hold_rate),
}
"""Every cause -> its stream of random numbers, and what it does, in the order in which they act: a path or a rate is
planned for the speeds, the drag and the air that the flight really meets."""


@dataclass(frozen=True)
class Injection:
    """Injects causes in the flights of a world: the ``inject`` of :func:`descentflow.simulation.world.simulate`.

    What a flight gets depends on the seed, its own number, its day, its airframe and the cause alone. Causes act in
    the order of ``CAUSES``. Values that are left out take their
    defaults.

    Example:
        >>> from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
        >>> from descentflow.simulation.parameters import draw_parameters
        >>> aircraft = open_aircraft("A320")
        >>> inject = Injection(aircraft, {"mass": {"factor": 0.9}}, seed=3)
        >>> plain = draw_parameters(aircraft, range(4), seed=3)
        >>> inject(plain).mass_kg / plain.mass_kg
        tensor([0.9000, 0.9000, 0.9000, 0.9000], dtype=torch.float64)
        >>> list(inject(plain).planted)  # what each flight has got
        ['mass_factor']
    """

    aircraft: PerformanceModel
    causes: Mapping[str, Values]
    """Values of each cause by its name."""
    seed: int

    def __post_init__(self) -> None:
        """Refuse causes and values that do not exist."""
        object.__setattr__(self, "causes", complete(self.causes))

    def __call__(self, parameters: FlightParameters) -> FlightParameters:
        """Inject every cause."""
        for name, (cause, inject) in CAUSES.items():
            if name in self.causes:
                uniform = uniform_of(parameters.number.tolist(), self.seed, (_STREAM, cause), _DRAWS)
                daily = uniform_of(parameters.day.tolist(), self.seed, (_DAY_STREAM, cause), 1)
                airframe = uniform_of(parameters.airframe.tolist(), self.seed, (_AIRFRAME_STREAM, cause), 1)
                parameters, own = inject(Fleet(self.aircraft, parameters, uniform, daily, airframe), self.causes[name])
                planted = {f"{name}_{value}": tensor for value, tensor in own.items()}
                parameters = replace(parameters, planted={**parameters.planted, **planted})
        return parameters
