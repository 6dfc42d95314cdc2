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
class Posterior:
    """Evidence (nats), and mean (k,) and covariance (k, k) of the sizes.

    Example:
        >>> Posterior(-1.0, np.zeros(1), np.eye(1)).log_evidence
        -1.0
    """

    log_evidence: float
    mean: Array
    covariance: Array


def posterior(x: Array, noise: Array, jacobian: Array, prior_mean: Array, prior_sd: Array) -> Posterior:
    """Evidence and posterior of a linear Gaussian model.

    Args:
        x: (p,) what is seen.
        noise: (p, p) its covariance at given sizes.
        jacobian: (p, k) of what is seen by the sizes; k may be zero.
        prior_mean: (k,).
        prior_sd: (k,).

    Example:
        >>> found = posterior(np.array([2.0]), np.eye(1), np.eye(1), np.zeros(1), np.ones(1))
        >>> found.mean, found.covariance  # half way between the prior and what is seen, which are known as well
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
    return Posterior(log_evidence, prior_mean + prior_sd * step, covariance)
