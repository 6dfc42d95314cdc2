"""Key of a study, with all that is hidden in its sets: written before anything else."""

from dataclasses import asdict, dataclass
from typing import Any, Literal

Part = Literal["blind", "withheld"]
Kind = Literal["null", "single", "double", "triple", "outside"]
"""Nothing; one, two or three catalogued causes; one outside the catalogue."""
World = Literal["own", "foreign"]
"""Our point mass, or JSBSim's aircraft."""
Form = Literal["checkpoint", "flights", "no_air", "bare", "one"]
"""Forms of a simulator: a checkpoint trained on its flights; those flights; flights without weather; without
weather and noise of reports; those of one mass and one planned speed."""
FORMS: tuple[Form, ...] = ("checkpoint", "flights", "no_air", "bare", "one")
BARE: tuple[Form, ...] = ("no_air", "bare", "one")
"""Simulators as users have them."""
Causes = dict[str, dict[str, float]]

SCALE_GROUP = frozenset({"mass", "idle_thrust", "drag_polar"})
"""Only their common scale shows in what is observed, so two of them are one."""
HOLDING = frozenset({"geometric_path", "vertical_speed_mode"})
"""A flight can hold one of them only."""
LEAST_FULL = 0.7
"""Sizes below are called half."""


@dataclass(frozen=True)
class SimulatorPlan:
    """A simulator, in every form: flights of its own, and a model trained on them.

    Example:
        >>> SimulatorPlan("simulator_000", seed=8, world="own", model="A320", flights=400).flights
        400
    """

    name: str
    seed: int
    world: World
    model: str
    """Type flown, or JSBSim's model."""
    flights: int


@dataclass(frozen=True)
class SetPlan:
    """Flights to be diagnosed.

    Example:
        >>> one = SetPlan("blind_0000", "blind", "null", {}, 0.0, "all", 400, "simulator_000", 11, "own", "A320")
        >>> one.flights, one.causes, one.full
        (400, {}, False)
    """

    name: str
    part: Part
    kind: Kind
    causes: Causes
    size: float
    """Of its smallest cause; 0 for none, 1 for full size."""
    channels: Literal["all", "basic"]
    """``basic`` is without TAS, groundspeed, angles and geometric altitude."""
    flights: int
    simulator: str
    seed: int
    world: World
    model: str
    closure: bool = False
    """True if its corrected flights are kept, to be judged by fresh flights; drawn without regard to its causes."""

    @property
    def full(self) -> bool:
        """True if every cause has its full size."""
        return self.size >= LEAST_FULL


@dataclass(frozen=True)
class Plan:
    """The key of a study.

    Example:
        >>> plan = Plan(0, "00", (), (SimulatorPlan("simulator_000", 8, "own", "A320", 400),))
        >>> Plan.from_dict(plan.as_dict()) == plan
        True
    """

    seed: int
    nonce: str
    """Makes the hash of the key impossible to guess from a list of likely keys."""
    sets: tuple[SetPlan, ...]
    simulators: tuple[SimulatorPlan, ...]

    def as_dict(self) -> dict[str, Any]:
        """Primitives, for JSON."""
        return asdict(self)

    @classmethod
    def from_dict(cls, key: dict[str, Any]) -> "Plan":
        """Rebuild from :meth:`as_dict`."""
        sets = tuple(SetPlan(**fields) for fields in key["sets"])
        return cls(key["seed"], key["nonce"], sets, tuple(SimulatorPlan(**fields) for fields in key["simulators"]))
