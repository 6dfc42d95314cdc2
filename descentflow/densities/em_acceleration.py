"""Expectation maximisation in fewer steps: squared extrapolation, which never loses likelihood.

EM ends slowly where components overlap and where much is not observed. Two steps tell how they shrink, and a point
further along the same way is taken from there (SQUAREM: Varadhan and Roland 2008,
doi:10.1111/j.1467-9469.2007.00585.x); should it be no better than the steps themselves, these are kept.
"""

import torch
from torch import Tensor

from descentflow.densities.em_steps import Steps
from descentflow.densities.mixture_parameters import Mixture

LONGEST, GROWTH = 16.0, 2.0
"""Bound on the length of an extrapolation, in steps, and by what shorter bounds grow or shrink with success."""


def converge_fast(steps: Steps, mixture: Mixture, *, iterations: int, tolerance: float) -> tuple[Mixture, float]:
    """Steps and extrapolations until one EM step changes the mean log-likelihood by less than ``tolerance`` (nats).

    Where covariances are shrunk, a point further along may have a greater likelihood than where steps lead to: those
    that follow it lose some, and EM goes on from where they are.

    Args:
        steps: The flights.
        mixture: Where to begin.
        iterations: EM steps at most.
        tolerance: Change of the mean log-likelihood by one EM step at which it ends.

    Returns:
        The mixture, and its mean log-likelihood.

    Example:
        >>> from descentflow.densities.em import converge, start, steps_of
        >>> steps = steps_of(torch.randn(500, 2))
        >>> first = start(steps, n_components=3, seed=0)
        >>> fast = converge_fast(steps, first, iterations=100, tolerance=1e-6)[1]
        >>> fast > converge(steps, first, iterations=3, tolerance=1e-6)[1]
        True
    """
    kept, reached, bound, done = mixture, -float("inf"), GROWTH, 0
    while done < iterations:
        one, before = steps.improve(mixture)
        done += 1
        if not before >= reached:
            bound = max(bound / GROWTH, 1.0)
            mixture, reached = kept, -float("inf")
            continue
        two, after = steps.improve(one)
        done += 1
        if abs(after - before) < tolerance:
            return one, after
        if after < before:
            mixture, kept, reached = two, two, -float("inf")
            continue
        length = _length(mixture, one, two)
        if length > bound:
            length, bound = bound, min(bound * GROWTH, LONGEST)
        kept, reached = two, after
        mixture = _extrapolated(mixture, one, two, length)
    return kept, float(steps.expectation(kept)[1])


def _length(zero: Mixture, one: Mixture, two: Mixture) -> float:
    """Total length of steps that shrink by a constant factor, in lengths of the first step, at least one."""
    before, between, after = (torch.cat([part.flatten() for part in _free(m)]) for m in (zero, one, two))
    first = between - before
    return max(float(first.norm() / (after - between - first).norm().clamp(min=1e-300)), 1.0)


def _extrapolated(zero: Mixture, one: Mixture, two: Mixture, length: float) -> Mixture:
    """The mixture that lies ``length`` times as far on; the second of the steps if it is one."""
    parts = []
    for before, between, after in zip(*map(_free, (zero, one, two)), strict=True):
        first, second = between - before, after - between
        parts.append(before + 2 * length * first + length**2 * (second - first))
    log_probs, locs, below, log_diagonal, *line = parts
    return Mixture(log_probs.softmax(0), locs, below.tril(-1) + log_diagonal.exp().diag_embed(), *line)


def _free(mixture: Mixture) -> list[Tensor]:
    """Parameters of which any real numbers make a mixture."""
    diagonal = mixture.scale_trils.diagonal(dim1=-2, dim2=-1)
    parts = [mixture.probs.log(), mixture.locs, mixture.scale_trils.tril(-1), diagonal.log()]
    return parts + [part for part in (mixture.slopes, mixture.gate) if part is not None]
