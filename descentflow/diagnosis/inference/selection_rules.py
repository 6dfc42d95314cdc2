"""The rules by which effects are named: what a gain must reach, what is credible, and when no effect is enough.

Gains are held-out log scores in nats, and their standard errors count whole aircraft once. Where the text of a constant
names no source, it was set by hand on simulated flights with injected effects while the diagnosis was written, and no
record of the alternatives was kept; what the rules give together is what :mod:`descentflow.studies.blind_diagnosis`
measures.
"""

from dataclasses import dataclass

import torch
from torch import Tensor

from descentflow.diagnosis.inference.heterogeneity import spreads_as_claimed
from descentflow.diagnosis.inference.likelihood import EffectsLikelihood, Fit

MIN_GAIN = 4.0
"""Held-out gain below which no first effect is named, nats.

Set by hand; odds of 55 to 1, which is "strong" on the scale of Kass and Raftery (1995, JASA 90)."""
MIN_GAIN_Z = 2.0
"""Standard errors that the gain of a first effect must reach; one-sided, a normal law gives it once in 44."""
MIN_FURTHER_GAIN = 12.0
"""Held-out gain below which no further effect is named, nats.

Larger than :data:`MIN_GAIN`, for what the equations of the first effect leave of it must not be named. Set by hand."""
MIN_FURTHER_GAIN_Z = 2.5
"""Standard errors that the gain of a further effect must reach: a dozen of them are tried again. Set by hand."""
MIN_FURTHER_SHARE = 0.004
"""Share of all that is explained so far which a further effect must gain, where it moves other quantities.

What the first leaves of itself grows with it: a fixed number of nats would name it in every large gap. Set by hand."""
MIN_OVERLAP_SHARE = 0.05
"""The same share where the further effect moves the quantities that the first moves: no model of the first is exact.

Set by hand."""
MISFIT_SHARE = 0.02
"""Share of what an effect explains in some entries that its own misfit leaves there.

A shift that is off by a seventh leaves (1/7)^2 = 2 % of the squares that it explains; in the entries where both act, a
further effect must gain more than this."""
MIN_OUTSIDE_SHARE = 0.3
"""Share of what a free discrepancy explains in its place that a first effect must explain; less is outside.

Not more, for there may be two effects: each of two of one size explains about half. Set by hand."""
MIN_FURTHER_OUTSIDE_SHARE = 0.7
"""The same share for a further effect that moves the same quantities: no third is expected there. Set by hand."""
OUTSIDE_GAIN = 60.0
"""Nats that a free discrepancy must gain beyond the best effect to count, where effects explain most of the gap.

Large, for what equations leave out of a large gap is no other cause. Set by hand."""
OUTSIDE_GAIN_Z = 4.0
"""Standard errors that this gain must reach. Set by hand."""
OUTSIDE_GAIN_MOST = 25.0
"""The same nats where the rest is more than what is explained: then there is no large effect whose misfit it is.

Set by hand."""
OUTSIDE_GAIN_MOST_Z = 3.3
"""Standard errors that this gain must reach."""
MAX_UNEXPLAINED_SHARE = 0.13
"""Share of what effects and a free discrepancy explain together that may be left to the latter; more is outside.

Set by hand."""
MIN_MEAN_SHIFT = 1.5
"""Mean shift, in negligible shifts of its quantity, below which no effect is named however sure it is.

Set by hand: it must matter in practice, and not only be certain."""


@dataclass(frozen=True)
class Candidate:
    """What an effect adds to those already chosen: the fit with it, the gain (nats) and its standard error.

    Example:
        >>> from descentflow.diagnosis.inference.search import fit_effects
        >>> from descentflow.diagnosis.inference.example_sides import example_likelihood
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


def best_candidate(
    likelihood: EffectsLikelihood, candidates: dict[str, Candidate], chosen: Fit, so_far: float
) -> Candidate | None:
    """The candidate of the largest gain that counts, if any.

    Args:
        likelihood: Of the flights.
        candidates: By effect.
        chosen: Effects that are named so far.
        so_far: Nats that those gain over no effect.

    Example:
        >>> from descentflow.diagnosis.inference.search import fit_effects
        >>> from descentflow.diagnosis.inference.example_sides import example_likelihood
        >>> from descentflow.effects import EFFECTS
        >>> likelihood = example_likelihood(EFFECTS["temperature"], [10.0])
        >>> null, fit = fit_effects(likelihood, ()), fit_effects(likelihood, ["temperature"])
        >>> candidate = Candidate(fit, *likelihood.gain(fit.log_score, null.log_score))
        >>> best_candidate(likelihood, {"temperature": candidate}, null, 0.0) is candidate
        True
    """
    for candidate in sorted(candidates.values(), key=lambda c: -c.gain):
        if candidate.gain < MIN_GAIN:
            return None
        name = candidate.fit.effects[-1]
        theta = candidate.fit.theta[name]
        counts = (
            counts_as_first(likelihood, candidate)
            if not chosen.effects
            else _counts_as_further(likelihood, candidate, chosen, so_far)
        )
        large = counts and is_credible(likelihood, candidate.fit, name)
        if large and mean_shift(likelihood, name, theta) >= MIN_MEAN_SHIFT:
            return candidate
    return None


def is_credible(likelihood: EffectsLikelihood, fit: Fit, name: str) -> bool:
    """Whether parameters and spread between flights can be what the effect says.

    Example:
        >>> from descentflow.diagnosis.inference.search import fit_effects
        >>> from descentflow.diagnosis.inference.example_sides import example_likelihood
        >>> from descentflow.effects import EFFECTS
        >>> likelihood = example_likelihood(EFFECTS["temperature"], [10.0])
        >>> null, fit = fit_effects(likelihood, ()), fit_effects(likelihood, ["temperature"])
        >>> candidate = Candidate(fit, *likelihood.gain(fit.log_score, null.log_score))
        >>> is_credible(likelihood, fit, "temperature")
        True
    """
    plausible = likelihood.catalogue[name].plausible(likelihood.compared.state, fit.theta[name])
    return plausible and spreads_as_claimed(likelihood, fit, name)


def counts_as_first(likelihood: EffectsLikelihood, candidate: Candidate) -> bool:
    """Whether a first effect gains enough.

    Example:
        >>> from descentflow.diagnosis.inference.search import fit_effects
        >>> from descentflow.diagnosis.inference.example_sides import example_likelihood
        >>> from descentflow.effects import EFFECTS
        >>> likelihood = example_likelihood(EFFECTS["temperature"], [10.0])
        >>> null, fit = fit_effects(likelihood, ()), fit_effects(likelihood, ["temperature"])
        >>> candidate = Candidate(fit, *likelihood.gain(fit.log_score, null.log_score))
        >>> counts_as_first(likelihood, candidate)
        True
    """
    # Against samples, which are coarser than flights, a first effect has to show as much as a further one.
    least = MIN_GAIN if likelihood.compared.slack == 1.0 else MIN_FURTHER_GAIN
    return candidate.gain >= least and candidate.gain >= MIN_GAIN_Z * candidate.error


def _counts_as_further(likelihood: EffectsLikelihood, candidate: Candidate, chosen: Fit, so_far: float) -> bool:
    """Whether a further effect gains enough as a whole, or in one of two parts by itself.

    What the chosen effects leave of themselves lies where they act. So a further one may show elsewhere, or where they
    act too: there it is held against what they explain there, and not against all that they explain.
    """
    if is_needless(candidate.gain, candidate.error):
        return False
    share = MIN_OVERLAP_SHARE if overlaps(likelihood, candidate.fit) else MIN_FURTHER_SHARE
    if candidate.gain >= share * so_far:
        return True
    own = acts_on(likelihood, candidate.fit, candidate.fit.effects[-1])
    taken = torch.stack([acts_on(likelihood, chosen, name) for name in chosen.effects]).any(0)
    elsewhere = _counts_in(likelihood, own & ~taken, candidate.fit, chosen, MIN_FURTHER_SHARE * so_far)
    return elsewhere or _counts_in(likelihood, own & taken, candidate.fit, chosen, 0.0)


def is_needless(gain: float, error: float) -> bool:
    """Whether a further effect gains too little, in nats or in standard errors, to be kept.

    Example:
        >>> is_needless(30.0, 5.0), is_needless(30.0, 15.0), is_needless(10.0, 1.0)
        (False, True, True)
    """
    return gain < MIN_FURTHER_GAIN or gain < MIN_FURTHER_GAIN_Z * error


def _counts_in(likelihood: EffectsLikelihood, part: Tensor, fit: Fit, chosen: Fit, least: float) -> bool:
    """Whether a further effect gains enough in some entries (p,) alone."""
    at = torch.nonzero(part)[:, 0]
    if not len(at):
        return False
    scores = [likelihood.log_score_in(at, theta) for theta in ({}, chosen.theta, fit.theta)]
    before = likelihood.gain(scores[1], scores[0])[0]
    gain, error = likelihood.gain(scores[2], scores[1])
    return gain >= max(MIN_FURTHER_GAIN, least, MISFIT_SHARE * before) and gain >= MIN_FURTHER_GAIN_Z * error


def stands_out(rest: float, error: float, explained: float) -> bool:
    """Whether what a free discrepancy gains beside the effects is too much to be their misfit.

    Args:
        rest: Its gain, nats.
        error: Standard error of that.
        explained: Gain of the effects.

    Example:
        >>> stands_out(40.0, 8.0, explained=500.0), stands_out(40.0, 8.0, explained=10.0)
        (False, True)
    """
    most = rest > explained
    least, z = (OUTSIDE_GAIN_MOST, OUTSIDE_GAIN_MOST_Z) if most else (OUTSIDE_GAIN, OUTSIDE_GAIN_Z)
    return rest > least and rest > z * error


def share_needed(likelihood: EffectsLikelihood, fit: Fit) -> float:
    """Share of what a free discrepancy explains in its place that the last effect of a fit must explain.

    Example:
        >>> from descentflow.diagnosis.inference.search import fit_effects
        >>> from descentflow.diagnosis.inference.example_sides import example_likelihood
        >>> from descentflow.effects import EFFECTS
        >>> likelihood = example_likelihood(EFFECTS["temperature"], [10.0])
        >>> null, fit = fit_effects(likelihood, ()), fit_effects(likelihood, ["temperature"])
        >>> candidate = Candidate(fit, *likelihood.gain(fit.log_score, null.log_score))
        >>> share_needed(likelihood, fit)
        0.3
    """
    further = len(fit.effects) > 1 and overlaps(likelihood, fit)
    return MIN_FURTHER_OUTSIDE_SHARE if further else MIN_OUTSIDE_SHARE


def overlaps(likelihood: EffectsLikelihood, fit: Fit) -> bool:
    """Whether the last effect moves a quantity that the others move.

    Example:
        >>> from descentflow.diagnosis.inference.search import fit_effects
        >>> from descentflow.diagnosis.inference.example_sides import example_likelihood
        >>> from descentflow.effects import EFFECTS
        >>> likelihood = example_likelihood(EFFECTS["temperature"], [10.0])
        >>> overlaps(likelihood, fit_effects(likelihood, ["temperature", "mass"]))  # both move the rate
        True
    """
    *others, last = (_quantities_moved(likelihood, fit, name) for name in fit.effects)
    return any(last & other for other in others)


def _quantities_moved(likelihood: EffectsLikelihood, fit: Fit, name: str) -> set[str]:
    acts = acts_on(likelihood, fit, name).tolist()
    return {e.quantity for e, there in zip(likelihood.compared.entries, acts, strict=True) if there}


def acts_on(likelihood: EffectsLikelihood, fit: Fit, name: str) -> Tensor:
    """Entries (p,) whose mean an effect moves by something that matters.

    Example:
        >>> from descentflow.diagnosis.inference.search import fit_effects
        >>> from descentflow.diagnosis.inference.example_sides import example_likelihood
        >>> from descentflow.effects import EFFECTS
        >>> likelihood = example_likelihood(EFFECTS["temperature"], [10.0])
        >>> null, fit = fit_effects(likelihood, ()), fit_effects(likelihood, ["temperature"])
        >>> candidate = Candidate(fit, *likelihood.gain(fit.log_score, null.log_score))
        >>> entries = acts_on(likelihood, fit, "temperature")
        >>> sorted({e.quantity for e, acts in zip(likelihood.compared.entries, entries, strict=True) if acts})
        ['rate', 'tas']
    """
    shift = likelihood.all_shift(name, fit.theta[name])[likelihood.real].mean(0)
    return shift.abs() > likelihood.compared.negligible()


def mean_shift(likelihood: EffectsLikelihood, name: str, theta: Tensor) -> float:
    """Largest mean shift over the entries, in negligible shifts.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_likelihood
        >>> from descentflow.effects import EFFECTS
        >>> likelihood = example_likelihood(EFFECTS["temperature"], [10.0])
        >>> mean_shift(likelihood, "temperature", torch.tensor([10.0]).double()) > 10  # times what is negligible
        True
    """
    shift = likelihood.all_shift(name, theta)[likelihood.real]
    seen = likelihood.compared.y[likelihood.real].isfinite()
    mean = torch.where(seen, shift, 0.0).sum(0) / seen.sum(0).clamp(min=1)
    return float((mean.abs() / likelihood.compared.negligible()).max())
