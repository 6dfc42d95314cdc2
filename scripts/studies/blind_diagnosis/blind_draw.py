"""A study drawn at random: which sets there are, what is planted in each, and which simulator each is compared with."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from descentflow.core.errors import ConfigError
from studies.blind_diagnosis.blind_plan import HOLDING, SCALE_GROUP, Kind, Plan, SetPlan, SimulatorPlan
from studies.blind_diagnosis.blind_worlds import FOREIGN, OWN, StudyWorld

FULL, HALF, ANY = (0.85, 1.15), (0.4, 0.6), (0.4, 1.15)
"""Ranges of the sizes called full and half; each of several causes has a size of its own, of any ratio."""
SHARES: dict[Kind, float] = {"null": 0.24, "double": 0.22, "triple": 0.05, "outside": 0.14}
"""Kinds of blind sets; the rest has one catalogued cause."""
HALF_SIZE, VARYING, BASIC, CLOSURE = 0.25, 0.4, 0.3, 0.35
"""Of the sets with one cause those at half size; of causes that can differ between flights those that do; of all sets
those with the basic channels, and those whose closure is judged by fresh flights."""


def draw_plan(n_own: int, seed: int, *, n_foreign: int = 0, withheld: bool = True) -> Plan:
    """Draw a study.

    Args:
        n_own: Blind sets of our own world.
        seed: Of everything.
        n_foreign: Blind sets of JSBSim's aircraft.
        withheld: Whether to add, for each catalogued cause, a set that is diagnosed with and without that cause in the
            catalogue.

    Returns:
        The key.

    Raises:
        ConfigError: If there is no set.

    Example:
        >>> plan = draw_plan(40, seed=1, n_foreign=10)
        >>> sum(one.part == "blind" for one in plan.sets), sum(one.world == "foreign" for one in plan.sets)
        (50, 10)
    """
    if min(n_own, n_foreign) < 0 or n_own + n_foreign < 1:
        raise ConfigError(
            f"{n_own} sets of our own world and {n_foreign} of the foreign one",
            expected="at least one set",
            mend="ask for more",
        )
    generator = np.random.default_rng(seed)
    draw = _Draw(generator, _seeds(generator), [], [], {})
    for world, n in ((OWN, n_own), (FOREIGN, n_foreign)):
        for kind, names in _contents(generator, world, n):
            draw.blind(world, kind, names)
    if withheld and n_own:
        for cause in OWN.catalogued:
            draw.withheld(cause)
    sets, simulators = _without_order(generator, draw.sets, draw.simulators)
    return Plan(seed, generator.bytes(16).hex(), sets, simulators)


@dataclass
class _Draw:
    """Sets and simulators so far."""

    generator: np.random.Generator
    new_seed: Callable[[], int]
    sets: list[SetPlan]
    simulators: list[SimulatorPlan]
    pools: dict[tuple[object, ...], str]

    def blind(self, world: StudyWorld, kind: Kind, names: Sequence[str]) -> None:
        """Add a set of a kind with causes of its own sizes."""
        generator = self.generator
        model = world.model(generator, names)
        vary = bool(generator.random() < VARYING)
        several = kind in ("double", "triple")
        causes, sizes = {}, []
        for name in names:
            size = generator.uniform(*(ANY if several else HALF if generator.random() < HALF_SIZE else FULL))
            causes[name] = world.values(generator, name, size, vary=vary)
            sizes.append(size)
        counts, odds = zip(*world.flights, strict=True)
        self.sets.append(
            SetPlan(
                name="",
                part="blind",
                kind=kind,
                causes=causes,
                size=min(sizes, default=0.0),
                channels="basic" if generator.random() < BASIC else "all",
                flights=int(generator.choice(counts, p=np.array(odds) / sum(odds))),
                simulator=self._simulator(world, model, world.pool if names else world.null_pool),
                seed=self.new_seed(),
                world=world.name,
                model=model,
                closure=bool(generator.random() < CLOSURE),
            )
        )

    def withheld(self, cause: str) -> None:
        """Add a set of our own world to be diagnosed with and without a cause in the catalogue."""
        model = OWN.model(self.generator, [cause])
        causes = {cause: OWN.values(self.generator, cause, 1.0, vary=False)}
        held = self._simulator(OWN, model, OWN.pool)
        where = (400, held, self.new_seed(), OWN.name, model)
        self.sets.append(SetPlan(f"withheld_{cause}", "withheld", "single", causes, 1.0, "all", *where))

    def _simulator(self, world: StudyWorld, model: str, pool: int | None) -> str:
        """One of the model's few, or a new one: sets that share one share its sampling error."""
        drawn = len(self.simulators) if pool is None else int(self.generator.integers(pool))
        key = world.name, model, pool is None, drawn
        if key not in self.pools:
            self.pools[key] = f"simulator_{len(self.simulators):03d}"
            planned = SimulatorPlan(self.pools[key], self.new_seed(), world.name, model, world.reference_flights)
            self.simulators.append(planned)
        return self.pools[key]


def _contents(generator: np.random.Generator, world: StudyWorld, n: int) -> list[tuple[Kind, list[str]]]:
    """Kind and causes of each set; single causes come in turn, so that each is met as often as any other."""
    count = {kind: round(n * share) for kind, share in SHARES.items()}
    contents: list[tuple[Kind, list[str]]] = [("null", []) for _ in range(count["null"])]
    contents += [("double", _together(generator, world, 2)) for _ in range(count["double"])]
    contents += [("triple", _together(generator, world, 3)) for _ in range(count["triple"])]
    contents += [("outside", [name]) for name in _in_turn(generator, world.outside, count["outside"])]
    return contents + [("single", [name]) for name in _in_turn(generator, world.catalogued, n - len(contents))]


def _in_turn(generator: np.random.Generator, names: Sequence[str], n: int) -> list[str]:
    order = [names[i] for i in generator.permutation(len(names))]
    return [order[k % len(order)] for k in range(max(n, 0))]


def _together(generator: np.random.Generator, world: StudyWorld, n: int) -> list[str]:
    """Catalogued causes that a flight can have together, of which no two are one by the gauge."""
    while True:
        names = [world.catalogued[i] for i in generator.choice(len(world.catalogued), n, replace=False)]
        if all(len(set(names) & group) < 2 for group in (SCALE_GROUP, HOLDING)):
            return names


def _without_order(
    generator: np.random.Generator, sets: Sequence[SetPlan], simulators: Sequence[SimulatorPlan]
) -> tuple[tuple[SetPlan, ...], tuple[SimulatorPlan, ...]]:
    """Name sets and simulators by chance: their order would show what they hide."""
    names = [own.name for own in simulators]
    renamed = dict(zip(names, (names[i] for i in generator.permutation(len(names))), strict=True))
    shuffled = [replace(sets[i], simulator=renamed[sets[i].simulator]) for i in generator.permutation(len(sets))]
    named = (own if own.part == "withheld" else replace(own, name=f"blind_{k:04d}") for k, own in enumerate(shuffled))
    return tuple(named), tuple(sorted((replace(s, name=renamed[s.name]) for s in simulators), key=lambda own: own.name))


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
