"""Which other effects could stand in the place of a named one: those that explain new flights as well."""

from collections.abc import Sequence

import torch

from descentflow.diagnosis.inference.aircraft_groups import by_aircraft
from descentflow.diagnosis.inference.likelihood import EffectsLikelihood, Fit
from descentflow.diagnosis.inference.search import fit_effects, score_test_gain
from descentflow.diagnosis.inference.selection_rules import MIN_GAIN_Z, Candidate, is_credible

TIE_Z = 1.64
"""Standard errors by which the named effect must lead for another to be told from it: a one-sided test at 5 %."""
TIE_GAIN = 2.0
"""Nats by which it must lead, however small the standard error: odds of seven to one say little. Set by hand."""
MIN_GAIN_SHARE = 0.5
"""Share of the named effect's gain that another must reach to stand in its place. Set by hand."""
TRIED_SHARE = 0.5
"""Share of what it would have to gain that its score-test gain must reach for another effect to be fitted at all: a fit
can gain more than its sensitivity says. Set by hand."""
DRAWS = 2000
"""Resampled fleets behind a probability: its standard error is at most 1.1 %."""


def rivals_of(
    likelihood: EffectsLikelihood, chosen: Fit, rest: Sequence[str], singles: dict[str, Candidate], gain: float
) -> dict[str, Fit]:
    """Fits with other effects in the place of a named one, where their score-test gain is enough to try.

    Args:
        likelihood: Of the flights.
        chosen: The named effects.
        rest: Those without the one in question.
        singles: Every effect alone.
        gain: Nats that the one in question gains.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_likelihood
        >>> from descentflow.effects import EFFECTS
        >>> likelihood = example_likelihood(EFFECTS["temperature"], [10.0])
        >>> fit = fit_effects(likelihood, ["temperature", "mass"])
        >>> sorted(rivals_of(likelihood, fit, ["temperature"], {}, gain=1000.0))  # none comes near that
        []
    """
    others = [e for e in likelihood.catalogue if e not in chosen.effects]
    if not rest:
        return {e: singles[e].fit for e in others}
    start = {e: chosen.theta[e] for e in rest}
    expected = score_test_gain(likelihood, likelihood.shift(start))
    least = TRIED_SHARE * (MIN_GAIN_SHARE * gain)
    return {e: fit_effects(likelihood, (*rest, e), start) for e in others if expected[e] >= least}


def alike(
    likelihood: EffectsLikelihood, chosen: Fit, others: dict[str, Fit], without: Fit
) -> tuple[tuple[str, ...], float]:
    """Names that do as well as a named effect, and the share of resampled fleets in which that one does best.

    Best is judged among the effects that could be named in its place: those that can be what they say and whose gain
    stands as far above its standard error as a first effect's must. Others may score higher by a few odd flights that
    they alone take up; they are in the group, for these data do not exclude them, and are no rivals for a name.

    Args:
        likelihood: Of the flights.
        chosen: The named effects.
        others: Fits with another in the place of one of them, by its name.
        without: Fit without that one.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_likelihood
        >>> from descentflow.effects import EFFECTS
        >>> likelihood = example_likelihood(EFFECTS["temperature"], [10.0])
        >>> null, fit = fit_effects(likelihood, ()), fit_effects(likelihood, ["temperature"])
        >>> alike(likelihood, fit, {"mass": fit_effects(likelihood, ["mass"])}, null)
        ((), 1.0)
    """
    least = MIN_GAIN_SHARE * likelihood.gain(chosen.log_score, without.log_score)[0]
    same = []
    totals = [by_aircraft(chosen.log_score, likelihood.compared.airframe)]
    for name, fit in others.items():
        lead, error = likelihood.gain(chosen.log_score, fit.log_score)
        gain, gain_error = likelihood.gain(fit.log_score, without.log_score)
        if not is_credible(likelihood, fit, name):
            continue
        if gain >= least and (lead < TIE_Z * error or lead < TIE_GAIN):
            same.append(name)
        if gain >= MIN_GAIN_Z * gain_error:
            totals.append(by_aircraft(fit.log_score, likelihood.compared.airframe))
    scores = torch.stack(totals)
    generator = torch.Generator().manual_seed(0)
    # Rubin's Bayesian bootstrap over aircraft.
    weights = -torch.rand(scores.shape[1], DRAWS, generator=generator, dtype=torch.float64).clamp(min=1e-12).log()
    wins = (scores @ weights).argmax(0) == 0
    return tuple(same), float(wins.double().mean())
