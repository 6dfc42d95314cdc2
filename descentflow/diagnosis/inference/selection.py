"""Which effects are named: forward selection with a backward pass, groups of what cannot be told apart, abstention."""

from collections.abc import Callable
from dataclasses import dataclass, replace

from torch import Tensor

from descentflow.diagnosis.inference.alike_effects import alike, rivals_of
from descentflow.diagnosis.inference.likelihood import EffectsLikelihood, Fit
from descentflow.diagnosis.inference.search import fit_effects, score_test_gain
from descentflow.diagnosis.inference.selection_rules import (
    MAX_UNEXPLAINED_SHARE,
    MIN_GAIN,
    Candidate,
    best_candidate,
    is_needless,
    share_needed,
    stands_out,
)

MAX_EFFECTS = 4
"""Effects named together at most: each round costs a dozen fits. Set by hand."""
MIN_SCORE_TEST_GAIN = 1.0
"""Nats of score-test gain below which an effect is not fitted: a quarter of what it would have to gain.

Set by hand, to save half the time of a diagnosis."""


@dataclass(frozen=True)
class Outside:
    """What a free discrepancy explains beyond the named effects (nats), and whether the cause lies outside them.

    Example:
        >>> Outside(explained=300.0, rest=100.0, error=20.0, named=True).share_explained
        0.75
    """

    explained: float
    rest: float
    error: float
    named: bool

    @property
    def share_explained(self) -> float:
        """Of what effects and discrepancy explain together."""
        whole = self.explained + max(self.rest, 0.0)
        return self.explained / whole if whole > 0 else 0.0


@dataclass(frozen=True)
class Chosen:
    """The outcome.

    ``null`` the fit without effects; ``singles`` each effect alone; ``fit`` the named ones together; ``groups`` by
    named effect: the names that could stand in its place; ``probability`` of each against those; ``gains`` of each over
    the set without it, with their standard errors.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_likelihood
        >>> from descentflow.effects import EFFECTS
        >>> likelihood = example_likelihood(EFFECTS["temperature"], [10.0])
        >>> from descentflow.diagnosis.inference.discrepancy import discrepancy_columns
        >>> columns, _ = discrepancy_columns(likelihood.compared)
        >>> chosen = select(likelihood, columns, lambda stage: None)
        >>> gain, error = chosen.gains["temperature"]
        >>> gain > 10 * error, chosen.groups["temperature"]
        (True, ())
    """

    null: Fit
    outside: Outside
    singles: dict[str, Candidate]
    fit: Fit
    groups: dict[str, tuple[str, ...]]
    probability: dict[str, float]
    gains: dict[str, tuple[float, float]]


def select(likelihood: EffectsLikelihood, discrepancy: Tensor, progress: Callable[[str], None]) -> Chosen:
    """Name effects, with a discrepancy of no particular cause beside them at every step.

    Args:
        likelihood: Flights and catalogue.
        discrepancy: (n, p, e) its columns, with unit prior spread.
        progress: Called with what is being fitted.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_likelihood
        >>> from descentflow.effects import EFFECTS
        >>> likelihood = example_likelihood(EFFECTS["temperature"], [10.0])
        >>> from descentflow.diagnosis.inference.discrepancy import discrepancy_columns
        >>> columns, _ = discrepancy_columns(likelihood.compared)
        >>> chosen = select(likelihood, columns, lambda stage: None)
        >>> chosen.fit.effects, chosen.outside.named
        (('temperature',), False)
    """
    null = fit_effects(likelihood, ())
    singles = every_single(likelihood, null, progress)
    chosen = _without_needless(likelihood, _forward(likelihood, null, singles, discrepancy, progress))
    left, error = discrepancy_gain(likelihood, chosen, discrepancy)
    explained = likelihood.gain(chosen.log_score, null.log_score)[0]
    outside = stands_out(left, error, explained) and left > MAX_UNEXPLAINED_SHARE * (explained + left)
    groups, probability, gains = {}, {}, {}
    for name in chosen.effects:
        rest = tuple(e for e in chosen.effects if e != name)
        progress(f"what could stand for {name}")
        without = _without(likelihood, chosen, rest, null, singles)
        gains[name] = likelihood.gain(chosen.log_score, without.log_score)
        others = rivals_of(likelihood, chosen, rest, singles, gains[name][0])
        groups[name], probability[name] = alike(likelihood, chosen, others, without)
    return Chosen(null, Outside(explained, left, error, outside), singles, chosen, groups, probability, gains)


def every_single(likelihood: EffectsLikelihood, null: Fit, progress: Callable[[str], None]) -> dict[str, Candidate]:
    """Every effect alone; those without a score-test gain are not fitted, and gain nothing.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_likelihood
        >>> from descentflow.effects import EFFECTS
        >>> likelihood = example_likelihood(EFFECTS["temperature"], [10.0])
        >>> singles = every_single(likelihood, fit_effects(likelihood, ()), lambda stage: None)
        >>> max(singles, key=lambda name: singles[name].gain)
        'temperature'
    """
    found: dict[str, Candidate] = {}
    expected = score_test_gain(likelihood, null.shift)
    for name in likelihood.catalogue:
        if expected[name] < MIN_SCORE_TEST_GAIN:
            start = likelihood.start_of(name)
            found[name] = Candidate(replace(null, effects=(name,), theta={name: start}), 0.0, 0.0)
            continue
        progress(f"fitting {name}")
        fit = fit_effects(likelihood, (name,))
        found[name] = Candidate(fit, *likelihood.gain(fit.log_score, null.log_score))
    return found


def discrepancy_gain(likelihood: EffectsLikelihood, chosen: Fit, discrepancy: Tensor) -> tuple[float, float]:
    """Held-out gain of a free discrepancy beside the chosen effects, and its standard error.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_likelihood
        >>> from descentflow.effects import EFFECTS
        >>> likelihood = example_likelihood(EFFECTS["temperature"], [10.0])
        >>> from descentflow.diagnosis.inference.discrepancy import discrepancy_columns
        >>> columns, _ = discrepancy_columns(likelihood.compared)
        >>> fit = fit_effects(likelihood, ["temperature"])
        >>> before, after = (discrepancy_gain(likelihood, f, columns)[0] for f in (fit_effects(likelihood, ()), fit))
        >>> after < before
        True
    """
    free = likelihood.log_score(chosen.shift, likelihood.design(chosen.theta, discrepancy, 1.0))
    # Where flights differ, both are scores of the flights without what is expected of each, and not of the mixture.
    held = likelihood.log_score(chosen.shift, chosen.design) if chosen.per_flight else chosen.log_score
    return likelihood.gain(free, held)


def _forward(
    likelihood: EffectsLikelihood,
    null: Fit,
    singles: dict[str, Candidate],
    discrepancy: Tensor,
    progress: Callable[[str], None],
) -> Fit:
    """Add the best effect that counts, until none does or a shift without a cause does much better."""
    chosen, candidates = null, singles
    while len(chosen.effects) < MAX_EFFECTS:
        free, error = discrepancy_gain(likelihood, chosen, discrepancy)
        so_far = likelihood.gain(chosen.log_score, null.log_score)[0]
        best = best_candidate(likelihood, candidates, chosen, so_far)
        left = free - (0.0 if best is None else best.gain)
        if stands_out(left, error, so_far + free - left) and (
            best is None or best.gain < share_needed(likelihood, best.fit) * free
        ):
            # No effect does what a shift without a cause does: adding more would only imitate it.
            break
        if best is None:
            break
        chosen = best.fit
        if len(chosen.effects) == MAX_EFFECTS:
            break
        candidates = _further(likelihood, chosen, progress)
    return chosen


def _further(likelihood: EffectsLikelihood, chosen: Fit, progress: Callable[[str], None]) -> dict[str, Candidate]:
    """What every other effect adds to the chosen ones, where its score-test gain is enough to try."""
    found = {}
    expected = score_test_gain(likelihood, chosen.shift)
    for name in likelihood.catalogue:
        if name not in chosen.effects and expected[name] >= MIN_GAIN:
            progress(f"fitting {name} beside {', '.join(chosen.effects)}")
            fit = fit_effects(likelihood, (*chosen.effects, name), chosen.theta)
            found[name] = Candidate(fit, *likelihood.gain(fit.log_score, chosen.log_score))
    return found


def _without_needless(likelihood: EffectsLikelihood, chosen: Fit) -> Fit:
    """Without effects that later ones have made needless."""
    while len(chosen.effects) > 1:
        weakest, loss = None, float("inf")
        for name in chosen.effects:
            fit = fit_effects(likelihood, [e for e in chosen.effects if e != name], chosen.theta)
            gain, error = likelihood.gain(chosen.log_score, fit.log_score)
            if is_needless(gain, error) and gain < loss:
                weakest, loss = fit, gain
        if weakest is None:
            return chosen
        chosen = weakest
    return chosen


def _without(
    likelihood: EffectsLikelihood, chosen: Fit, rest: tuple[str, ...], null: Fit, singles: dict[str, Candidate]
) -> Fit:
    """The fit of the rest of the chosen effects alone."""
    if not rest:
        return null
    return singles[rest[0]].fit if len(rest) == 1 else fit_effects(likelihood, rest, chosen.theta)
