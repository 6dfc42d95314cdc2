"""Covariances of few rows: correlations drawn to none by the weight that is optimal for them.

Ledoit and Wolf (2004), A well-conditioned estimator for large-dimensional covariance matrices, Journal of Multivariate
Analysis 88, with the variances as they are (Schaefer and Strimmer 2005, target D).
"""

import numpy as np

from descentflow.diagnosis.inference.linear_gaussian import Array

LEAST_VARIANCE = 1e-30


def shrunk(rows: Array) -> Array:
    """Sum (p, p) of the outer products of rows (a, p), its correlations shrunk by Ledoit and Wolf's weight.

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
    found: Array = np.where(apart, (1.0 - weight) * correlation, 1.0) * np.outer(spread, spread)
    return found
