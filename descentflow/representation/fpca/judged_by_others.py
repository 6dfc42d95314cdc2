"""Two constants of a probabilistic PCA, learnt from flights that it was not fitted to.

Flights are dealt into parts; each part judges what was fitted to the others. The weight of the prior against roughness
is the one under which the judges are most probable; then the length of the noise is the one that misses their tops
least where these are hidden.
"""

from collections.abc import Callable

import torch
from torch import Tensor

from descentflow.representation.fpca import ppca
from descentflow.representation.fpca.hidden import LENGTHS, hide, missed
from descentflow.representation.fpca.roughness import smoothed

WEIGHTS = (0.0, *(10.0**k for k in range(8)))
"""Weights of the prior among which one is chosen, in flights; zero takes levels as they are."""
TUNING_FLIGHTS = 1000
"""Flights that are dealt, at most: more would take time and change little."""
FOLDS = 3
"""Parts."""
FEWEST = 6
"""Flights below which nothing is learnt: the model is taken as it is."""

Fit = Callable[[Tensor, Tensor], ppca.PPCA]


def roughness_and_length(centred: Tensor, mask: Tensor, mean: Tensor, fit: Fit) -> tuple[float, float]:
    """Weight of the prior against roughness, in flights, and length of the noise, in levels.

    Args:
        centred: (n, L) profiles minus their mean, zero where missing.
        mask: (n, L) observed.
        mean: (L,) what was subtracted, in the same units.
        fit: Fits a model to some of the flights.

    Example:
        >>> shape = torch.linspace(-1, 1, 60).double()
        >>> curves = torch.randn(40, 1).double() * shape + 0.5 * torch.randn(40, 60).double()
        >>> seen = torch.arange(60) < torch.randint(30, 90, (40, 1))
        >>> one = lambda values, mask: ppca.em(values, mask, 1, max_iterations=50, tolerance=1e-6)
        >>> weight, length = roughness_and_length(curves, seen, torch.zeros(60).double(), one)
        >>> weight > 100, length in LENGTHS  # the shape is a line
        (True, True)
    """
    if len(mask) < FEWEST:
        return 0.0, 1.0
    centred, mask = centred[:TUNING_FLIGHTS], mask[:TUNING_FLIGHTS]
    fold = torch.arange(len(mask), device=mask.device) % FOLDS
    parts = [(fold != one, fold == one) for one in range(FOLDS)]
    models = [fit(centred[rest], mask[rest]) for rest, _ in parts]
    # What a judge shows where none of the others does, their model cannot know.
    known = [mask[judge] & mask[rest].any(0) for rest, judge in parts]

    def candidates(weight: float) -> list[ppca.PPCA]:
        return [
            smoothed(model, weight, centred[rest], mask[rest], mean)
            for model, (rest, _) in zip(models, parts, strict=True)
        ]

    def fit_of(weight: float) -> float:
        found = 0.0
        for model, (_, judge), seen in zip(candidates(weight), parts, known, strict=True):
            shown = torch.where(seen, centred[judge] - model.shift, 0.0)
            found += float(ppca.log_likelihood(shown, seen, model.loadings, model.noise_variance))
        return found

    # Where nothing is missing, all levels are of the same flights, and the closed form stands as it is.
    weight = 0.0 if bool(mask.all()) else max(WEIGHTS, key=fit_of)
    generator = torch.Generator().manual_seed(0)
    judged = [
        (model, centred[judge] - model.shift, seen, hide(seen, "top", 0.3, generator))
        for model, (_, judge), seen in zip(candidates(weight), parts, known, strict=True)
    ]

    found = [
        missed(values, seen & ~hidden, hidden, model.loadings, model.noise_variance)
        for model, values, seen, hidden in judged
    ]
    return weight, min(zip(map(sum, zip(*found, strict=True)), LENGTHS, strict=True))[1]
