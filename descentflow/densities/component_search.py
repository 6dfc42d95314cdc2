"""Number of mixture components by an information criterion, within the paper's cap and beyond it."""

from collections.abc import Callable
from dataclasses import dataclass
from math import log
from typing import Literal, TypeVar

from torch import Tensor

from descentflow.densities.em import STARTING_FLIGHTS, fit_steps, steps_of
from descentflow.densities.grown_mixtures import grow_mixture
from descentflow.densities.mixture_parameters import Mixture, n_parameters
from descentflow.representation.evidence import Evidence, as_evidence

FLIGHTS_PER_PARAMETER = 15
"""The paper's cap: 15 n_p <= n_train (appendix C)."""
MIN_FLIGHTS_PER_PARAMETER = 2
"""End of the search beyond that cap. At 4, it ended at two components of 430 B738 flights of a Mach number and a CAS,
where BIC prefers four: their CAS was 1.8 noise floors away, and is 1.1 so.
"""
MOST_OF_MANY = 32
"""Largest number of components of a grown mixture, if the cap allows no more. Held-out B738 are 0.04 nats a flight
more probable by 32 than by 24 components; of the A319 32 are level with 24, and 48 lose 0.03.
"""
EVERY_NUMBER_TO = 16
"""Up to here every number of mixture components is tried."""
FURTHER = 1.1
"""By what larger numbers grow."""
PATIENCE = 4
"""Beyond it, numbers in a row that may be no better before the search ends."""
OBSERVED_TOLERANCE = 5e-5
"""Gain (nats per flight) at which EM by what was observed ends in the search: the price of a component is sixty times
that and more (0.003 nats for 29,527 flights by AIC), and the training that follows goes on from there."""

Criterion = Literal["aic", "bic"]
"""Akaike's, which asks what is most probable of flights not seen yet; or the Bayesian, whose price of a parameter grows
with the flights, and which the paper takes (appendix C)."""

M = TypeVar("M")


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
    n_train: int, dimension: int, n_context: int = 0, flights_per_parameter: float = FLIGHTS_PER_PARAMETER
) -> int:
    """Largest number of mixture components with 15 training flights per parameter, at least one (paper, appendix C).

    Example:
        >>> max_components(32808, 15)
        16
    """
    k = 1
    while flights_per_parameter * n_parameters(k + 1, dimension, n_context) <= n_train:
        k += 1
    return k


def select_mixture(
    flights: Tensor | Evidence,
    *,
    context: Tensor | None = None,
    seed: int,
    n_restarts: int = 8,
    tolerance: float = 1e-6,
    extend: bool = True,
    criterion: Criterion = "bic",
    prior_flights: float = 0.0,
    only: int | None = None,
    progress: Callable[[int], None] | None = None,
) -> Selection:
    """Choose the number of mixture components by an information criterion (paper, appendix C).

    Args:
        flights: Standardised weights (n, d) of the training flights, or their evidence: then the criterion takes the
            likelihood of what was observed.
        context: (n, c) encoded context, if there is one.
        seed: Of the starts.
        n_restarts: Starts for each number of components.
        tolerance: As in :func:`~descentflow.densities.em.fit_mixture`.
        extend: Go on beyond 15 flights per parameter where the criterion decides for the cap, see :func:`best_number`.
        criterion: ``bic``, as in the paper, or ``aic``.
        prior_flights: Flights by which covariances are shrunk, see :mod:`descentflow.densities.em_steps`.
        only: Number of components, taken whatever its criterion is.
        progress: Progress callback: called after each number of components with how many will be tried.

    Returns:
        The best mixture; ``cap_binds`` is true if the largest number allowed won, so that more might win yet.

    Example:
        >>> weights = torch.randn(200, 4)
        >>> weights[:100] += 8
        >>> select_mixture(weights, seed=0, n_restarts=2).mixture.n_components
        2
    """
    steps, evidence = steps_of(flights, context, prior_flights), as_evidence(flights)
    stop = tolerance if evidence.known else max(tolerance, OBSERVED_TOLERANCE)
    n, dimension = evidence.points.shape
    n_context = 0 if context is None else context.shape[1]
    most, furthest = (
        max_components(n, dimension, n_context, share) for share in (FLIGHTS_PER_PARAMETER, MIN_FLIGHTS_PER_PARAMETER)
    )

    def fit(k: int) -> tuple[Mixture, float]:
        return fit_steps(steps, k, seed=seed, n_restarts=n_restarts, tolerance=stop)

    def count(k: int) -> int:
        return n_parameters(k, dimension, n_context)

    price = 0.0 if only is not None else log(n) if criterion == "bic" else 2.0
    if not evidence.known and n > STARTING_FLIGHTS:
        furthest = only or (min(furthest, max(most, MOST_OF_MANY)) if extend else most)

        def value(k: int, likelihood: float) -> float:
            return price * count(k) - 2 * n * likelihood

        found, values = grow_mixture(steps, furthest, value, seed=seed, n_restarts=n_restarts, progress=progress)
    elif only is not None:
        found, likelihood = fit(only)
        values = {only: -2 * n * likelihood}
    else:
        found, values = best_number(fit, count, n, price, most, furthest if extend else most, progress)
    return Selection(found, values, cap_binds=min(values, key=values.__getitem__) == max(values))


def best_number(
    fit: Callable[[int], tuple[M, float]],
    n_parameters: Callable[[int], int],
    n: int,
    price: float,
    most: int,
    furthest: int,
    progress: Callable[[int], None] | None = None,
) -> tuple[M, dict[int, float]]:
    """Try numbers of mixture components and keep the one whose criterion is smallest.

    :func:`numbers_tried` up to ``most`` are tried; beyond 16 components, where each costs much, until four in a row
    were no better. While the largest or the last but one is the best, larger ones are tried, up
    to ``furthest``: a criterion has its own price for parameters, so the cap should not be what decides.

    Args:
        fit: Number of components -> mixture and mean log-likelihood (nats per flight).
        n_parameters: Number of components -> free parameters.
        n: Number of flights.
        price: Of one parameter in the criterion, beside minus twice the log-likelihood: 2 (AIC) or log n (BIC).
        most: The paper's cap.
        furthest: Where even a better criterion is not followed.
        progress: Progress callback: called after each with how many will be tried at least.

    Returns:
        The best, and the criterion of every number tried; the best is the largest only if ``furthest`` decided.

    Example:
        >>> fit = lambda k: (f"{k} components", -abs(k - 2.0))
        >>> best, aic = best_number(fit, lambda k: k, n=100, price=2.0, most=4, furthest=4)
        >>> best, list(aic)
        ('2 components', [1, 2, 3, 4])
    """
    tried: dict[int, M] = {}
    values: dict[int, float] = {}
    sizes = numbers_tried(most, max(most, furthest))
    planned = sum(k <= most for k in sizes)
    for i, k in enumerate(sizes):
        since_best = i - sizes.index(min(values, key=values.__getitem__)) if values else 0
        if since_best > (2 if k > most else PATIENCE if k > EVERY_NUMBER_TO else i):
            break
        tried[k], likelihood = fit(k)
        values[k] = n_parameters(k) * price - 2 * n * likelihood
        if progress is not None:
            progress(max(planned, i + 1))
    return tried[min(values, key=values.__getitem__)], values


def numbers_tried(most: int, furthest: int) -> list[int]:
    """Numbers of mixture components in the order in which they are tried: all up to 16, then a tenth more each time.

    Example:
        >>> numbers_tried(20, 26)
        [1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 18, 20, 22, 24, 26]
    """
    found = [1]
    while found[-1] < furthest:
        k = found[-1]
        further = k + 1 if k < EVERY_NUMBER_TO else round(FURTHER * k)
        found.append(min(further, most if k < most else furthest))
    return found
