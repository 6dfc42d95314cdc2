r"""Linear mixed model of flights of several types, in closed form.

Flight f of the aircraft a of the type t shows in its bands

.. math:: y_f = X_f \theta_t + b_t + u_a + v_f + w_f m_f + s_f + e_f

with the coefficients :math:`\theta_t`, what the equations miss in every flight of a type alike :math:`b_t` (smooth in
altitude), a random effect of the aircraft :math:`u_a` and one of the flight (crew) :math:`v_f`, the mass :math:`w_f`
along its own derivative :math:`m_f`, an error :math:`s_f` that is smooth in altitude, and white noise. All are normal.
The size of :math:`b` is given. The types share a prior, with weights c that are learnt (partial pooling),

.. math:: \mathrm{cov}(\theta_t, \theta_u) = \lambda^2 \Big(\sum_g c_g [t, u \text{ in one group } g]\Big) P .

Each flight is whitened once; its aircraft takes a rank-one update, and coefficients and misfit of a type one of their
number, so that the marginal likelihood costs no more than the flights' own Cholesky factors. Standard deviations and
weights are the likeliest under weak priors (empirical Bayes; Searle, Casella and McCulloch, Variance Components, 1992,
chapter 6).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.linalg import block_diag
from scipy.optimize import minimize

from descentflow.core.linear_gaussian import Array
from descentflow.diagnosis.sides.assumptions import ASSUMED

MASS_SPREAD = ASSUMED.coefficient_spread[0]
COEFFICIENT_SPREAD = (ASSUMED.coefficient_spread[1], ASSUMED.coefficient_spread[1], ASSUMED.coefficient_spread[3])
"""Prior standard deviations of ln CD0, ln CD2 and idle thrust over the file's: a wrong file may be as wrong in CD2 as
open sources differ in CD0."""
MASS_GAUGE = (-1.0, 1.0, -1.0)
"""A mean mass that is more than the reference mass by so much shows as less CD0, more CD2 and less idle thrust."""
PRIOR = np.diag(np.square(COEFFICIENT_SPREAD)) + MASS_SPREAD**2 * np.outer(MASS_GAUGE, MASS_GAUGE)
"""Covariance (3, 3) of what a file is off by, at the reference mass."""
Z_90 = 1.645
"""Standard deviations of a 90 % interval."""
UNSEEN_VARIANCE = 1e6
"""Variance of a band that a flight does not show: it tells nothing."""
LEVELS_M = np.arange(0.0, 15_001.0, 600.0)
"""Levels of flight."""
LEAST_SHARE = 1e-3
"""Of the largest variance, below which a part of the smooth misfits is left out."""
LOG_SIZE_SD = 1.0
"""Prior standard deviation of the logarithm of each learnt size."""


@dataclass(frozen=True)
class Sizes:
    """Standard deviations of ln rate, and of the types' prior.

    Example:
        >>> Sizes().flight
        0.08
    """

    aircraft: float = 0.04
    flight: float = 0.08
    mass: float = 0.08
    smooth: float = 0.06
    white: float = 0.03
    equation: float = 0.02
    """Of what the equations miss in every flight of a type alike. It is not learnt: a type shows one such misfit, which
    would take all that a wrong file is off by."""
    scale: float = 1.0
    """Lambda, of the types' prior."""
    weights: tuple[float, ...] = ()
    """Of the groups, what is left to one being the type's own."""


def _alike(first_m: Array, second_m: Array) -> Array:
    correlation: Array = np.exp(-0.5 * ((first_m[:, None] - second_m) / ASSUMED.length_m) ** 2)
    return correlation


@dataclass(frozen=True)
class Flights:
    """n flights in K bands, zero where ``seen`` is not: ``y`` (n, K), ``x`` (n, K, 3), ``by_mass`` (n, K).

    ``kind`` (n,) numbers the types and ``tail`` (n,) the aircraft; ``groups`` (G, T) numbers in each row
    the group of each type.

    Example:
        >>> one = np.ones((2, 3))
        >>> x = np.zeros((2, 3, 3))
        >>> bands = np.array([5e3, 6e3, 7e3])
        >>> two = Flights(one, x, one, one > 0, np.zeros(2, int), np.arange(2), bands, np.zeros((0, 1), int))
        >>> two.types
        1
    """

    y: Array
    x: Array
    by_mass: Array
    seen: np.ndarray
    kind: np.ndarray
    tail: np.ndarray
    altitude_m: Array
    groups: np.ndarray

    @property
    def types(self) -> int:
        """Number of types."""
        return int(self.groups.shape[1])

    @cached_property
    def kernel(self) -> Array:
        """Correlation (K, K) of the smooth errors over altitude."""
        return _alike(self.altitude_m, self.altitude_m)

    @cached_property
    def shapes(self) -> Array:
        """Columns (K, r) of smooth misfits, each of one standard deviation of an independent part.

        The parts are those of all levels of flight, so that they mean the same for flights of other bands.
        """
        values, vectors = np.linalg.eigh(_alike(LEVELS_M, LEVELS_M))
        kept = values > LEAST_SHARE * values.max()
        columns: Array = _alike(self.altitude_m, LEVELS_M) @ vectors[:, kept] / np.sqrt(values[kept])
        return columns

    def rows(self, index: np.ndarray) -> "Flights":
        """Some of the flights."""
        names = ("y", "x", "by_mass", "seen", "kind", "tail")
        return replace(self, **{name: getattr(self, name)[index] for name in names})


@dataclass(frozen=True)
class MixedModelPosterior:
    """Coefficients and misfits of all types, the sizes and the log marginal likelihood.

    Shapes: ``whole`` (T, D) means and ``covariance`` (T D, T D), of three coefficients and the misfit's parts a type.

    Example:
        >>> MixedModelPosterior(np.zeros((1, 5)), np.eye(5), Sizes(), 0.0).of(0)[0].tolist()
        [0.0, 0.0, 0.0]
    """

    whole: Array
    covariance: Array
    sizes: Sizes
    log_likelihood: float

    @property
    def mean(self) -> Array:
        """Coefficients (T, 3)."""
        return self.whole[:, :3]

    def of(self, kind: int) -> tuple[Array, Array]:
        """Mean (3,) and covariance (3, 3) of one type."""
        one = self.only(kind)
        return one.whole[0, :3], one.covariance[:3, :3]

    def only(self, kind: int) -> "MixedModelPosterior":
        """Coefficients and misfits of one type."""
        at = slice(self.whole.shape[1] * kind, self.whole.shape[1] * (kind + 1))
        return replace(self, whole=self.whole[kind : kind + 1], covariance=self.covariance[at, at])


def before_flights(flights: Flights, sizes: Sizes) -> MixedModelPosterior:
    """Prior of coefficients and misfits.

    Example:
        >>> one, x = np.ones((1, 2)), np.zeros((1, 2, 3))
        >>> bands, kind = np.array([5e3, 9e3]), np.zeros(1, int)
        >>> flights = Flights(one, x, one, one > 0, kind, kind, bands, np.zeros((0, 1), int))
        >>> before_flights(flights, Sizes()).covariance.shape  # three coefficients, twelve parts of the misfit
        (15, 15)
    """
    types, parts = flights.types, 3 + flights.shapes.shape[1]
    covariance = np.zeros((types, parts, types, parts))
    covariance[:, :3, :, :3] = type_covariance(flights.groups, sizes).reshape(types, 3, types, 3)
    for kind in range(types):
        covariance[kind, 3:, kind, 3:] = np.eye(parts - 3)
    return MixedModelPosterior(np.zeros((types, parts)), covariance.reshape(types * parts, types * parts), sizes, 0.0)


def type_covariance(groups: np.ndarray, sizes: Sizes) -> Array:
    """Prior covariance (3 T, 3 T) of the coefficients of the types.

    Example:
        >>> both = type_covariance(np.array([[0, 0]]), Sizes(weights=(0.75,)))
        >>> round(float(both[0, 3] / both[0, 0]), 2)  # of ln CD0 of two sisters
        0.75
    """
    weights = sizes.weights[: len(groups)]
    alike = [weight * (group[:, None] == group) for weight, group in zip(weights, groups, strict=True)]
    shared = sum(alike, (1.0 - sum(weights)) * np.eye(groups.shape[1]))
    covariance: Array = sizes.scale**2 * np.kron(shared, PRIOR)
    return covariance


def whitened(flights: Flights, sizes: Sizes) -> tuple[Array, Array]:
    """Gram matrices (n, D + 2, D + 2) of [y, x, misfit, 1] in each flight's noise, and its log determinants (n,)."""
    n, bands = flights.y.shape
    one = flights.seen.astype(float)
    noise = np.broadcast_to(sizes.smooth**2 * flights.kernel + sizes.white**2 * np.eye(bands), (n, bands, bands))
    noise = noise + sizes.flight**2 + sizes.mass**2 * flights.by_mass[:, :, None] * flights.by_mass[:, None]
    noise = noise * one[:, :, None] * one[:, None] + UNSEEN_VARIANCE * np.eye(bands) * (1 - one)[:, None]
    factor = np.linalg.cholesky(noise)
    misfit = np.broadcast_to(sizes.equation * flights.shapes, (n, *flights.shapes.shape))
    columns = np.concatenate([flights.y[:, :, None], flights.x, misfit, np.ones((n, bands, 1))], 2) * one[:, :, None]
    white = np.linalg.solve(factor, columns)
    log = 2.0 * np.log(np.diagonal(factor, axis1=1, axis2=2)) * one
    return white.transpose(0, 2, 1) @ white, log.sum(1)


def posterior(flights: Flights, sizes: Sizes) -> MixedModelPosterior:
    """Coefficients of all types at given sizes, and the marginal likelihood (without the constant).

    Example:
        >>> x = np.ones((50, 1, 3)) * [1.0, 0.0, 0.0]
        >>> one = np.ones((50, 1))
        >>> flights = Flights(0.2 * one, x, 0 * one, one > 0, np.zeros(50, int), np.arange(50), one[0], np.ones((0, 1)))
        >>> posterior(flights, Sizes()).mean.round(2)  # what the flights do not tell keeps its prior, up to the gauge
        array([[ 0.2 , -0.04,  0.04]])
    """
    gram, log = whitened(flights, sizes)
    order = np.argsort(flights.tail, kind="stable")
    first = np.unique(flights.tail[order], return_index=True)[1]
    total = np.add.reduceat(gram[order], first)
    kind = flights.kind[order][first]
    # One aircraft's flights share a level: a rank-one update.
    shared = 1.0 + sizes.aircraft**2 * total[:, -1, -1]
    total = total - (sizes.aircraft**2 / shared)[:, None, None] * total[:, :, -1:] * total[:, -1:, :]
    prior = before_flights(flights, sizes).covariance
    information, towards = np.zeros_like(prior), np.zeros(len(prior))
    parts = gram.shape[1] - 2
    for t in range(flights.types):
        mine, at = total[kind == t].sum(0), slice(parts * t, parts * (t + 1))
        information[at, at], towards[at] = mine[1:-1, 1:-1], mine[1:-1, 0]
    # (prior^-1 + information)^-1 without the inverse of the prior, which pooling makes singular.
    shrink = np.eye(len(prior)) + prior @ information
    covariance = np.linalg.solve(shrink, prior)
    mean = covariance @ towards
    square = total[:, 0, 0].sum() - towards @ mean
    determinant = log.sum() + np.log(shared).sum() + np.linalg.slogdet(shrink)[1]
    covariance = (covariance + covariance.T) / 2
    return MixedModelPosterior(mean.reshape(-1, parts), covariance, sizes, float(-0.5 * (square + determinant)))


def fit(flights: Flights, first: Sizes = Sizes()) -> MixedModelPosterior:
    """Coefficients at the likeliest sizes under weak priors about the first ones.

    Example:
        >>> rng = np.random.default_rng(0)
        >>> x, one = np.broadcast_to(-np.array([0.7, 0.3, -0.1]), (300, 8, 3)), np.ones((300, 8))
        >>> y = x[:, :, 0] * 0.2 + 0.1 * rng.normal(size=(300, 1)) + 0.02 * rng.normal(size=(300, 8))
        >>> kinds, bands = np.zeros(300, int), np.arange(8) * 600.0
        >>> posterior = fit(Flights(y, x, 0 * one, one > 0, kinds, np.arange(300), bands, np.zeros((0, 1), int)))
        >>> bool(abs(x[0, 0] @ posterior.mean[0] + 0.14) < 0.02), round(posterior.sizes.white, 2)
        (True, 0.02)
    """
    groups = len(flights.groups)
    # How wrong files are shows where there are several.
    names = ("aircraft", "flight", "mass", "smooth", "white", *(("scale",) if groups else ()))
    usual = np.log([getattr(first, name) for name in names])

    def sizes_at(point: Array) -> Sizes:
        # Weights by a softmax with a type's own part.
        odds = np.exp(np.append(point[len(names) :], 0.0))
        weights = tuple((odds / odds.sum())[:-1].tolist()) if groups else ()
        return Sizes(**dict(zip(names, np.exp(point[: len(names)]).tolist(), strict=True)), weights=weights)

    def cost(point: Array) -> float:
        strange = np.concatenate([point[: len(names)] - usual, point[len(names) :]]) / LOG_SIZE_SD
        return 0.5 * float(strange @ strange) - posterior(flights, sizes_at(point)).log_likelihood

    start = np.concatenate([usual, np.zeros(groups)])
    likeliest = minimize(cost, start, method="L-BFGS-B", options={"maxiter": 60}).x
    return posterior(flights, sizes_at(likeliest))


def predictive_log_density(flights: Flights, fitted: MixedModelPosterior) -> Array:
    """Log density (A,) of the flights of each new aircraft under a posterior, without the constant.

    Example:
        >>> one, x = np.ones((1, 1)), np.zeros((1, 1, 3))
        >>> new = Flights(0.3 * one, x, 0 * one, one > 0, np.zeros(1, int), np.arange(1), one[0], np.zeros((0, 1), int))
        >>> bool(predictive_log_density(new, before_flights(new, Sizes()))[0] < 0)
        True
    """
    densities = []
    gram, log = whitened(flights, fitted.sizes)
    for tail in np.unique(flights.tail):
        mine = flights.tail == tail
        total, one = gram[mine].sum(0), fitted.only(int(flights.kind[mine][0]))
        # The aircraft's level and the coefficients are one random effect of a new aircraft's flights.
        prior = block_diag(one.covariance, [[fitted.sizes.aircraft**2]])
        inner, cross = total[1:, 1:], total[1:, 0]
        shift = np.append(one.whole[0], 0.0)
        towards = cross - inner @ shift
        square = total[0, 0] - 2 * shift @ cross + shift @ inner @ shift
        shared = np.eye(len(prior)) + prior @ inner
        square -= towards @ np.linalg.solve(shared, prior @ towards)
        densities.append(-0.5 * (square + log[mine].sum() + np.linalg.slogdet(shared)[1]))
    return np.array(densities)


def joined(parts: Sequence[Flights], groups: np.ndarray) -> Flights:
    """Flights of several parts, with aircraft of their own, on the bands of all of them."""
    altitude = np.unique(np.concatenate([part.altitude_m for part in parts]).round(3))

    def wide(part: Flights, name: str) -> Array:
        values: Array = getattr(part, name)
        padded = np.zeros((len(values), len(altitude), *values.shape[2:]), dtype=values.dtype)
        padded[:, np.searchsorted(altitude, part.altitude_m.round(3))] = values
        return padded

    y, x, by_mass, seen = (
        np.concatenate([wide(part, name) for part in parts]) for name in ("y", "x", "by_mass", "seen")
    )
    firsts = np.cumsum([0, *(int(part.tail.max()) + 1 for part in parts)])
    tails = [part.tail + first for part, first in zip(parts, firsts[:-1], strict=True)]
    kinds = np.concatenate([part.kind for part in parts])
    return Flights(y, x, by_mass, seen, kinds, np.concatenate(tails), altitude, groups)
