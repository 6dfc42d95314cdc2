"""Whether an effect can be what its fit says: possible parameters, a spread as claimed, a size that matters."""

import torch
from torch import Tensor

from descentflow.diagnosis.inference.heterogeneity import spreads_as_claimed
from descentflow.diagnosis.inference.likelihood import EffectsLikelihood, Fit
from descentflow.diagnosis.inference.mistaken import share_its_own
from descentflow.diagnosis.inference.mixed_fit import is_of_some
from descentflow.diagnosis.inference.model_weights import ODD

MIN_MEAN_SHIFT = 1.5
"""Mean shift, in negligible shifts of its quantity, below which no effect is named however sure it is.

0.3 % of the rate, 0.75 kt of CAS, 0.08 % of the TAS: what is smaller changes no time to FL150 by more than 3 s."""
LEAST_ITS_OWN = 0.5
"""Of the flights that seem to have an effect each in its own way, the share in which it must be likelier than what
another effect leaves behind: as likely as not."""


def is_credible(likelihood: EffectsLikelihood, fit: Fit, name: str) -> bool:
    """Whether an effect of a fit can be what it says, and matters.

    Example:
        >>> from descentflow.diagnosis.inference.search import fit_effects
        >>> from descentflow.diagnosis.inference.example_sides import example_likelihood
        >>> from descentflow.effects import EFFECTS
        >>> likelihood = example_likelihood(EFFECTS["temperature"], [10.0])
        >>> is_credible(likelihood, fit_effects(likelihood, ["temperature"]), "temperature")
        True
    """
    theta = fit.theta[name]
    if not likelihood.catalogue[name].plausible(likelihood.compared.state, theta):
        return False
    share, _ = likelihood.catalogue[name].mixture(theta)
    if share <= ODD:
        # As many flights may be odd, whatever they have.
        return False
    if is_of_some(likelihood, name, theta) and name not in fit.per_flight:
        # What some flights have shows in them one by one; a cause that all have alike may imitate the mean of it.
        return False
    if name in fit.per_flight and share_its_own(likelihood, fit, name) < LEAST_ITS_OWN:
        # Most of its flights are those in which another effect left something, and say nothing of this one.
        return False
    return mean_shift(likelihood, name, theta) >= MIN_MEAN_SHIFT and spreads_as_claimed(likelihood, fit, name)


def mean_shift(likelihood: EffectsLikelihood, name: str, theta: Tensor) -> float:
    """Largest mean shift over the entries, in negligible shifts.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_likelihood
        >>> from descentflow.effects import EFFECTS
        >>> likelihood = example_likelihood(EFFECTS["temperature"], [10.0])
        >>> mean_shift(likelihood, "temperature", torch.tensor([10.0]).double()) > 10  # times what is negligible
        True
    """
    shift = likelihood.real_shift(name, theta)
    seen = likelihood.compared.y[likelihood.real].isfinite()
    mean = torch.where(seen, shift, 0.0).sum(0) / seen.sum(0).clamp(min=1)
    return float((mean.abs() / likelihood.compared.negligible()).max())
