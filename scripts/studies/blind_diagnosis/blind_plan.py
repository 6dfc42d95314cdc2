"""Key of a study, with all that is hidden in its sets: written before anything else."""

from dataclasses import asdict, dataclass, field
from typing import Any, Literal

Part = Literal["blind", "withheld", "refit"]
Kind = Literal["null", "single", "double", "outside", "mixed", "polar"]
"""Nothing; one or two catalogued causes; one outside the catalogue; one of each; a simulator whose polar is wrong."""
World = Literal["own", "foreign"]
"""Our point mass, or JSBSim's aircraft."""
Causes = dict[str, dict[str, float]]

SCALE_GROUP = frozenset({"mass", "idle_thrust", "drag_polar"})
"""Only their common scale shows in what is observed, so two of them are one."""
HOLDING = frozenset({"geometric_path", "vertical_speed_mode"})
"""A flight can hold one of them only."""
TYPECODE = "A320"
REFERENCE_FLIGHTS = 560
"""Flights flown for a simulator: 72 % of them, some 400, train it."""
LEAST_FULL = 0.7
"""Sizes below are called half."""


@dataclass(frozen=True)
class SimulatorPlan:
    """A simulator: flights of its own, and a model trained on them.

    Example:
        >>> SimulatorPlan("simulator_000", seed=8, polar={"induced_drag": {"factor": 1.1}}).world
        'own'
    """

    name: str
    seed: int
    polar: Causes = field(default_factory=dict)
    """Error of its polar: causes injected in its flights."""
    causes: Causes = field(default_factory=dict)
    """Injected in its flights too: the refit regime, or what a true correction would make of another simulator."""
    world: World = "own"
    model: str = TYPECODE
    """Type flown, or JSBSim's model."""
    flights: int = REFERENCE_FLIGHTS
    trained: bool = True
    """True if there is a checkpoint, and not flights alone."""


@dataclass(frozen=True)
class SetPlan:
    """Flights to be diagnosed.

    Example:
        >>> one = SetPlan("blind_0000", "blind", "null", {}, 0.0, "all", 400, "simulator_000", seed=11)
        >>> one.flights, one.causes, one.full
        (400, {}, False)
    """

    name: str
    part: Part
    kind: Kind
    causes: Causes
    size: float
    """Of its smaller cause; 0 for none, 1 for full size."""
    channels: Literal["all", "basic"]
    """``basic`` is without TAS, groundspeed, angles and geometric altitude."""
    flights: int
    simulator: str
    seed: int
    world: World = "own"
    model: str = TYPECODE
    varying: bool = False
    """True if flights differ in what they have of a cause, beyond the spread of weather."""
    corrected: bool = False
    """True if its report and the corrected flights are kept; drawn without regard to what is planted."""
    true: str | None = None
    """The simulator's flights with the very causes of this set: what a true correction would reach."""

    @property
    def full(self) -> bool:
        """True if every cause has its full size."""
        return self.size >= LEAST_FULL


@dataclass(frozen=True)
class Plan:
    """The key of a study.

    Example:
        >>> plan = Plan(0, "00", (), (SimulatorPlan("simulator_000", seed=8),))
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
        sets = tuple(SetPlan(**one) for one in key["sets"])
        return cls(key["seed"], key["nonce"], sets, tuple(SimulatorPlan(**one) for one in key["simulators"]))
