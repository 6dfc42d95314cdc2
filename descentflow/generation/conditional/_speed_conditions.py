r"""Gaussians given values or bands of some linear combinations of their numbers: in closed form, row by row.

With rows A, values $y = A u$ and a Gaussian $N(m, \Sigma)$, the Cholesky factor of $A \Sigma A^T$ takes the rows one
after another: each is normal given those before. A draw u of the Gaussian becomes one that meets the rows by
$u + \Sigma A^T (A \Sigma A^T)^{-1} (y - A u)$ (Matheron's rule; Wilson et al. 2020, arXiv 2002.09309). Of a band, y is
drawn from the normal cut to it. The shares of the Gaussians are multiplied by the likelihoods of the values and of the
first band, which are exact; what later bands add depends on the draw and becomes its weight (Geweke, Hajivassiliou and
Keane; Hajivassiliou et al. 1996, doi:10.1016/0304-4076(94)01716-6).
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.special import log_ndtr, ndtr, ndtri_exp

from descentflow.generation.conditional._latent_density import Array

LEAST_SD = 1e-3
"""Standard deviation (m/s) below which a row is determined by those before: it must then have the value asked for."""
LEAST_TAIL = 1e-6
"""Probability beyond a value, or of a band, below which the model is said to know no such flight."""


class Rows(NamedTuple):
    """Rows of each of C Gaussians: ``matrix`` (C, J, D), ``centre`` (C, J) at their means, bounds ``low``, ``high``.

    Values come before bands; whether a row is a value is the same for all Gaussians.

    Example:
        >>> Rows(np.ones((1, 1, 2)), np.zeros((1, 1)), np.zeros((1, 1)), np.zeros((1, 1))).n_rows
        1
    """

    matrix: Array
    centre: Array
    low: Array
    high: Array

    @property
    def n_rows(self) -> int:
        """Number of rows J."""
        return int(self.matrix.shape[1])


@dataclass(frozen=True)
class Conditions:
    """C Gaussians with what their rows need.

    Attributes:
        rows: The rows with their bounds.
        factor: (C, J, J) lower Cholesky factors of the rows' covariances.
        gain: (C, D, J) what moves a draw to the rows' values.
        is_band: (J,) whether a row is a band.
        log_probs: (C,) log shares given the rows, normalised; bands after the first are left out.
        tails: (J,) probability at or beyond what a row asks, given those before.

    Example:
        >>> one = conditions(np.zeros(1), np.zeros((1, 2)), np.eye(2)[None], Rows(
        ...     np.array([[[1.0, 1.0]]]), np.zeros((1, 1)), np.full((1, 1), 2.0), np.full((1, 1), 2.0)))
        >>> met, log_weight = one.meet(np.zeros(1, int), np.array([[0.5, -0.5]]), np.zeros((1, 1)))
        >>> met, log_weight
        (array([[1.5, 0.5]]), array([0.]))
    """

    rows: Rows
    factor: Array
    gain: Array
    is_band: tuple[bool, ...]
    log_probs: Array
    tails: Array

    @property
    def in_closed_form(self) -> bool:
        """True where every draw that meets the rows has the same weight."""
        return sum(self.is_band) <= 1

    def values(self, cell: np.ndarray, uniform: Array) -> tuple[Array, Array]:
        """Values (n, J) of the rows, and the draws' log weights (n,).

        Args:
            cell: (n,) which Gaussian.
            uniform: (n, J) in (0, 1).
        """
        factor, bands = self.factor[cell], 0
        white, log_weight = np.zeros(uniform.shape), np.zeros(len(cell))
        for j, is_band in enumerate(self.is_band):
            before = self.rows.centre[cell, j] + (factor[:, j, :j] * white[:, :j]).sum(1)
            low = (self.rows.low[cell, j] - before) / factor[:, j, j]
            if not is_band:
                white[:, j] = low
                continue
            high = (self.rows.high[cell, j] - before) / factor[:, j, j]
            white[:, j] = cut_normal(low, high, uniform[:, j])
            if bands:
                log_weight += log_between(low, high)
            bands += 1
        return self.rows.centre[cell] + (factor * white[:, None]).sum(2), log_weight

    def meet(self, cell: np.ndarray, u: Array, uniform: Array) -> tuple[Array, Array]:
        """Draws (n, D) of the Gaussians minus their means, moved to meet the rows, and their log weights (n,)."""
        if not self.is_band:
            return u, np.zeros(len(u))
        values, log_weight = self.values(cell, uniform)
        off = values - self.rows.centre[cell] - (self.rows.matrix[cell] * u[:, None]).sum(2)
        return u + (self.gain[cell] * off[:, None]).sum(2), log_weight


def conditions(log_probs: Array, means: Array, roots: Array, rows: Rows) -> Conditions:
    """Condition C Gaussians on rows.

    Args:
        log_probs: (C,) log shares, up to a constant.
        means: (C, D); only their number counts, for rows know their own centres.
        roots: (C, D, D) of the covariances.
        rows: Those of each Gaussian, with their bounds.

    Example:
        >>> ones, means, value = np.ones((2, 1, 1)), np.array([[0.0], [2.0]]), np.full((2, 1), 2.0)
        >>> given = conditions(np.zeros(2), means, ones, Rows(ones, means, value, value))  # N(0, 1), N(2, 1): both at 2
        >>> np.allclose(given.log_probs[1] - given.log_probs[0], 2.0)  # of the log likelihoods, 0 and -2**2 / 2
        True
    """
    n_cells, n_rows = len(means), rows.n_rows
    is_band = tuple(bool((rows.low[:, j] < rows.high[:, j]).any()) for j in range(n_rows))
    gain, factor = gain_of(roots, rows)
    white, total, tails, bands = np.zeros((n_cells, n_rows)), log_probs - log_total(log_probs), np.ones(n_rows), 0
    shares = total
    for j in range(n_rows):
        before = rows.centre[:, j] + (factor[:, j, :j] * white[:, :j]).sum(1)
        low, high = ((bound - before) / factor[:, j, j] for bound in (rows.low[:, j], rows.high[:, j]))
        weights = np.exp(shares - log_total(shares))
        tails[j] = _tail(weights, low, high)
        own = log_between(low, high) if is_band[j] else -0.5 * low**2 - np.log(factor[:, j, j])
        # What follows a band is given its middle, for the tails alone.
        white[:, j] = cut_normal(low, high, np.full(n_cells, 0.5)) if is_band[j] else low
        shares = shares + own
        if not (is_band[j] and bands):
            total = total + own
        bands += is_band[j]
    finite = np.isfinite(total).any()
    return Conditions(rows, factor, gain, is_band, total - log_total(total) if finite else log_probs, tails)


def gain_of(roots: Array, rows: Rows) -> tuple[Array, Array]:
    """Matrices (C, D, J) that move draws of Gaussians to values of their rows, and the rows' Cholesky factors.

    Args:
        roots: (C, D, D) of the covariances.
        rows: Those of each Gaussian, with their bounds.

    Example:
        >>> rows = Rows(np.ones((1, 1, 2)), np.zeros((1, 1)), np.zeros((1, 1)), np.zeros((1, 1)))
        >>> gain_of(np.diag([3.0, 1.0])[None], rows)[0].ravel()  # nine tenths by the number that varies more
        array([0.9, 0.1])
    """
    spread = rows.matrix @ roots
    factor = _cholesky(spread @ spread.mT)
    inverse = np.linalg.inv(factor) if rows.n_rows else factor
    return roots @ (spread.mT @ (inverse.mT @ inverse)), factor


def log_total(values: Array) -> Array:
    """Log of the sum of exponentials over the first axis: SciPy's takes ten times as long for a few numbers.

    Example:
        >>> round(float(log_total(np.log([1.0, 3.0]))), 6) == round(float(np.log(4.0)), 6)
        True
    """
    most = values.max(0)
    with np.errstate(divide="ignore", invalid="ignore"):
        total: Array = most + np.log(np.exp(values - most).sum(0))
    return np.where(np.isfinite(most), total, most)


def log_between(low: Array, high: Array) -> Array:
    """Log probability of a standard normal between two bounds, in the tails too.

    Example:
        >>> [round(float(one), 2) for one in log_between(np.array([-1.0, 30.0]), np.array([1.0, 31.0]))]
        [-0.38, -454.32]
    """
    flip = low > 0
    lower, upper = np.where(flip, -high, low), np.where(flip, -low, high)
    top, bottom = log_ndtr(upper), log_ndtr(lower)
    with np.errstate(divide="ignore"):
        log_share: Array = top + np.log1p(-np.exp(np.minimum(bottom - top, 0.0)))
    return log_share


def cut_normal(low: Array, high: Array, uniform: Array) -> Array:
    """Standard normals between two bounds, of uniform numbers in (0, 1).

    Example:
        >>> cut = cut_normal(np.array([2.0, -40.0]), np.array([3.0, -39.0]), np.array([0.5, 0.5]))
        >>> bool(2 < cut[0] < 3 and -40 < cut[1] < -39)
        True
    """
    flip = low > 0
    lower, upper = np.where(flip, -high, low), np.where(flip, -low, high)
    drawn = ndtri_exp(np.logaddexp(log_ndtr(lower), np.log(uniform) + log_between(lower, upper)))
    cut: Array = np.where(flip, -1.0, 1.0) * np.clip(drawn, lower, upper)
    return cut


def _tail(weights: Array, low: Array, high: Array) -> float:
    """Probability of a band, or of numbers at least as far out as a value, on its side."""
    if (low < high).any():
        return float(weights @ np.exp(log_between(low, high)))
    below = float(weights @ ndtr(low))
    return 2 * min(below, float(weights @ ndtr(-low)))


def _cholesky(matrix: Array) -> Array:
    """Lower factors (C, J, J); rows that others determine get a least standard deviation."""
    factor = np.zeros_like(matrix)
    for j in range(matrix.shape[1]):
        for i in range(j):
            inner = (factor[:, j, :i] * factor[:, i, :i]).sum(1)
            factor[:, j, i] = (matrix[:, j, i] - inner) / factor[:, i, i]
        rest = matrix[:, j, j] - (factor[:, j, :j] ** 2).sum(1)
        factor[:, j, j] = np.sqrt(np.maximum(rest, LEAST_SD**2))
    return factor
