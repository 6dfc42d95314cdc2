r"""Linear Gaussian model: evidence and posterior of a few sizes in closed form.

.. math:: x = J\theta + e, \qquad e \sim N(0, W), \qquad \theta \sim N(\mu, \mathrm{diag}(\sigma^2)).

With the Cholesky factor :math:`W = LL^\top`, :math:`A = L^{-1}J\,\mathrm{diag}(\sigma)` and
:math:`r = L^{-1}(x - J\mu)`, the posterior precision of :math:`(\theta - \mu)/\sigma` is :math:`M = I + A^\top A`, and
by the matrix determinant lemma

.. math:: \ln p(x) = -\tfrac12\left(r^\top r - r^\top A M^{-1} A^\top r + \ln|W| + \ln|M| + p \ln 2\pi\right)

(Rasmussen and Williams, Gaussian Processes for Machine Learning, 2006, appendix A.3).
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve, cholesky, solve_triangular

Array = NDArray[np.float64]


@dataclass(frozen=True)
class GaussianPosterior:
    """Evidence (nats), and mean (k,) and covariance (k, k) of the sizes.

    Example:
        >>> GaussianPosterior(-1.0, np.zeros(1), np.eye(1)).log_evidence
        -1.0
    """

    log_evidence: float
    mean: Array
    covariance: Array


def posterior(x: Array, noise: Array, jacobian: Array, prior_mean: Array, prior_sd: Array) -> GaussianPosterior:
    """Evidence and posterior of a linear Gaussian model.

    Args:
        x: (p,) observed values.
        noise: (p, p) its covariance at given sizes.
        jacobian: (p, k) of the observed values by the sizes; k may be zero.
        prior_mean: (k,).
        prior_sd: (k,).

    Example:
        >>> given = posterior(np.array([2.0]), np.eye(1), np.eye(1), np.zeros(1), np.ones(1))
        >>> given.mean, given.covariance  # half way between prior and observation, which are known as well
        (array([1.]), array([[0.5]]))
    """
    factor = cholesky(noise, lower=True, check_finite=False)
    white = solve_triangular(factor, np.column_stack([x, jacobian]), lower=True, check_finite=False)
    columns = white[:, 1:] * prior_sd
    rest = white[:, 0] - white[:, 1:] @ prior_mean
    precision = np.eye(len(prior_sd)) + columns.T @ columns
    solved = cho_factor(precision, lower=True, check_finite=False)
    towards = columns.T @ rest
    step = cho_solve(solved, towards, check_finite=False)
    log_determinant = 2.0 * float(np.log(factor.diagonal()).sum() + np.log(solved[0].diagonal()).sum())
    square = float(rest @ rest - towards @ step)
    covariance = cho_solve(solved, np.eye(len(prior_sd)), check_finite=False) * np.outer(prior_sd, prior_sd)
    log_evidence = -0.5 * (square + log_determinant + len(x) * math.log(2.0 * math.pi))
    return GaussianPosterior(log_evidence, prior_mean + prior_sd * step, covariance)


class Precisions:
    """Precision matrices of a normal law in flights that miss some entries, one for each pattern of observed entries.

    Example:
        >>> precisions = Precisions(np.diag([1.0, 4.0]), np.array([[True, True], [False, True]]))
        >>> precisions.log_density(np.array([[1.0, 2.0], [0.0, 2.0]])).round(3)  # without the constant
        array([-1.693, -1.193])
    """

    def __init__(self, covariance: Array, seen: np.ndarray) -> None:
        """Invert the part of a covariance that each flight shows.

        Args:
            covariance: (m, m).
            seen: (n, m).
        """
        patterns, index = np.unique(seen, axis=0, return_inverse=True)
        index = index.ravel()
        # Entries that are missing are of unit variance and go with no other: nothing of them is left in the inverse.
        missing = ~patterns[:, None] * np.eye(seen.shape[1])
        whole = covariance * (patterns[:, :, None] & patterns[:, None]) + missing
        self.precision = (np.linalg.inv(whole) - missing)[index]
        self.half_log = -0.5 * np.linalg.slogdet(whole)[1][index]

    def times(self, values: Array) -> Array:
        """Precision times values (n, m)."""
        return (self.precision @ values[:, :, None])[:, :, 0]

    def log_density(self, values: Array) -> Array:
        """(n,) of values (n, m) that are zero where not seen, without the constant."""
        log_density: Array = self.half_log - 0.5 * (self.times(values) * values).sum(1)
        return log_density


LEAST_VARIANCE = 1e-30


def shrunk(rows: Array, toward: Array | float = 0.0) -> Array:
    """Sum (p, p) of the outer products of rows (a, p), its correlations shrunk by Ledoit and Wolf's weight.

    Ledoit and Wolf (2004), A well-conditioned estimator for large-dimensional covariance matrices, Journal of
    Multivariate Analysis 88, with the variances as they are (Schaefer and Strimmer 2005, target D).

    Args:
        rows: (a, p) whose outer products are summed.
        toward: (p, p) correlation that is taken where rows are too few to show one.

    Example:
        >>> rows = np.random.default_rng(0).normal(size=(20, 50))  # fewer rows than entries
        >>> bool(np.linalg.eigvalsh(shrunk(rows)).min() > 1.0)
        True
    """
    total = rows.T @ rows
    spread = np.sqrt(np.maximum(total.diagonal(), LEAST_VARIANCE))
    scaled = rows / spread
    correlation = scaled.T @ scaled
    variance = (scaled**2).T @ scaled**2 - correlation**2 / len(rows)
    apart = ~np.eye(len(total), dtype=bool)
    size = max(float((correlation[apart] ** 2).sum()), LEAST_VARIANCE)
    weight = float(np.clip(variance[apart].sum() / size, 0.0, 1.0))
    shrunk: Array = np.where(apart, (1.0 - weight) * correlation + weight * toward, 1.0) * np.outer(spread, spread)
    return shrunk
