"""The distributions that WRAP knows: normal, gamma and beta, with the parameters of scipy."""

import warnings
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
KINDS = {"norm": 2, "gamma": 3, "beta": 4}
"""Name in WRAP and in scipy -> number of parameters."""


@dataclass(frozen=True)
class WrapModel:
    """One fitted distribution: its kind, scipy's parameters, its mode, and the 5 and 95 % quantiles of the values.

    Example:
        >>> WrapModel("norm", (0.77, 0.02), 0.77, 0.74, 0.8).words()
        ('0.77', '0.74', '0.8', 'norm', '0.77|0.02')
    """

    kind: str
    parameters: tuple[float, ...]
    best: float
    low: float
    high: float

    def words(self) -> tuple[str, str, str, str, str]:
        """The last five columns of a row."""
        best, low, high = (f"{value:.5g}" for value in (self.best, self.low, self.high))
        return best, low, high, self.kind, "|".join(f"{value:.6g}" for value in self.parameters)


def fitted_model(values: Array) -> WrapModel:
    """Fit all three by maximum likelihood and keep the one of the lowest AIC.

    Args:
        values: (n,) of one quantity, a value for each sample.

    Example:
        >>> values = np.random.default_rng(0).normal(140.0, 5.0, 2000)
        >>> fitted_model(values).kind
        'norm'
    """
    from scipy import stats

    found: dict[str, tuple[float, tuple[float, ...]]] = {}
    for kind, count in KINDS.items():
        family: Any = getattr(stats, kind)
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore", RuntimeWarning)
            try:
                parameters = tuple(float(value) for value in family.fit(values))
            except stats.FitError:
                continue
            # As it is written, with six digits.
            parameters = tuple(float(f"{value:.6g}") for value in parameters)
            criterion = 2 * count - 2 * float(np.sum(family.logpdf(values, *parameters)))
        if np.isfinite(criterion):
            found[kind] = criterion, parameters
    kind = min(found, key=lambda name: found[name][0])
    parameters = found[kind][1]
    low, high = np.quantile(values, [0.05, 0.95])
    # Within them: a beta may be largest at an end.
    grid = np.linspace(low, high, 2001)
    best = float(grid[np.argmax(getattr(stats, kind).pdf(grid, *parameters))])
    return WrapModel(kind, parameters, best, float(low), float(high))
