"""Every effect alone."""

from collections.abc import Callable
from dataclasses import dataclass, replace

from descentflow.diagnosis.inference.likelihood import EffectsLikelihood, Fit
from descentflow.diagnosis.inference.search import fit_effects, score_test_gain

MIN_SCORE_TEST_GAIN = 1.0
"""Nats of score-test gain below which an effect is not fitted alone, to save time: a prior costs more."""


@dataclass(frozen=True)
class Candidate:
    """An effect alone: its fit, what that gains (nats) and the standard error.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_likelihood
        >>> from descentflow.diagnosis.inference.search import fit_effects
        >>> from descentflow.effects import EFFECTS
        >>> likelihood = example_likelihood(EFFECTS["temperature"], [10.0])
        >>> null, fit = fit_effects(likelihood, ()), fit_effects(likelihood, ["temperature"])
        >>> candidate = Candidate(fit, *likelihood.gain(fit.log_score, null.log_score))
        >>> candidate.gain > 3 * candidate.error
        True
    """

    fit: Fit
    gain: float
    error: float


def every_single(likelihood: EffectsLikelihood, null: Fit, progress: Callable[[str], None]) -> dict[str, Candidate]:
    """Every effect alone; those without a score-test gain are not fitted, and gain nothing.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_likelihood
        >>> from descentflow.diagnosis.inference.search import fit_effects
        >>> from descentflow.effects import EFFECTS
        >>> likelihood = example_likelihood(EFFECTS["temperature"], [10.0])
        >>> singles = every_single(likelihood, fit_effects(likelihood, ()), lambda stage: None)
        >>> max(singles, key=lambda name: singles[name].gain)
        'temperature'
    """
    found: dict[str, Candidate] = {}
    expected = score_test_gain(likelihood, null.shift)
    promising = [name for name in likelihood.catalogue if expected[name] >= MIN_SCORE_TEST_GAIN]
    for name in likelihood.catalogue:
        if name in promising:
            progress(f"fitting {name}")
            fit = fit_effects(likelihood, (name,), {})
            found[name] = Candidate(fit, *likelihood.gain(fit.log_score, null.log_score))
        else:
            start = likelihood.start_of(name)
            found[name] = Candidate(replace(null, effects=(name,), theta={name: start}), 0.0, 0.0)
    return found
