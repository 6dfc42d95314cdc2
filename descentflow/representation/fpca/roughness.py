r"""A prior against rough mean and components, for flights that are few.

Probabilistic PCA takes every level for itself. Where few flights show a level, its mean and loadings are those of other
flights than one level below, and samples of them change speed faster than any flight does. The prior of a
curve f over the levels is that of a smoothing spline, $p(f) \propto \exp(-\lambda \sum_l (\Delta^2 f_l)^2 / 2)$, and
each level counts as many times as flights show it (Whittaker 1923; Green and Silverman 1994, chapter 2). The weight
$\lambda$ is learnt, and the length of the noise with it, from flights that a model was not fitted to: flights are dealt
into parts, and each judges what was fitted to the others. The weight is the one under which the judges are most
probable; then the length is the one that misses their tops least where these are hidden.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import torch
from torch import Tensor

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
        weight: Of the prior, in flights, above 0.
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
FEWEST_FLIGHTS = 6
"""Flights below which nothing is learnt: the model is taken as it is."""

Fit = Callable[[Tensor, Tensor, int], PPCA]
"""Fits profiles, with their mask, with q latent dimensions."""
HIDDEN_SHARE = 0.3
"""Share of its levels that is hidden from a flight, in the mean."""
MIN_SHARE_SHOWN = 0.1
"""Share of the flights that still show each level: the grid of a type ends where a quarter of them do."""
LENGTHS = (1.0, 3.0, 10.0, 30.0, 100.0, 300.0)
"""Correlation lengths of the noise in levels, among which one is chosen."""


class Centred(NamedTuple):
    """Profiles minus their mean, over their spread, and what fits them.

    Attributes:
        mean: (L,).
        scale: () spread.
        largest: () value, not finite where one is not.
        values: (n, L) centred and divided, zero where missing; of complete profiles some of the flights alone.
        mask: (n, L) observed.
        model: Fits all of them with q latent dimensions.
        fit: Fits some of them.
    """

    mean: Tensor
    scale: Tensor
    largest: Tensor
    values: Tensor
    mask: Tensor
    model: Callable[[int], PPCA]
    fit: Fit


def roughness_and_length(flights: Centred, q: int) -> tuple[float, float]:
    """Weight of the prior against roughness, in flights, and length of the noise, in levels.

    Args:
        flights: The training flights.
        q: Latent dimensions.

    Example:
        >>> from descentflow.representation.fpca.gappy import gappy_profiles
        >>> shape = torch.linspace(-1, 1, 60).double()
        >>> curves = torch.randn(40, 1).double() * shape + 0.5 * torch.randn(40, 60).double()
        >>> seen = torch.arange(60) < torch.randint(30, 90, (40, 1))
        >>> weight, length = roughness_and_length(gappy_profiles(torch.where(seen, curves, 0.0), seen), 1)
        >>> weight > 100, length in LENGTHS  # the shape is a line
        (True, True)
    """
    if len(flights.mask) < FEWEST_FLIGHTS:
        return 0.0, 1.0
    centred, mask, mean = flights.values[:TUNING_FLIGHTS], flights.mask[:TUNING_FLIGHTS], flights.mean / flights.scale
    fold = torch.arange(len(mask), device=mask.device) % FOLDS
    parts = []
    for one in range(FOLDS):
        rest, judge = fold != one, fold == one
        model = flights.fit(centred[rest], mask[rest], min(q, int(rest.sum()) - 1))
        # What a judge shows where none of the others does, their model cannot know.
        parts.append((model, rest, centred[judge], mask[judge] & mask[rest].any(0)))

    def candidates(weight: float) -> list[tuple[PPCA, Tensor, Tensor]]:
        smoothed_parts = []
        for model, rest, judged, seen in parts:
            smooth = smoothed(model, weight, centred[rest], mask[rest], mean) if weight else model
            smoothed_parts.append((smooth, judged - smooth.shift, seen))
        return smoothed_parts

    def fit_of(weight: float) -> float:
        total = 0.0
        for model, values, seen in candidates(weight):
            shown = torch.where(seen, values, 0.0)
            total += float(ppca.log_likelihood(shown, seen, model.loadings, model.noise_variance))
        return total

    # Where nothing is missing, all levels are of the same flights, and the closed form stands as it is.
    weight = 0.0 if bool(mask.all()) else max(WEIGHTS, key=fit_of)
    generator = torch.Generator().manual_seed(0)
    errors = torch.zeros(len(LENGTHS), dtype=torch.float64)
    for model, values, seen in candidates(weight):
        hidden = hide_tops(seen, HIDDEN_SHARE, generator)
        errors += torch.tensor(missed(values, seen & ~hidden, hidden, model.loadings, model.noise_variance))
    return weight, LENGTHS[int(errors.argmin())]


def hide_tops(mask: Tensor, share: float, generator: torch.Generator) -> Tensor:
    """Levels (n, L) to hide of those observed: from each flight's highest level down, up to twice a share, at random.

    Args:
        mask: (n, L) observed.
        share: How many, in the mean.
        generator: Of the draws.

    Example:
        >>> hide_tops(torch.ones(5, 200, dtype=torch.bool), 0.3, torch.Generator().manual_seed(0)).shape
        torch.Size([5, 200])
    """
    return spared(mask, highest(mask, 2 * share * torch.rand(len(mask), 1, generator=generator)))


def highest(mask: Tensor, part: Tensor) -> Tensor:
    """The highest of the levels that each flight shows, a part (n, 1) of them."""
    from_top = mask.flip(1).cumsum(1).flip(1)
    return mask & (from_top <= part * mask.sum(1, keepdim=True))


def spared(mask: Tensor, hidden: Tensor) -> Tensor:
    """Levels that may be hidden: no flight loses all, and a tenth of the flights or more still show each."""
    hidden = hidden & (mask & ~hidden).any(1, keepdim=True)
    return hidden & ((mask & ~hidden).sum(0) >= MIN_SHARE_SHOWN * len(mask))


def missed(centred: Tensor, seen: Tensor, hidden: Tensor, loadings: Tensor, noise: Tensor) -> list[float]:
    """Sum of the squared errors on hidden levels, of their expectation given the others, for each length.

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

    Example:
        >>> centred = torch.tensor([[2.0, 2.0]]).double()
        >>> visible = torch.tensor([[True, False]])
        >>> error = missed(centred, visible, ~visible, torch.ones(2, 1).double(), torch.tensor(1.0).double())
        >>> round(error[0], 9)  # of the length 1: (2 - 2 / (1 + 1))^2
        1.0
    """
    groups = group_masks(seen)
    projected, grams = torch.where(seen, centred, 0.0) @ loadings, level_products(groups, loadings)
    asked = torch.where(hidden, centred, 0.0)
    errors = []
    for length in LENGTHS:
        latent, _, _ = posterior_given(projected, groups, grams, noise * length)
        expected = latent @ loadings.T
        errors.append(float(torch.linalg.vector_norm(expected.mul_(hidden) - asked)) ** 2)
    return errors
