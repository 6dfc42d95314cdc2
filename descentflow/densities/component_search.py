"""Number of mixture components by an information criterion, within the paper's cap and beyond it."""

from collections.abc import Callable
from dataclasses import dataclass
from math import isinf, log
from typing import Literal

from torch import Tensor

from descentflow.densities.em import fit_mixture
from descentflow.densities.em_steps import Steps
from descentflow.densities.mixture_parameters import Mixture, n_parameters

FLIGHTS_PER_PARAMETER = 15
"""The paper's cap: 15 n_p <= n_train (appendix C)."""
MIN_FLIGHTS_PER_PARAMETER = 2
"""End of the search beyond that cap; one, where components share their covariance."""
MOST_COMPONENTS = 32
"""End of the search if the paper's cap allows no more. Held-out B738 are 0.04 nats a flight more probable by 32 than by
24 components; of the A319 32 are level with 24, and 48 lose 0.03.
"""
PATIENT_NUMBERS = 2
"""Numbers in a row that may be no better before the search ends."""

Criterion = Literal["aic", "bic"]
"""Akaike's, which asks what is most probable of flights not seen yet; or the Bayesian, whose price of a parameter grows
with the flights, and which the paper takes (appendix C)."""


@dataclass(frozen=True)
class Selection:
    """The mixture chosen, the criterion of every number of components tried, and whether the cap decided.

    Example:
        >>> chosen = select_mixture(torch.randn(60, 4), seed=0, n_restarts=1)
        >>> chosen.values[chosen.mixture.n_components] == min(chosen.values.values())
        True
    """

    mixture: Mixture
    values: dict[int, float]
    cap_binds: bool


def max_components(
    n_train: int,
    dimension: int,
    n_context: int = 0,
    flights_per_parameter: float = FLIGHTS_PER_PARAMETER,
    *,
    shared: bool = False,
) -> int:
    """Largest number of mixture components with 15 training flights per parameter, at least one (paper, appendix C).

    Example:
        >>> max_components(32808, 15)
        16
    """
    k = 1
    while flights_per_parameter * n_parameters(k + 1, dimension, n_context, shared=shared) <= n_train:
        k += 1
    return k


def numbers_tried(most: int) -> list[int]:
    """Numbers of mixture components in the order in which they are tried, two to each doubling.

    Example:
        >>> numbers_tried(14)
        [1, 2, 3, 4, 6, 8, 12, 14]
    """
    powers = [2**i for i in range(most.bit_length())]
    between = {k for power in powers for k in (power, 3 * power // 2) if k < most}
    return [*sorted(between), most]


def select_mixture(
    flights: Tensor | Steps,
    *,
    seed: int,
    n_restarts: int = 8,
    tolerance: float = 1e-6,
    extend: bool = True,
    criterion: Criterion = "bic",
    progress: Callable[[int], None] | None = None,
) -> Selection:
    """Choose the number of mixture components by an information criterion (paper, appendix C).

    Args:
        flights: Standardised weights (n, d) of the training flights, or their steps; with infinitely many prior flights
            the components share one covariance.
        seed: Of the starts.
        n_restarts: Starts for each number of components.
        tolerance: As in :func:`~descentflow.densities.em.fit_mixture`.
        extend: Go on beyond 15 flights per parameter, for a criterion has its own price for parameters.
        criterion: ``bic``, as in the paper, or ``aic``.
        progress: Progress callback: called after each number of components with how many will be tried at most.

    Returns:
        The best mixture; ``cap_binds`` is true if the largest number allowed won, so that more might win yet.

    Example:
        >>> weights = torch.randn(200, 4)
        >>> weights[:100] += 8
        >>> select_mixture(weights, seed=0, n_restarts=2).mixture.n_components
        2
    """
    steps = flights if isinstance(flights, Steps) else Steps(flights)
    (n, dimension), n_context, shared = steps.weights.shape, steps.context.shape[1], isinf(steps.prior_flights)
    most = max_components(n, dimension, n_context, shared=shared)
    if extend:
        furthest = max_components(n, dimension, n_context, 1 if shared else MIN_FLIGHTS_PER_PARAMETER, shared=shared)
        most = min(furthest, max(most, MOST_COMPONENTS))
    price = log(n) if criterion == "bic" else 2.0
    numbers = numbers_tried(most)
    tried: dict[int, Mixture] = {}
    values: dict[int, float] = {}
    for k in numbers:
        tried[k], likelihood = fit_mixture(steps, k, seed=seed, n_restarts=n_restarts, tolerance=tolerance)
        values[k] = price * n_parameters(k, dimension, n_context, shared=shared) - 2 * n * likelihood
        if progress is not None:
            progress(len(numbers))
        if min(values.values()) < min(list(values.values())[-PATIENT_NUMBERS:]):
            break
    best = min(values, key=values.__getitem__)
    return Selection(tried[best], values, cap_binds=best == numbers[-1])
