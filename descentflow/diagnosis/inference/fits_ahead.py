"""Fits worked out side by side, and fits worked out before it is known whether they are wanted."""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

from torch import Tensor

from descentflow.core.foreseen_calls import ForeseenCalls
from descentflow.core.freed_memory import give_back
from descentflow.core.side_by_side import at_once
from descentflow.diagnosis.inference.free_discrepancy import Beside, FreeDiscrepancy
from descentflow.diagnosis.inference.likelihood import EffectsLikelihood, Fit
from descentflow.diagnosis.inference.linear_algebra import Design
from descentflow.diagnosis.inference.mixed_fit import design_with_laws
from descentflow.diagnosis.inference.search import fit_effects
from descentflow.effects.flight_law import DiffersByFlight

MANY_NUMBERS = 200_000
"""Measured in all flights, from which on memory is given back after each fit: what fits leave between what is kept of
them adds up to hundreds of megabytes of thousands of flights, and of hundreds is not worth the time."""
Names = tuple[str, ...]
Asked = tuple[Names, Mapping[str, Tensor]]
"""Effects, and the parameters from which their fit starts."""
_Key = tuple[Names, tuple[tuple[str, tuple[float, ...]], ...]]


@dataclass(frozen=True)
class _Question:
    """A fit that is asked for, and what is asked for next where some of its effects cannot be what they say."""

    names: Names
    start: Mapping[str, Tensor]
    others: Mapping[str, Tensor]
    """Parameters of every effect from which the next fit starts."""
    tried: frozenset[frozenset[str]]
    """Sets that were fitted already, and are not again."""


@dataclass(frozen=True)
class _Made:
    """A fit; of another process without its design, but with a discrepancy beside it and the effects that can be."""

    key: _Key
    fit: Fit
    beside: Beside | None = None
    kept: Names = ()


def fits_side_by_side(
    likelihood: EffectsLikelihood, asked: Sequence[Asked], progress: Callable[[str], None]
) -> list[Fit]:
    """Independent fits, the same as one after the other.

    Args:
        likelihood: Of the flights.
        asked: What is fitted.
        progress: Called with what is being fitted.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_likelihood
        >>> from descentflow.effects import EFFECTS
        >>> likelihood = example_likelihood(EFFECTS["temperature"], [10.0])
        >>> found = fits_side_by_side(likelihood, [(("mass",), {}), (("temperature",), {})], print)
        fitting mass
        fitting temperature
        >>> found[1].theta["temperature"].round()
        tensor([10.], dtype=torch.float64)
    """
    _know_what_is_shared(likelihood)
    names = [one[0] for one in asked]
    begins = {place: f"fitting {', '.join(names[place])}" for place in _long_ones_first(likelihood, names)}

    def fitted(place: int) -> Fit:
        return without_design(fit_effects(likelihood, *asked[place]))

    with ForeseenCalls(fitted, lambda place: progress(begins[place])) as calls:
        calls.foresee({place: place for place in begins})
        return [with_design(likelihood, calls.ask(place, partial(fitted, place))) for place in range(len(asked))]


def _long_ones_first(likelihood: EffectsLikelihood, asked: Sequence[Names]) -> list[int]:
    """Places of fits in the order in which they begin: laws of flights take longest, nothing should wait for one."""
    differ = [any(isinstance(likelihood.catalogue[name], DiffersByFlight) for name in names) for names in asked]
    return sorted(range(len(asked)), key=lambda at: not (differ[at] and at_once() > 1))


class FitsAhead:
    """Fits of a search that are worked out meanwhile, with what a discrepancy beside each explains.

    Example:
        >>> from descentflow.diagnosis.inference.discrepancy import discrepancy_columns
        >>> from descentflow.diagnosis.inference.example_sides import example_likelihood
        >>> from descentflow.effects import EFFECTS
        >>> likelihood = example_likelihood(EFFECTS["temperature"], [10.0])
        >>> free = FreeDiscrepancy(likelihood, discrepancy_columns(likelihood.compared))
        >>> start = {"temperature": EFFECTS["temperature"].start()}
        >>> with FitsAhead(likelihood, free, print) as ahead:
        ...     ahead.foresee([(("temperature",), start)], start)  # where only one may run, it waits until asked for
        ...     ahead.fit(("temperature",), start).theta["temperature"].round()
        fitting temperature
        tensor([10.], dtype=torch.float64)
    """

    def __init__(
        self,
        likelihood: EffectsLikelihood,
        discrepancy: FreeDiscrepancy,
        progress: Callable[[str], None],
        credible: Callable[[Fit], Names] = lambda fit: fit.effects,
    ) -> None:
        """Begin with none.

        Args:
            likelihood: Of the flights.
            discrepancy: That is tried beside each.
            progress: Called with what is being fitted.
            credible: Which effects of a fit can be what they say: whoever made one goes on with these alone.
        """
        self.likelihood, self.discrepancy, self._credible = likelihood, discrepancy, credible
        self._calls = ForeseenCalls(self._answer, lambda key: progress(f"fitting {', '.join(key[0])}"))
        self._made: dict[_Key, _Made] = {}
        self._kept: dict[Names, Names] = {}

    def __enter__(self) -> "FitsAhead":
        """Itself; no fit runs on after the end of the block."""
        return self

    def __exit__(self, *_: object) -> None:
        self._calls.__exit__()

    def foresee(
        self, asked: Sequence[Asked], others: Mapping[str, Tensor], tried: Collection[frozenset[str]] = ()
    ) -> None:
        """Work out fits that will be asked for, or may be, the most probable first, and no others any more.

        Args:
            asked: The fits.
            others: Parameters of every effect from which the fit of those starts that are credible in one of them.
            tried: Sets that need not be fitted any more.
        """
        _know_what_is_shared(self.likelihood)
        known = frozenset(tried)
        self._calls.foresee({_key(*one): _Question(*one, others, known) for one in asked})

    def fit(self, names: Names, start: Mapping[str, Tensor]) -> Fit:
        """A fit, worked out now if it was not begun before."""
        key = _key(names, start)
        if key not in self._made:
            made = self._calls.ask(key, lambda: [_Made(key, self.fitted(names, start))])
            self._made |= {one.key: one for one in made}
        found = self._made.pop(key)
        if found.beside is None:
            return found.fit
        self.discrepancy.found[names], self._kept[names] = found.beside, found.kept
        return with_design(self.likelihood, found.fit)

    def fitted(self, names: Names, start: Mapping[str, Tensor]) -> Fit:
        """A fit, worked out here and now."""
        fit = fit_effects(self.likelihood, names, start)
        if self.likelihood.y.numel() > MANY_NUMBERS:
            give_back()
        return fit

    def credible(self, fit: Fit) -> Names:
        """Which effects of a fit can be what they say, asked once."""
        if fit.effects not in self._kept:
            self._kept[fit.effects] = self._credible(fit)
        return self._kept[fit.effects]

    def _answer(self, question: _Question) -> list[_Made]:
        """A fit, and those that follow it, as they are sent to another process."""
        made: list[_Made] = []
        names, start = question.names, question.start
        while True:
            fit = self.fitted(names, start)
            # The same effects may have been asked for before, from elsewhere.
            self.discrepancy.found.pop(names, None)
            kept = self._credible(fit)
            made.append(_Made(_key(names, start), without_design(fit), self.discrepancy.beside(fit), kept))
            if kept == names or frozenset(kept) in question.tried:
                return made
            names, start = kept, {name: question.others[name] for name in kept}


def _key(names: Names, start: Mapping[str, Tensor]) -> _Key:
    return names, tuple((name, tuple(value.tolist())) for name, value in start.items())


def reordered(likelihood: EffectsLikelihood, fit: Fit, names: Names) -> Fit:
    """The same fit with its effects in another order.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_likelihood
        >>> from descentflow.effects import EFFECTS
        >>> likelihood = example_likelihood(EFFECTS["temperature"], [10.0])
        >>> reordered(likelihood, fit_effects(likelihood, ("mass", "temperature")), ("temperature", "mass")).effects
        ('temperature', 'mass')
    """
    return with_design(likelihood, replace(fit, effects=names, theta={name: fit.theta[name] for name in names}))


def _know_what_is_shared(likelihood: EffectsLikelihood) -> None:
    """Work out here what every copy of this process would work out for itself."""
    if at_once() > 1:
        for state in (likelihood.real_state, likelihood.seen_beside):
            state.own_log_rate, state.schedule_log_rate  # noqa: B018 (they are kept)
        likelihood.sums, likelihood.single  # noqa: B018


def _left_behind() -> Design:
    """In place of a design, which is large and is made again where it is wanted."""
    raise AssertionError("a fit of another process has no design yet")


def without_design(fit: Fit) -> Fit:
    """The fit as it is sent to another process.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_likelihood
        >>> likelihood = example_likelihood()
        >>> sent = without_design(fit_effects(likelihood, ()))
        >>> with_design(likelihood, sent).design.n_own
        0
    """
    return replace(fit, kept=_left_behind)


def with_design(likelihood: EffectsLikelihood, fit: Fit) -> Fit:
    """The fit as it came from another process, with the design of a likelihood of the same flights.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_likelihood
        >>> likelihood = example_likelihood()
        >>> with_design(likelihood, without_design(fit_effects(likelihood, ()))).design.n_own
        0
    """

    def design() -> Design:
        if fit.per_flight:
            return design_with_laws(likelihood, fit.theta, fit.per_flight)
        return likelihood.design(fit.theta)

    return replace(fit, kept=likelihood.kept(design))
