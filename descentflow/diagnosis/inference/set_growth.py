"""What one more effect beside a fit promises, on held-out flights, were shifts linear."""

from collections.abc import Mapping

import torch
from torch import Tensor

from descentflow.diagnosis.inference.free_discrepancy import FreeDiscrepancy
from descentflow.diagnosis.inference.likelihood import EffectsLikelihood, Fit
from descentflow.diagnosis.inference.mixed_fit import without_laws
from descentflow.diagnosis.inference.search import first_guess
from descentflow.diagnosis.inference.subset_screening import member_of, plain_and_free


def others_beside(likelihood: EffectsLikelihood, fit: Fit, start: Mapping[str, Tensor]) -> dict[str, Tensor]:
    """Effects that a fit does not have, with the parameters where each would begin: windowed ones in their best window.

    Of effects that scale one equation together a fit has one at most.

    Args:
        likelihood: Of the flights.
        fit: That has effects already.
        start: Parameters of every effect.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_likelihood
        >>> from descentflow.diagnosis.inference.search import fit_effects
        >>> from descentflow.effects import EFFECTS
        >>> likelihood = example_likelihood(EFFECTS["temperature"], [10.0])
        >>> start = {name: effect.start() for name, effect in EFFECTS.items()}
        >>> others = others_beside(likelihood, fit_effects(likelihood, ["mass"]), start)
        >>> "temperature" in others, "drag_polar" in others  # mass and drag scale the same equation
        (True, False)
    """
    catalogue = likelihood.catalogue
    scaled = {member for name in fit.effects if (group := catalogue[name].scale_group) for member in group.members}
    flights, alike = _part_alike(likelihood, fit)
    return {
        name: start[name] if likelihood.windowed(name) is None else first_guess(flights, name, alike)
        for name in catalogue
        if name not in {*fit.effects, *scaled}
    }


def promised_beside(
    likelihood: EffectsLikelihood, free: FreeDiscrepancy, fit: Fit, others: Mapping[str, Tensor], log_odds: float
) -> dict[str, float]:
    """Nats that each effect promises beside a fit, with its prior; those that promise nothing left out.

    A set is worth what it scores with or without a discrepancy beside it, whichever is more: an effect that explains
    what a discrepancy takes otherwise promises only what is beyond that.

    Args:
        likelihood: Of the flights.
        free: The discrepancy.
        fit: That has effects already; what flights have of them each in their own way is taken off first.
        others: Effects with parameters (k,) about which they are looked at.
        log_odds: Prior odds of an effect, and of a discrepancy.

    Example:
        >>> from descentflow.diagnosis.inference.discrepancy import discrepancy_columns
        >>> from descentflow.diagnosis.inference.example_sides import example_likelihood
        >>> from descentflow.diagnosis.inference.search import fit_effects
        >>> from descentflow.effects import EFFECTS
        >>> likelihood = example_likelihood(EFFECTS["temperature"], [10.0])
        >>> free = FreeDiscrepancy(likelihood, discrepancy_columns(likelihood.compared))
        >>> others = {name: EFFECTS[name].start() for name in ("temperature", "mass", "speed_schedule")}
        >>> promised = promised_beside(likelihood, free, fit_effects(likelihood, []), others, -2.5)
        >>> max(promised, key=promised.get)
        'temperature'
    """
    flights, alike = _part_alike(likelihood, fit)
    members = [member_of(likelihood, name, theta) for name, theta in (*alike.items(), *others.items())]
    base = tuple(range(len(alike)))
    sets = [base, *((*base, at) for at in range(len(alike), len(members)))]
    beside = free.beside(fit)
    plain = float(fit.log_score.sum()) - likelihood.improbability(fit.shift, fit.design)
    wide = float(beside.log_score.sum()) - beside.cost + log_odds
    promised = dict.fromkeys(others, -torch.inf)
    screenings = plain_and_free(flights, members, free.columns, beside.precision)
    for known, screening in zip((plain, wide), screenings, strict=True):
        scores = screening.scores(sets)
        of_fit = scores[tuple(sorted(alike))]
        for name in others:
            gain = scores[tuple(sorted((*alike, name)))] - of_fit
            promised[name] = max(promised[name], known + gain - max(plain, wide) + log_odds)
    return {name: nats for name, nats in promised.items() if nats > 0}


def _part_alike(likelihood: EffectsLikelihood, fit: Fit) -> tuple[EffectsLikelihood, dict[str, Tensor]]:
    """Flights without what they have each in their own way, and the parameters of what all have alike."""
    flights = without_laws(likelihood, fit) if fit.per_flight else likelihood
    return flights, {name: theta for name, theta in fit.theta.items() if name not in fit.per_flight}
