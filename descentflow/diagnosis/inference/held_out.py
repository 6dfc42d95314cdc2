"""What effects shift in flights that their parameters were not learnt from."""

from dataclasses import replace

import torch
from torch import Tensor

from descentflow.diagnosis.inference.aircraft_groups import FOLDS
from descentflow.diagnosis.inference.heterogeneity import heterogeneous_shifts
from descentflow.diagnosis.inference.likelihood import EffectsLikelihood, Fit
from descentflow.diagnosis.inference.search import parameters_of_part

HeldOut = tuple[dict[str, Tensor], dict[str, float]]
"""Shift (n, p) of each effect, and how widely its shares spread."""


def held_out_shifts(likelihood: EffectsLikelihood, fit: Fit) -> HeldOut:
    """Shift (n, p) of each effect with parameters of the other folds' aircraft, and how widely shares spread.

    So a gap is not closed by what was fitted to the very flights in which it is measured. Windows stay where they are,
    and the share that a flight has of an effect is its own: it is a number of that flight, and not of the fleet.

    Example:
        >>> from descentflow.diagnosis.inference.search import fit_effects
        >>> from descentflow.diagnosis.inference.example_sides import example_likelihood
        >>> from descentflow.effects import EFFECTS
        >>> likelihood = example_likelihood(EFFECTS["temperature"], [10.0])
        >>> shifts, spreads = held_out_shifts(likelihood, fit_effects(likelihood, ["temperature"]))
        >>> shifts["temperature"].shape, sorted(spreads)
        (torch.Size([160, 33]), ['temperature'])
    """
    found, spreads = heterogeneous_shifts(likelihood, fit)
    for fold in range(FOLDS if fit.theta else 0):
        out = likelihood.fold == fold
        moved = parameters_of_part(likelihood, fit, ~out)
        for name, shift in heterogeneous_shifts(likelihood, replace(fit, theta=moved))[0].items():
            found[name] = torch.where(out[:, None], shift, found[name])
    return found, spreads
