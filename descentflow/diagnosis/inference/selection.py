"""Which effects are named, with what probability, and what they leave."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property

from descentflow.diagnosis.inference.discrepancy import DiscrepancyColumns
from descentflow.diagnosis.inference.inclusion import Inclusion, Names, WeightedSet, inclusion
from descentflow.diagnosis.inference.likelihood import EffectsLikelihood, Fit
from descentflow.diagnosis.inference.search import fit_effects
from descentflow.diagnosis.inference.set_search import SetSearch
from descentflow.diagnosis.inference.single_effects import Candidate, every_single

OUTSIDE = 0.5
"""Probability of a shift without a cause from which there is held to be one: the diagnosis abstains from a cause of
it."""


@dataclass(frozen=True)
class Outside:
    """What a free discrepancy explains beyond the named effects (nats), and whether there is probably one.

    Example:
        >>> Outside(explained=300.0, rest=100.0, error=20.0, named=True).share_explained
        0.75
    """

    explained: float
    rest: float
    error: float
    named: bool

    @property
    def is_larger(self) -> bool:
        """Whether the discrepancy explains more than the effects: what they close may be its work as well."""
        return self.rest > self.explained

    @property
    def share_explained(self) -> float:
        """Of what effects and discrepancy explain together."""
        whole = self.explained + max(self.rest, 0.0)
        return self.explained / whole if whole > 0 else 0.0


@dataclass(frozen=True)
class Chosen:
    """The outcome.

    ``null`` the fit without effects; ``singles`` each effect alone; ``fit`` the named ones together; ``groups`` by
    named effect: the names that could stand in its place; ``probability`` of each that it is among the causes;
    ``gains`` of each over the set without it, with their standard errors; ``inclusion`` all that the weights say;
    ``sets`` with their weights, heaviest first; ``alike`` fits with another of a group in the place of a named one;
    ``beside`` the named ones as they are with a discrepancy beside them; ``undecided`` effects that would be named,
    each with those that it may be as well for lack of their channels.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_likelihood
        >>> from descentflow.effects import EFFECTS
        >>> likelihood = example_likelihood(EFFECTS["temperature"], [10.0])
        >>> from descentflow.diagnosis.inference.discrepancy import discrepancy_columns
        >>> columns = discrepancy_columns(likelihood.compared)
        >>> chosen = select(likelihood, columns, lambda stage: None)
        >>> gain, error = chosen.gains["temperature"]
        >>> gain > 10 * error, chosen.groups["temperature"], chosen.alike
        (True, (), ())
    """

    null: Fit
    outside: Outside
    singles: dict[str, Candidate]
    fit: Fit
    groups: dict[str, tuple[str, ...]]
    probability: dict[str, float]
    gains: dict[str, tuple[float, float]]
    inclusion: Inclusion | None = None
    sets: tuple[WeightedSet, ...] = ()
    alike: tuple[Fit, ...] = ()
    beside: Fit | None = None
    undecided: tuple[Names, ...] = ()


@dataclass(frozen=True)
class Searched:
    """A search that has ended: the sets with their weights, and the fit of the effects that they name.

    Attributes:
        search: The search.
        null: The fit without effects.
        singles: Each effect alone.
        sets: All sets with their weights.
        found: What the weights say.
        undecided: Effects that would be named, each with those that it may be as well for lack of their channels.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_likelihood
        >>> from descentflow.effects import EFFECTS
        >>> likelihood = example_likelihood(EFFECTS["temperature"], [10.0])
        >>> from descentflow.diagnosis.inference.discrepancy import discrepancy_columns
        >>> ended = searched(likelihood, discrepancy_columns(likelihood.compared), lambda stage: None)
        >>> ended.fit.effects, sorted(ended.chosen.gains)
        (('temperature',), ['temperature'])
    """

    search: SetSearch
    null: Fit
    singles: dict[str, Candidate]
    sets: tuple[WeightedSet, ...]
    found: Inclusion
    fit: Fit
    undecided: tuple[Names, ...]

    @cached_property
    def chosen(self) -> Chosen:
        """The outcome; what each effect gains takes the fits of sets without it, and is worked out when asked for."""
        likelihood, search, fit, found = self.search.likelihood, self.search, self.fit, self.found
        free = search.discrepancy.beside(fit).log_score
        rest, error = likelihood.gain(free, fit.log_score)
        explained = likelihood.gain(fit.log_score, self.null.log_score)[0]
        fewer = [tuple(other for other in fit.effects if other != name) for name in fit.effects]
        others = [(name, other) for name in fit.effects for other in found.groups[name]]
        exchanged = [tuple(other if one == name else one for one in fit.effects) for name, other in others]
        beside = search.fits_of((*fewer, *exchanged))
        without, alike = beside[: len(fewer)], beside[len(fewer) :]
        gains = {n: likelihood.gain(fit.log_score, one.log_score) for n, one in zip(fit.effects, without, strict=True)}
        return Chosen(
            self.null,
            Outside(explained, rest, error, found.discrepancy >= OUTSIDE or bool(self.undecided)),
            self.singles,
            fit,
            {name: found.groups[name] for name in fit.effects},
            {name: found.probability[name] for name in fit.effects},
            gains,
            found,
            tuple(sorted(self.sets, key=lambda one: -one.weight)),
            tuple(alike),
            search.discrepancy.refitted(fit),
            self.undecided,
        )


def select(likelihood: EffectsLikelihood, discrepancy: DiscrepancyColumns, progress: Callable[[str], None]) -> Chosen:
    """Name effects, see :func:`searched`, with all that is said of them.

    Args:
        likelihood: Flights and catalogue.
        discrepancy: Its columns, with unit prior spread.
        progress: Called with what is being fitted.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_likelihood
        >>> from descentflow.effects import EFFECTS
        >>> likelihood = example_likelihood(EFFECTS["temperature"], [10.0])
        >>> from descentflow.diagnosis.inference.discrepancy import discrepancy_columns
        >>> columns = discrepancy_columns(likelihood.compared)
        >>> chosen = select(likelihood, columns, lambda stage: None)
        >>> chosen.fit.effects, chosen.outside.named
        (('temperature',), False)
    """
    return searched(likelihood, discrepancy, progress).chosen


def searched(
    likelihood: EffectsLikelihood,
    discrepancy: DiscrepancyColumns,
    progress: Callable[[str], None],
) -> Searched:
    """Name effects, with a discrepancy of no particular cause as one more that may be there.

    Args:
        likelihood: Flights and catalogue.
        discrepancy: Its columns, with unit prior spread.
        progress: Called with what is being fitted.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_likelihood
        >>> from descentflow.effects import EFFECTS
        >>> likelihood = example_likelihood(EFFECTS["temperature"], [10.0])
        >>> from descentflow.diagnosis.inference.discrepancy import discrepancy_columns
        >>> columns = discrepancy_columns(likelihood.compared)
        >>> searched(likelihood, columns, lambda stage: None).fit.effects
        ('temperature',)
    """
    null = fit_effects(likelihood, ())
    singles = every_single(likelihood, null, progress)
    search = SetSearch(likelihood, discrepancy, null, singles, progress)
    sets, alone = search.weighted()
    found = inclusion(sets, alone)
    fit = search.fit(_in_order(found.named, singles))
    undecided = _undecided(likelihood, fit)
    if undecided:
        fit = search.fit(tuple(name for name in fit.effects if name not in {first for first, *_ in undecided}))
    return Searched(search, null, singles, tuple(sets), found, fit, undecided)


def _undecided(likelihood: EffectsLikelihood, fit: Fit) -> tuple[Names, ...]:
    """Effects of a fit with those of the catalogue that they may be as well, where there are any."""
    state = likelihood.compared.state
    may_be = {name: likelihood.catalogue[name].may_be(state, theta) for name, theta in fit.theta.items()}
    found = {name: tuple(other for other in others if other in likelihood.catalogue) for name, others in may_be.items()}
    return tuple((name, *others) for name, others in found.items() if others)


def _in_order(names: Names, singles: Mapping[str, Candidate]) -> Names:
    """Effects, the one that explains most by itself first."""
    return tuple(sorted(names, key=lambda name: -singles[name].gain))
