r"""Evidence day by day that a mean has changed: an e-process, which a null exceeds :math:`1/\alpha` by in a share α.

Day i has the mean :math:`y_i` of its flights. Days scatter with the covariance :math:`\sigma^2 V`,
:math:`V = \tau^2 R + \operatorname{diag}(s^2 / n_i)`: between days, with a serial correlation
:math:`R_{ij} = r^{|i-j|}` for fronts that stay, and within them. From day j on the mean may have moved by
:math:`\delta\sigma x_i`, where x is one for a step and grows for a drift, with :math:`\delta \sim N(0, g)`. With the
prior :math:`d\mu\, d\sigma / \sigma` on both sides, the ratio of the marginal densities of the first n days is

.. math:: B_j = \Bigl(\frac{|V|\, a}{|V_1|\, a_1}\Bigr)^{1/2}
          \Bigl(\frac{\mathrm{RSS}}{\mathrm{RSS}_1}\Bigr)^{(n-1)/2},\qquad V_1 = V + g\, x x^\top,

where :math:`a = 1^\top V^{-1} 1` and RSS is the generalised sum of squares about the mean. It does not depend on the
unknown mean and scale, so that it is an e-process (Hendriksen, de Heide and Grünwald, Optional Stopping with Bayes
Factors, 2021), and so is the mean over quantities, shapes and days of change, of which each day of a year weighs alike
(Shin, Ramdas and Rinaldo, E-detectors, 2023; Ville's inequality bounds its largest value).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

YEAR = 365
"""Days of change that weigh alike: one rate of false alarms holds for each year."""
SIZES = (0.5, 2.0)
"""Standard deviations of a change, in those of days: small ones and large ones."""
DRIFT_DAYS = 14.0
"""Days after which a drift has moved by the change."""
SHAPES = ("step", "drift")
MOST_CORRELATION = 0.7
"""Serial correlation that a reference of some weeks may claim at most."""
Numbers = NDArray[np.float64]


@dataclass(frozen=True)
class DayMeans:
    """Means of days, in the order of days.

    Shapes: ``mean`` (n, q); ``within`` (n, q) variance of each mean by its own flights; NaN where a day shows none.
    """

    mean: Numbers
    within: Numbers


@dataclass(frozen=True)
class Evidence:
    """Evidence after each day.

    Attributes:
        log_e: (n,) logarithm of the e-process; zero within the reference.
        change: (n, n) log weight of a change on day j, seen from day n, over quantities and shapes; -inf for j > n.
        shape: (n, 2) log weight of a step and of a drift.
        quantity: (n, q) log weight of each quantity.
    """

    log_e: Numbers
    change: Numbers
    shape: Numbers
    quantity: Numbers

    def first_alarm(self, alpha: float) -> int | None:
        """Day on which the e-process first reaches 1 / alpha; None if it does not."""
        over = np.flatnonzero(self.log_e >= -np.log(alpha))
        return int(over[0]) if len(over) else None

    def dates(self, day: int, share: float = 0.9) -> tuple[int, int, int]:
        """Likeliest day of change seen from one day, and the first and the last of those that hold the share."""
        weight = np.exp(self.change[day] - self.change[day].max())
        order = np.argsort(-weight, kind="stable")
        kept = order[: int(np.searchsorted(np.cumsum(weight[order]) / weight.sum(), share)) + 1]
        return int(order[0]), int(kept.min()), int(kept.max())


def evidence(days: DayMeans, reference: int) -> Evidence:
    """Evidence of a change after a reference.

    Args:
        days: Means of days.
        reference: Number of first days that have no change, at least 8; scatter between days is learnt there.

    Example:
        >>> mean = np.where(np.arange(60) < 40, 0.0, 3.0)[:, None] + np.random.default_rng(0).normal(size=(60, 1))
        >>> weighed = evidence(DayMeans(mean, np.full((60, 1), 0.1)), 20)
        >>> alarm = weighed.first_alarm(0.05)
        >>> alarm, weighed.dates(alarm)[0]
        (43, 41)
    """
    n, quantities = days.mean.shape
    logs = [_of_quantity(mean, within, reference) for mean, within in zip(days.mean.T, days.within.T, strict=True)]
    parts = np.stack(logs) - np.log(quantities * len(SHAPES) * len(SIZES) * YEAR)
    candidates = np.clip(np.arange(n) - reference + 1, 0, YEAR)
    with np.errstate(divide="ignore"):
        unborn = np.log(1.0 - candidates / YEAR)
    total = np.logaddexp(np.logaddexp.reduce(parts, axis=(0, 1, 2, 4)), unborn)
    return Evidence(
        total,
        np.logaddexp.reduce(parts, axis=(0, 1, 2)),
        np.logaddexp.reduce(parts, axis=(0, 2, 4)).T,
        np.logaddexp.reduce(parts, axis=(1, 2, 4)).T,
    )


def _of_quantity(mean: Numbers, within: Numbers, reference: int) -> Numbers:
    """Logarithms of B (shapes, sizes, n, n) of one quantity: seen from a day (rows), of a change on a day (columns)."""
    n = len(mean)
    logs = np.zeros((len(SHAPES), len(SIZES), n, n))
    seen = np.isfinite(mean) & np.isfinite(within)
    seen_before = int(seen[:reference].sum())
    if seen_before >= MIN_REFERENCE:
        at = np.flatnonzero(seen)
        covariance, scale = _covariance(mean[at], within[at], at, seen_before)
        root: Numbers = np.asarray(np.linalg.cholesky(covariance), dtype=np.float64)
        own = _log_factors(root, mean[at], at, scale, n)
        # A day that shows nothing of the quantity leaves what was known before.
        last = np.searchsorted(at, np.arange(n), side="right") - 1
        filled = own[:, :, np.maximum(last, 0)]
        logs = np.where((last >= 0)[None, None, :, None], filled, 0.0)
    later = np.arange(n)[None, :] > np.arange(n)[:, None]
    logs[..., later | (np.arange(n) < reference)[None, :]] = -np.inf
    return logs


MIN_REFERENCE = 8
"""Days of a reference below which the scatter between days is not known."""


def _covariance(mean: Numbers, within: Numbers, day: NDArray[np.int64], reference: int) -> tuple[Numbers, float]:
    """Covariance (m, m) of days' means up to a scale, and the variance of a usual day."""
    known = mean[:reference] - mean[:reference].mean()
    between = max(float(known.var(ddof=1)) - float(within[:reference].mean()), 0.0)
    lagged = float((known[1:] * known[:-1]).sum() / max((known**2).sum(), 1e-300))
    # The sample's correlation is one over the number of days too small, and unsure: half a standard error is added.
    serial = min(max(lagged + 1.0 / reference + 0.5 * reference**-0.5, 0.0), MOST_CORRELATION)
    usual = between + float(within.mean())
    apart = np.abs(day[:, None] - day[None, :])
    covariance: Numbers = between * serial**apart + np.diag(within + 1e-12 * max(usual, 1e-300))
    return covariance, usual


def _log_factors(root: Numbers, mean: Numbers, day: NDArray[np.int64], usual: float, days: int) -> Numbers:
    """Logarithms of B (shapes, sizes, m, days), for changes on every day."""
    ones, y = (solve_triangular(root, x, lower=True) for x in (np.ones(len(mean)), mean))
    a, b, c = (np.cumsum(x) for x in (ones * ones, ones * y, y * y))
    rest = np.maximum(c - b * b / a, 1e-300)
    count = np.arange(1, len(mean) + 1)
    logs = []
    since = day[:, None] - np.arange(days)[None, :] + 1.0
    for shape in SHAPES:
        moved = np.where(since > 0, 1.0 if shape == "step" else np.maximum(since, 0.0) / DRIFT_DAYS, 0.0)
        x = solve_triangular(root, moved, lower=True)
        xx, x1, xy = (np.cumsum(x * other, axis=0) for other in (x, ones[:, None], y[:, None]))
        for size in SIZES:
            g = size**2 * usual
            # By the formula of Sherman and Morrison.
            part = g / (1.0 + g * xx)
            a1, b1, c1 = a[:, None] - part * x1 * x1, b[:, None] - part * x1 * xy, c[:, None] - part * xy * xy
            rest1 = np.maximum(c1 - b1 * b1 / a1, 1e-300)
            logs.append(
                -0.5 * np.log1p(g * xx)
                - 0.5 * np.log(a1 / a[:, None])
                - 0.5 * (count[:, None] - 1) * np.log(rest1 / rest[:, None])
            )
    return np.stack(logs).reshape(len(SHAPES), len(SIZES), len(mean), days)
