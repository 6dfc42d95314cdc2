"""Fits worked out side by side, and fits worked out before it is known whether they are wanted."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial

from torch import Tensor

from descentflow.core.foreseen_calls import ForeseenCalls
from descentflow.core.side_by_side import at_once, side_by_side
from descentflow.diagnosis.inference.free_discrepancy import Beside, FreeDiscrepancy
from descentflow.diagnosis.inference.likelihood import EffectsLikelihood, Fit
from descentflow.diagnosis.inference.linear_algebra import Design
from descentflow.diagnosis.inference.mixed_fit import design_with_laws
from descentflow.diagnosis.inference.search import fit_effects
from descentflow.effects.flight_law import DiffersByFlight

Names = tuple[str, ...]
Asked = tuple[Names, Mapping[str, Tensor]]
"""Effects, and the parameters from which their fit starts."""
_Key = tuple[Names, tuple[tuple[str, tuple[float, ...]], ...]]
_Made = tuple[_Key, Fit, Beside | None]


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
    order = _long_ones_first(likelihood, names)
    calls = [partial(_fitted, likelihood, *asked[at]) for at in order]
    found = side_by_side(calls, lambda place: progress(f"fitting {', '.join(names[order[place]])}"))
    return [with_design(likelihood, fit) for _, fit in sorted(zip(order, found, strict=True), key=lambda pair: pair[0])]


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
        >>> free = FreeDiscrepancy(likelihood, discrepancy_columns(likelihood.compared)[0])
        >>> start = {"temperature": EFFECTS["temperature"].start()}
        >>> with FitsAhead(likelihood, free, print) as ahead:
        ...     ahead.foresee([(("temperature",), start)])  # where only one may run, it waits until it is asked for
        ...     ahead.fit(("temperature",), start).theta["temperature"].round()
        fitting temperature
        tensor([10.], dtype=torch.float64)
    """

    def __init__(
        self,
        likelihood: EffectsLikelihood,
        discrepancy: FreeDiscrepancy,
        progress: Callable[[str], None],
        follows: Callable[[Fit], Asked | None] = lambda fit: None,
    ) -> None:
        """Begin with none.

        Args:
            likelihood: Of the flights.
            discrepancy: That is tried beside each.
            progress: Called with what is being fitted.
            follows: What will be asked for after a fit, where the fit alone decides it: whoever made one goes on.
        """
        self.likelihood, self.discrepancy, self._follows = likelihood, discrepancy, follows
        self._calls = ForeseenCalls[list[_Made]](lambda key: progress(f"fitting {', '.join(key[0])}"))
        self._made: dict[_Key, tuple[Fit, Beside | None]] = {}

    def __enter__(self) -> "FitsAhead":
        """Itself; no fit runs on after the end of the block."""
        return self

    def __exit__(self, *_: object) -> None:
        self._calls.foresee({})

    def foresee(self, asked: Sequence[Asked]) -> None:
        """Work out fits that will be asked for, or may be, the most probable first, and no others any more."""
        _know_what_is_shared(self.likelihood)
        self._calls.foresee({_key(*one): partial(self._each, *one) for one in asked})

    def fit(self, names: Names, start: Mapping[str, Tensor]) -> Fit:
        """A fit, worked out now if it was not begun before."""
        key = _key(names, start)
        if key not in self._made:
            made = self._calls.ask(key, lambda: [(key, fit_effects(self.likelihood, names, start), None)])
            self._made |= {one: (fit, beside) for one, fit, beside in made}
        fit, beside = self._made.pop(key)
        if beside is None:
            return fit
        self.discrepancy.found[fit.effects] = beside
        return with_design(self.likelihood, fit)

    def _each(self, names: Names, start: Mapping[str, Tensor]) -> list[_Made]:
        """A fit, and those that follow it, as they are sent to another process."""
        made: list[_Made] = []
        asked: Asked | None = (names, start)
        while asked is not None:
            fit = fit_effects(self.likelihood, *asked)
            made.append((_key(*asked), without_design(fit), self.discrepancy.beside(fit)))
            asked = self._follows(fit)
        return made


def _key(names: Names, start: Mapping[str, Tensor]) -> _Key:
    return names, tuple((name, tuple(value.tolist())) for name, value in start.items())


def _fitted(likelihood: EffectsLikelihood, names: Names, start: Mapping[str, Tensor]) -> Fit:
    return without_design(fit_effects(likelihood, names, start))


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
