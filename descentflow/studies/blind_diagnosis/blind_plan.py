"""What a study hides where: its sets and simulators, drawn at random and written as the key before anything else."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, Literal

import numpy as np

from descentflow.core.errors import ConfigError
from descentflow.simulation.causes import CATALOGUED, CAUSES, OUTSIDE

Part = Literal["blind", "withheld", "refit"]
Kind = Literal["null", "single", "double", "outside"]

SCALE_GROUP = frozenset({"mass", "idle_thrust", "drag_polar"})
"""Only their common scale shows in what is observed, so two of them are one."""
HOLDING = frozenset({"geometric_path", "vertical_speed_mode"})
"""A flight can hold one of them only."""
WRONG_POLAR = 1.04
"""Factor of CD0 of the flights that a wrong simulator learnt from."""
REFERENCE_FLIGHTS = 560
"""Flights flown for a simulator: 72 % of them, some 400, train it."""
FULL, HALF = (0.85, 1.15), (0.4, 0.6)
"""Ranges of the sizes called full and half."""


@dataclass(frozen=True)
class SimulatorPlan:
    """A simulator to be trained on flights of its own.

    Example:
        >>> draw_plan(40, seed=1).simulators[0].name
        'simulator_000'
    """

    name: str
    seed: int
    cd0_factor: float
    causes: dict[str, dict[str, float]]
    """Injected in its training flights too: the refit regime."""


@dataclass(frozen=True)
class SetPlan:
    """Flights to be diagnosed.

    Example:
        >>> one = SetPlan("blind_0000", "blind", "null", {}, 0.0, "all", 400, "simulator_000", seed=11)
        >>> one.flights, one.causes
        (400, {})
    """

    name: str
    part: Part
    kind: Kind
    causes: dict[str, dict[str, float]]
    size: float
    """Of its causes; 0 for none, 1 for full size."""
    channels: Literal["all", "basic"]
    """``basic`` is without TAS, groundspeed, angles and geometric altitude."""
    flights: int
    simulator: str
    seed: int


@dataclass(frozen=True)
class Plan:
    """The key of a study.

    Example:
        >>> plan = draw_plan(20, seed=1)
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


@dataclass(frozen=True)
class Shares:
    """How the blind sets are made up; what the shares of kinds leave is of one catalogued cause.

    Example:
        >>> plan = draw_plan(20, seed=1, shares=Shares(null=1.0, double=0.0, outside=0.0), extra=False)
        >>> {one.kind for one in plan.sets}  # for a study of false alarms alone
        {'null'}
    """

    null: float = 0.25
    double: float = 0.14
    outside: float = 0.15
    half_size: float = 0.25
    wrong_polar: float = 0.2
    """Of the sets with a cause."""
    basic: float = 0.5
    flights: tuple[tuple[int, float], ...] = ((400, 0.75), (100, 0.08), (1000, 0.12), (3000, 0.05))


def draw_plan(
    n_blind: int,
    seed: int,
    *,
    shares: Shares | None = None,
    n_simulators: int = 40,
    more_null: int = 0,
    extra: bool = True,
) -> Plan:
    """Draw a study.

    Args:
        n_blind: Sets of unknown content.
        seed: Of everything.
        shares: Make-up of the blind sets.
        n_simulators: Simulators that the blind sets with a cause are spread over, a quarter of them with the wrong
            polar. Sets without one have a simulator each: those that share one share its sampling error, and p-values
            would not be independent.
        more_null: Blind sets without a cause beside the ``n_blind``, for the false alarms need many.
        extra: Whether to add, for each catalogued cause, a set that is diagnosed with and without that cause in the
            catalogue, and one whose simulator was trained on flights with the cause.

    Returns:
        The key.

    Raises:
        ConfigError: If there is no set.

    Example:
        >>> len(draw_plan(400, seed=1).sets)
        426
    """
    if n_blind < 1 or n_simulators < 1:
        raise ConfigError(
            f"{n_blind} sets and {n_simulators} simulators", expected="at least one of each", mend="ask for more"
        )
    generator = np.random.default_rng(seed)
    shares = shares or Shares()
    n_wrong = n_simulators // 4
    seeds = iter(_distinct_seeds(generator, 2 * (n_blind + more_null) + n_simulators + 4 * len(CATALOGUED)))
    simulators = [
        SimulatorPlan(f"simulator_{k:03d}", next(seeds), WRONG_POLAR if k < n_wrong else 1.0, {})
        for k in range(n_simulators)
    ]
    right, wrong = [s.name for s in simulators[n_wrong:]], [s.name for s in simulators[:n_wrong]]
    blind = []
    more: list[tuple[Kind, list[str]]] = [("null", [])] * more_null
    for kind, names in [*_contents(generator, n_blind, shares), *more]:
        size = 0.0 if kind == "null" else generator.uniform(*(HALF if generator.random() < shares.half_size else FULL))
        causes = {name: CAUSES[name].draw(generator, size) for name in names}
        is_wrong = kind != "null" and bool(wrong) and generator.random() < shares.wrong_polar
        if kind == "null":
            simulators.append(SimulatorPlan(f"simulator_{len(simulators):03d}", next(seeds), 1.0, {}))
            simulator = simulators[-1].name
        else:
            simulator = str(generator.choice(wrong if is_wrong else right))
        counts, odds = zip(*shares.flights, strict=True)
        blind.append(
            SetPlan(
                "",
                "blind",
                kind,
                causes,
                size,
                "basic" if generator.random() < shares.basic else "all",
                int(generator.choice(counts, p=np.array(odds) / sum(odds))),
                simulator,
                next(seeds),
            )
        )
    # Their order would tell which belong to sets that hide nothing.
    before = [s.name for s in simulators]
    renamed = dict(zip(before, (before[i] for i in generator.permutation(len(before))), strict=True))
    simulators = sorted((replace(s, name=renamed[s.name]) for s in simulators), key=lambda s: s.name)
    blind = [replace(one, simulator=renamed[one.simulator]) for one in blind]
    right = [renamed[name] for name in right]
    order = generator.permutation(len(blind))
    sets = [replace(blind[i], name=f"blind_{k:04d}") for k, i in enumerate(order)]
    if extra:
        seed_of = {one.name: one.seed for one in simulators}
        for cause in CATALOGUED:
            causes = {cause.name: cause.draw(generator, 1.0)}
            held = str(generator.choice(right))
            sets.append(_full(f"withheld_{cause.name}", "withheld", causes, held, next(seeds)))
            # The same aircraft and crews as the one that is corrected, so that nothing but the cause is between them:
            # what a correction closes is compared with this one.
            refit = SimulatorPlan(f"refit_{cause.name}", seed_of[held], 1.0, causes)
            simulators.append(refit)
            sets.append(_full(f"refit_{cause.name}", "refit", causes, refit.name, next(seeds)))
    return Plan(seed, generator.bytes(16).hex(), tuple(sets), tuple(simulators))


def _full(name: str, part: Part, causes: dict[str, dict[str, float]], simulator: str, seed: int) -> SetPlan:
    """One cause at full size, seen through all channels."""
    return SetPlan(name, part, "single", causes, 1.0, "all", 400, simulator, seed)


def _contents(generator: np.random.Generator, n: int, shares: Shares) -> list[tuple[Kind, list[str]]]:
    """Kind and causes of each set; single causes come in turn, so that each is met as often as any other."""
    counts = {"null": shares.null, "double": shares.double, "outside": shares.outside}
    numbers = {kind: round(n * share) for kind, share in counts.items()}
    found: list[tuple[Kind, list[str]]] = [("null", [])] * numbers["null"]
    found += [("double", _pair(generator)) for _ in range(numbers["double"])]
    found += [("outside", [name]) for name in _in_turn(generator, [c.name for c in OUTSIDE], numbers["outside"])]
    rest = n - len(found)
    return found + [("single", [name]) for name in _in_turn(generator, [c.name for c in CATALOGUED], rest)]


def _in_turn(generator: np.random.Generator, names: Sequence[str], n: int) -> list[str]:
    order = [names[i] for i in generator.permutation(len(names))]
    return [order[k % len(order)] for k in range(max(n, 0))]


def _pair(generator: np.random.Generator) -> list[str]:
    """Two catalogued causes that a flight can have together and that are not one by the gauge."""
    names = [cause.name for cause in CATALOGUED]
    while True:
        pair = [names[i] for i in generator.choice(len(names), 2, replace=False)]
        if not any(set(pair) <= group for group in (SCALE_GROUP, HOLDING)):
            return pair


def _distinct_seeds(generator: np.random.Generator, n: int) -> list[int]:
    """Seeds of worlds, no two alike, so that no flight is in two of them."""
    found: dict[int, None] = {}
    while len(found) < n:
        found[int(generator.integers(2**31))] = None
    return list(found)
