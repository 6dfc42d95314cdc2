"""Precision matrices of flights that miss some entries."""

import numpy as np

from descentflow.diagnosis.inference.linear_gaussian import Array


class Precisions:
    """Precision matrices of a normal law in flights that miss some entries, one a pattern of what is seen.

    Example:
        >>> found = Precisions(np.diag([1.0, 4.0]), np.array([[True, True], [False, True]]))
        >>> found.log_density(np.array([[1.0, 2.0], [0.0, 2.0]])).round(3)  # without the constant
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
        precision, half_log = np.zeros((len(patterns), *covariance.shape)), np.zeros(len(patterns))
        for k, pattern in enumerate(patterns):
            at = np.ix_(pattern, pattern)
            precision[k][at] = np.linalg.inv(covariance[at])
            half_log[k] = 0.5 * np.linalg.slogdet(precision[k][at])[1]
        self.precision, self.half_log = precision[index], half_log[index]

    def times(self, values: Array) -> Array:
        """Precision times values (n, m)."""
        return (self.precision @ values[:, :, None])[:, :, 0]

    def log_density(self, values: Array) -> Array:
        """(n,) of values (n, m) that are zero where not seen, without the constant."""
        found: Array = self.half_log - 0.5 * (self.times(values) * values).sum(1)
        return found
