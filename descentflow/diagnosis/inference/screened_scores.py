"""What sets of effects promise beside a fit, with the effects of that fit that flights have each in their own way."""

from collections.abc import Mapping, Sequence

from torch import Tensor

from descentflow.diagnosis.inference.discrepancy import DiscrepancyColumns
from descentflow.diagnosis.inference.free_discrepancy import FreeDiscrepancy
from descentflow.diagnosis.inference.inclusion import Names
from descentflow.diagnosis.inference.likelihood import EffectsLikelihood, Fit
from descentflow.diagnosis.inference.mixed_fit import without_laws
from descentflow.diagnosis.inference.subset_screening import MAX_EFFECTS, Member, plain_and_free, sets_of

BothScores = tuple[dict[Names, float], dict[Names, float]]
"""Scores of sets without a discrepancy, and with one."""


def screened_scores(
    likelihood: EffectsLikelihood, free: FreeDiscrepancy, members: Sequence[Member], beside: Fit, cost: float
) -> BothScores:
    """Screened scores of all sets, without a discrepancy and with one as wide as beside a fit.

    Where the fit has effects that flights have each in their own way, sets with these are screened on the flights
    without them: a mean shift would leave too much of them for others to explain.

    Args:
        likelihood: Of the flights.
        free: The discrepancy.
        members: Effects, each about parameters.
        beside: The fit.
        cost: Nats by which what the fit says of its signatures is improbable.

    Example:
        >>> from descentflow.diagnosis.inference.discrepancy import discrepancy_columns
        >>> from descentflow.diagnosis.inference.example_sides import example_likelihood
        >>> from descentflow.diagnosis.inference.search import fit_effects
        >>> from descentflow.diagnosis.inference.subset_screening import member_of
        >>> from descentflow.effects import EFFECTS
        >>> likelihood = example_likelihood(EFFECTS["temperature"], [10.0])
        >>> free = FreeDiscrepancy(likelihood, discrepancy_columns(likelihood.compared))
        >>> members = [member_of(likelihood, name, EFFECTS[name].start()) for name in ("temperature", "mass")]
        >>> plain, wide = screened_scores(likelihood, free, members, fit_effects(likelihood, ()), cost=0.0)
        >>> plain[("temperature",)] > plain[()], wide[()] > plain[()]
        (True, True)
    """
    of_beside, laws = free.beside(beside), set(beside.per_flight)
    found = _of_sets(likelihood, free.columns, of_beside.precision, members, MAX_EFFECTS)
    if not laws:
        return found
    others = [member for member in members if member.name not in laws]
    flights, most = without_laws(likelihood, beside), MAX_EFFECTS - len(laws)
    more = _of_sets(flights, free.columns, of_beside.precision, others, most)
    plain, wide = (float(score.sum()) - cost for score in (beside.log_score, of_beside.log_score))
    return _with_laws(found[0], more[0], plain, beside), _with_laws(found[1], more[1], wide, beside)


def _of_sets(
    likelihood: EffectsLikelihood, columns: DiscrepancyColumns, precision: Tensor, members: Sequence[Member], most: int
) -> BothScores:
    """Scores of all sets of at most so many members."""
    sets = sets_of(members, most)
    plain, free = plain_and_free(likelihood, members, columns, precision)
    return plain.scores(sets), free.scores(sets)


def _with_laws(
    found: Mapping[Names, float], more: Mapping[Names, float], of_beside: float, beside: Fit
) -> dict[Names, float]:
    """Scores of sets, those with all laws of a fit by what they score on flights without these."""
    laws = set(beside.per_flight)
    offset = of_beside - more[tuple(sorted(set(beside.effects) - laws))]
    kept = {names: score for names, score in found.items() if not laws <= set(names)}
    return kept | {tuple(sorted({*names, *laws})): score + offset for names, score in more.items()}
