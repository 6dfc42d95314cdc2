"""A study drawn at random: which sets there are, what is planted in each, and which simulator each is compared with."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from descentflow.core.errors import ConfigError
from descentflow.simulation.causes import CATALOGUED, CAUSES
from studies.blind_diagnosis.blind_plan import (
    HOLDING,
    SCALE_GROUP,
    Causes,
    Kind,
    Plan,
    SetPlan,
    SimulatorPlan,
)
from studies.blind_diagnosis.blind_worlds import FOREIGN, OWN, StudyWorld

FULL, HALF, ANY = (0.85, 1.15), (0.4, 0.6), (0.4, 1.15)
"""Ranges of the sizes called full and half; each of two causes has a size of its own, of any ratio."""


@dataclass(frozen=True)
class Shares:
    """Shares of the kinds of blind sets in a world; the rest is of one catalogued cause.

    Example:
        >>> plan = draw_plan(20, seed=1, shares=Shares.of_nulls())
        >>> {one.kind for one in plan.sets if one.part == "blind"}  # for a study of false alarms alone
        {'null'}
    """

    null: float = 0.24
    double: float = 0.2
    outside: float = 0.14
    mixed: float = 0.05
    polar: float = 0.03
    half_size: float = 0.25
    """Of the sets with one cause."""
    varying: float = 0.4
    """Of the sets with a cause that can differ between flights."""
    wrong_polar: float = 0.12
    """Of the sets with a cause."""
    basic: float = 0.4
    corrected: float = 0.35
    """Of all sets: those whose corrected flights are kept. Where catalogued causes are planted against a right polar,
    they are compared with what a true correction makes."""

    @classmethod
    def of_nulls(cls) -> "Shares":
        """Nothing planted anywhere."""
        return cls(null=1.0, double=0.0, outside=0.0, mixed=0.0, polar=0.0)


def draw_plan(n_own: int, seed: int, *, n_foreign: int = 0, shares: Shares | None = None, extra: bool = True) -> Plan:
    """Draw a study.

    Sets that hide something share a few simulators of their model; sets that hide nothing have a simulator each: those
    that share one share its sampling error, and p-values would not be independent.

    Args:
        n_own: Blind sets of our own world.
        seed: Of everything.
        n_foreign: Blind sets of JSBSim's aircraft.
        shares: Make-up of the blind sets.
        extra: Whether to add, for each catalogued cause, a set that is diagnosed with and without that cause in the
            catalogue, and one whose simulator was trained on flights with the cause.

    Returns:
        The key.

    Raises:
        ConfigError: If there is no set.

    Example:
        >>> plan = draw_plan(40, seed=1, n_foreign=10)
        >>> sum(one.part == "blind" for one in plan.sets), sum(one.world == "foreign" for one in plan.sets)
        (50, 10)
    """
    if n_own < 0 or n_foreign < 0 or n_own + n_foreign < 1:
        raise ConfigError(
            f"{n_own} sets of our own world and {n_foreign} of the foreign one",
            expected="at least one set",
            mend="ask for more",
        )
    generator = np.random.default_rng(seed)
    shares = shares or Shares()
    new_seed = _seeds(generator)
    drawn = _Drawn([], [])
    for world, n in ((OWN, n_own), (FOREIGN, n_foreign)):
        if n:
            _draw_world(generator, world, n, shares, new_seed, drawn)
    _hide_order(generator, drawn)
    if extra and n_own:
        _add_withheld(generator, drawn, new_seed)
    return Plan(seed, generator.bytes(16).hex(), tuple(drawn.sets), tuple(drawn.simulators))


@dataclass
class _Drawn:
    """Sets and simulators so far."""

    sets: list[SetPlan]
    simulators: list[SimulatorPlan]

    def new_simulator(self, world: StudyWorld, model: str, seed: int, polar: Causes) -> SimulatorPlan:
        """Enter another simulator."""
        name = f"simulator_{len(self.simulators):03d}"
        one = SimulatorPlan(name, seed, polar, world=world.name, model=model, flights=world.reference_flights)
        self.simulators.append(one)
        return one


def _draw_world(
    generator: np.random.Generator,
    world: StudyWorld,
    n: int,
    shares: Shares,
    new_seed: Callable[[], int],
    drawn: _Drawn,
) -> None:
    """Sets of a world and their simulators."""
    pools: dict[tuple[str, bool, int], SimulatorPlan] = {}

    def simulator_for(kind: Kind, model: str) -> SimulatorPlan:
        """One of its own for a set that hides nothing, or only a wrong polar; else one of the model's few."""
        if kind in ("null", "polar"):
            polar = world.wrong_polar(generator) if kind == "polar" else {}
            return drawn.new_simulator(world, model, new_seed(), polar)
        wrong = bool(generator.random() < shares.wrong_polar)
        key = model, wrong, int(generator.integers(world.pool[wrong]))
        if key not in pools:
            polar = world.wrong_polar(generator) if wrong else {}
            pools[key] = drawn.new_simulator(world, model, new_seed(), polar)
        return pools[key]

    for kind, names in _contents(generator, world, n, shares):
        model = world.model(generator, names)
        causes, size, varying = _planted(generator, world, kind, names, shares)
        simulator = simulator_for(kind, model)
        counts, odds = zip(*world.flights, strict=True)
        corrected = bool(generator.random() < shares.corrected)
        closable = kind in ("single", "double") and not simulator.polar
        drawn.sets.append(
            SetPlan(
                name="",
                part="blind",
                kind=kind,
                causes=causes,
                size=size,
                channels="basic" if generator.random() < shares.basic else "all",
                flights=int(generator.choice(counts, p=np.array(odds) / sum(odds))),
                simulator=simulator.name,
                seed=new_seed(),
                world=world.name,
                model=model,
                varying=varying,
                corrected=corrected,
                true="" if corrected and closable else None,
            )
        )


def _planted(
    generator: np.random.Generator, world: StudyWorld, kind: Kind, names: Sequence[str], shares: Shares
) -> tuple[Causes, float, bool]:
    """Values of the causes of a set, the size of the smallest, and whether flights differ."""
    causes, sizes = {}, []
    vary = generator.random() < shares.varying
    varying = False
    for name in names:
        size = generator.uniform(
            *(ANY if kind == "double" else HALF if generator.random() < shares.half_size else FULL)
        )
        values, differ = world.values(generator, name, size, vary=vary)
        causes[name], varying = values, varying or differ
        sizes.append(size)
    return causes, min(sizes, default=0.0), varying


def _contents(
    generator: np.random.Generator, world: StudyWorld, n: int, shares: Shares
) -> list[tuple[Kind, list[str]]]:
    """Kind and causes of each set; single causes come in turn, so that each is met as often as any other."""
    kinds: tuple[Kind, ...] = ("null", "double", "outside", "mixed", "polar")
    count = {kind: round(n * getattr(shares, kind)) for kind in kinds}
    found: list[tuple[Kind, list[str]]] = []
    found += [("null", []) for _ in range(count["null"])]
    found += [("polar", []) for _ in range(count["polar"])]
    found += [("double", _pair(generator, world)) for _ in range(count["double"])]
    found += [("outside", [name]) for name in _in_turn(generator, world.outside, count["outside"])]
    outsiders = _in_turn(generator, world.beside, count["mixed"])
    found += [("mixed", [str(generator.choice(world.strong)), name]) for name in outsiders]
    return found + [("single", [name]) for name in _in_turn(generator, world.catalogued, n - len(found))]


def _in_turn(generator: np.random.Generator, names: Sequence[str], n: int) -> list[str]:
    order = [names[i] for i in generator.permutation(len(names))]
    return [order[k % len(order)] for k in range(max(n, 0))]


def _pair(generator: np.random.Generator, world: StudyWorld) -> list[str]:
    """Two catalogued causes that a flight can have together and that are not one by the gauge."""
    while True:
        pair = [world.catalogued[i] for i in generator.choice(len(world.catalogued), 2, replace=False)]
        if not any(set(pair) <= group for group in (SCALE_GROUP, HOLDING)):
            return pair


def _hide_order(generator: np.random.Generator, drawn: _Drawn) -> None:
    """Name sets and simulators by chance: their order would tell what they hide. Then enter the true corrections."""
    names = [one.name for one in drawn.simulators]
    renamed = dict(zip(names, (names[i] for i in generator.permutation(len(names))), strict=True))
    drawn.simulators = sorted((replace(s, name=renamed[s.name]) for s in drawn.simulators), key=lambda s: s.name)
    order = generator.permutation(len(drawn.sets))
    shuffled = [drawn.sets[i] for i in order]
    by_name = {one.name: one for one in drawn.simulators}
    drawn.sets = []
    for k, one in enumerate(shuffled):
        named = replace(one, name=f"blind_{k:04d}", simulator=renamed[one.simulator])
        if named.true is not None:
            # The same aircraft and crews as the simulator's, so that nothing but the causes is between them.
            named = replace(named, true=f"true_{k:04d}")
            held = by_name[named.simulator]
            drawn.simulators.append(replace(held, name=f"true_{k:04d}", causes=named.causes, trained=False))
        drawn.sets.append(named)


def _add_withheld(generator: np.random.Generator, drawn: _Drawn, new_seed: Callable[[], int]) -> None:
    """For each catalogued cause, a set to diagnose with and without it, and one against a simulator that has it too."""
    right = [s for s in drawn.simulators if s.world == "own" and s.trained and not s.polar]
    for cause in CATALOGUED:
        causes = {cause.name: CAUSES[cause.name].draw(generator, 1.0)}
        held = right[int(generator.integers(len(right)))]
        refit = replace(held, name=f"refit_{cause.name}", causes=causes)
        drawn.simulators.append(refit)
        common = SetPlan("", "withheld", "single", causes, 1.0, "all", 400, held.name, new_seed(), model=held.model)
        drawn.sets.append(replace(common, name=f"withheld_{cause.name}", corrected=True, true=refit.name))
        refitted = replace(common, name=f"refit_{cause.name}", part="refit", simulator=refit.name, seed=new_seed())
        drawn.sets.append(refitted)


def _seeds(generator: np.random.Generator) -> Callable[[], int]:
    """Seeds of worlds, no two alike, so that no flight is in two of them."""
    used: set[int] = set()

    def new() -> int:
        while True:
            seed = int(generator.integers(2**31))
            if seed not in used:
                used.add(seed)
                return seed

    return new
