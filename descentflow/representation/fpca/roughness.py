r"""A prior against rough mean and components, for flights that are few.

Probabilistic PCA takes every level for itself. Where few flights show a level, its mean and loadings are those of other
flights than one level below, and what is flown with them changes speed faster than any flight does. The prior of a
curve f over the levels is that of a smoothing spline, $p(f) \propto \exp(-\lambda \sum_l (\Delta^2 f_l)^2 / 2)$, and
each level counts as many times as flights show it (Whittaker 1923; Green and Silverman 1994, chapter 2). The weight
$\lambda$ is learnt, and the length of the noise with it, from flights that a model was not fitted to: flights are dealt
into parts, and each judges what was fitted to the others. The weight is the one under which the judges are most
probable; then the length is the one that misses their tops least where these are hidden.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Literal

import torch
from torch import Tensor

from descentflow.core.errors import ConfigError
from descentflow.representation.fpca import ppca
from descentflow.representation.fpca.mask_groups import group_masks
from descentflow.representation.fpca.ppca import PPCA, level_products, noise_given_loadings, posterior_given

SPREAD_WEIGHT = 1e5
"""Of the prior for how far flights spread at each level, in flights: some 20 levels for 2,000 of them."""
NO_FLIGHT = 1e-3
"""Weight of a level without a flight: its neighbours interpolate it."""


def smoother(counts: Tensor, weight: float) -> Tensor:
    """Matrix (L, L) that takes a curve to its most probable smooth one.

    Args:
        counts: (L,) flights that show each level.
        weight: Of the prior, in flights.

    Example:
        >>> line = torch.arange(5).double()
        >>> torch.allclose(smoother(torch.ones(5).double(), 1e6) @ line, line)  # straight lines are not rough
        True
    """
    bend = torch.eye(len(counts), dtype=counts.dtype, device=counts.device).diff(dim=0).diff(dim=0)
    shown = torch.diag(counts.clamp(min=NO_FLIGHT))
    matrix: Tensor = torch.linalg.solve(shown + weight * bend.T @ bend, shown)
    return matrix


def smoothed(fitted: PPCA, weight: float, centred: Tensor, mask: Tensor, mean: Tensor) -> PPCA:
    """A model with mean and loadings smoothed, and the noise that is then left.

    Args:
        fitted: To flights from which ``mean`` was taken.
        weight: Of the prior, in flights; zero leaves the model as it is.
        centred: (n, L) those flights, zero where missing.
        mask: (n, L) observed.
        mean: (L,) in the units of the model.

    Example:
        >>> curves = torch.randn(50, 1).double() * torch.tensor([0.0, 1.0, 0.0, 1.0]).double()
        >>> rough = PPCA(torch.tensor([[0.0], [1.0], [0.0], [1.0]]).double(), torch.tensor(1e-6).double(),
        ...              torch.zeros(4).double(), [], converged=True)
        >>> smooth = smoothed(rough, 1e9, curves, torch.ones(50, 4, dtype=torch.bool), torch.zeros(4).double())
        >>> smooth.loadings.flatten().diff().round(decimals=3)  # a line
        tensor([0.2000, 0.2000, 0.2000], dtype=torch.float64)
        >>> bool(smooth.noise_variance > 0.1)
        True
    """
    if weight == 0:
        return fitted
    matrix = smoother(mask.sum(0).to(centred.dtype), weight)
    loadings, shift = matrix @ fitted.loadings, matrix @ (mean + fitted.shift) - mean
    shown = torch.where(mask, centred - shift, 0.0)
    noise = noise_given_loadings(shown, mask, loadings, fitted.noise_variance)
    return replace(fitted, loadings=loadings, shift=shift, noise_variance=noise)


WEIGHTS = (0.0, *(10.0**k for k in range(8)))
"""Weights of the prior among which one is chosen, in flights; zero takes levels as they are."""
TUNING_FLIGHTS = 1000
"""Flights that are dealt, at most: more would take time and change little."""
FOLDS = 3
"""Parts."""
FEWEST = 6
"""Flights below which nothing is learnt: the model is taken as it is."""

Fit = Callable[[Tensor, Tensor], ppca.PPCA]
Pattern = Literal["top", "random", "slow"]
MOST_HIDDEN = 0.9
"""Share of its levels that a flight loses at most."""
MIN_SHARE_SHOWN = 0.1
"""Share of the flights that still show each level: the grid of a type ends where a quarter of them do."""
LENGTHS = (1.0, 3.0, 10.0, 30.0, 100.0, 300.0)
"""Correlation lengths of the noise in levels, among which one is chosen."""


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


def hide(
    mask: Tensor, pattern: Pattern, share: float, generator: torch.Generator, speed: Tensor | None = None
) -> Tensor:
    """Levels (n, L) to hide of those observed.

    ``top`` hides from each flight's highest level down, a share drawn between zero and twice ``share``; ``random``
    hides single levels with probability ``share``; ``slow`` hides tops of the slower half of the flights alone, twice
    as much of each, as where slow operators cruise low: what is hidden then depends on what is shown. No flight loses
    all levels, and levels that less than a tenth of the flights would still show are not hidden from any.

    Args:
        mask: (n, L) observed.
        pattern: Which levels.
        share: How many.
        generator: Of the draws.
        speed: (n,) by which flights are slow, for ``slow``.

    Raises:
        ConfigError: If ``slow`` is asked for without speeds.

    Example:
        >>> hide(torch.ones(5, 200, dtype=torch.bool), "top", 0.3, torch.Generator().manual_seed(0)).shape
        torch.Size([5, 200])
    """
    if pattern == "random":
        hidden = mask & (torch.rand(mask.shape, generator=generator) < share)
    else:
        part = 2 * share * torch.rand(len(mask), 1, generator=generator)
        if pattern == "slow":
            if speed is None:
                raise ConfigError("the pattern 'slow' without speeds", expected="a speed a flight", mend="pass speed")
            part = torch.where((speed < speed.median())[:, None], (2 * part).clamp(max=MOST_HIDDEN), 0.0)
        from_top = mask.flip(1).cumsum(1).flip(1)
        hidden = mask & (from_top <= part * mask.sum(1, keepdim=True))
    hidden = hidden & (mask & ~hidden).any(1, keepdim=True)
    return hidden & ((mask & ~hidden).sum(0) >= MIN_SHARE_SHOWN * len(mask))


def missed(
    centred: Tensor, seen: Tensor, hidden: Tensor, loadings: Tensor, noise: Tensor, lengths: Sequence[float] = LENGTHS
) -> list[float]:
    """Sum of the squared errors on hidden levels, of what is expected there given the others, for each length.

    A probabilistic PCA takes the residual of its components for white noise, independent from level to level. It is
    smooth: neighbouring levels carry the same information, and a flight's weights, trusted to a precision that they do
    not have, diverge above its highest level. So several levels count as one: the noise variance is multiplied by their
    number, the one of :data:`LENGTHS` that misses least.

    Args:
        centred: (n, L) values minus the mean.
        seen: (n, L) levels that are given.
        hidden: (n, L) levels that are asked for.
        loadings: (L, q).
        noise: Noise variance.
        lengths: Levels that count as one.

    Example:
        >>> centred = torch.tensor([[2.0, 2.0]]).double()
        >>> told = torch.tensor([[True, False]])
        >>> found = missed(centred, told, ~told, torch.ones(2, 1).double(), torch.tensor(1.0).double(), [1.0, 3.0])
        >>> [round(one, 9) for one in found]  # (2 - 2 / (1 + 1))^2 and (2 - 2 / (1 + 3))^2
        [1.0, 2.25]
    """
    groups = group_masks(seen)
    projected, grams = torch.where(seen, centred, 0.0) @ loadings, level_products(groups, loadings)
    asked = torch.where(hidden, centred, 0.0)
    errors = []
    for length in lengths:
        latent, _, _ = posterior_given(projected, groups, grams, noise * length)
        expected = latent @ loadings.T
        errors.append(float(torch.linalg.vector_norm(expected.mul_(hidden) - asked)) ** 2)
    return errors
