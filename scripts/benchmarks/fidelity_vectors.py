"""Descents as vectors by 1,000 ft, a classifier of two sets of them, and their energy distance.

Independent of the package's own scores: NumPy, SciPy and scikit-learn alone.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm
from sklearn.ensemble import HistGradientBoostingClassifier
from sklearn.metrics import roc_auc_score
from sklearn.model_selection import StratifiedKFold, cross_val_predict
from torch import Tensor

from descentflow.core.units import KT_MPS

Array = NDArray[np.float64]
STEP = 10
"""Flight levels of a bin."""
COARSE = 3
"""Bins of the coarse features: 3,000 ft."""
IAS_NOISE_KT = 0.3
"""Noise of reports of IAS before it is rounded to 1 kt, put on samples with fine features."""
TREES = {"max_iter": 60, "learning_rate": 0.1, "max_leaf_nodes": 8, "min_samples_leaf": 10, "random_state": 0}
LEAST_COMMON = 6
"""Numbers that two descents must both show to be compared."""


@dataclass(frozen=True)
class Vectors:
    """CAS (kt) at the edges of bins (n, E), log seconds of the bins (n, E - 1), NaN where not shown; entry levels."""

    edges_fl: Array
    cas_kt: Array
    log_s: Array
    entry_fl: Array

    def __len__(self) -> int:
        """Number of descents."""
        return len(self.entry_fl)

    def rows(self, index: NDArray[np.intp]) -> "Vectors":
        """Some of them."""
        return Vectors(self.edges_fl, self.cas_kt[index], self.log_s[index], self.entry_fl[index])

    @property
    def whole(self) -> Array:
        """(n, 2 E - 1)."""
        return np.hstack([self.cas_kt, self.log_s])


def vectors_of(levels_fl: Tensor, time_s: Tensor, cas_mps: Tensor, mask: Tensor) -> Vectors:
    """Vectors of descents (n, L) on levels one flight level apart."""
    levels, shown = levels_fl.numpy(), mask.numpy()
    edges = np.arange(0, len(levels), STEP)
    spans = np.stack([shown[:, a : b + 1].all(1) for a, b in pairwise(edges)], 1)
    seconds = np.abs(np.diff(time_s.numpy()[:, edges]))
    with np.errstate(divide="ignore", invalid="ignore"):
        log_s = np.where(spans & (seconds > 0), np.log(seconds), np.nan)
    cas = np.where(shown[:, edges], cas_mps.numpy()[:, edges] / KT_MPS, np.nan)
    entry = levels[shown.shape[1] - 1 - shown[:, ::-1].argmax(1)]
    return Vectors(levels[edges], cas, log_s, entry)


def with_gaps_of(samples: Vectors, flights: Vectors, rng: np.random.Generator) -> Vectors:
    """Samples that show what a flight of about the same entry level shows."""
    order = np.argsort(flights.entry_fl, kind="stable")
    rank = np.searchsorted(flights.entry_fl[order], samples.entry_fl) + rng.integers(-4, 5, len(samples))
    like = flights.rows(order[np.clip(rank, 0, len(flights) - 1)])
    cas, log_s = (
        np.where(np.isfinite(theirs), ours, np.nan)
        for ours, theirs in ((samples.cas_kt, like.cas_kt), (samples.log_s, like.log_s))
    )
    return Vectors(samples.edges_fl, cas, log_s, samples.entry_fl)


def rounded(of: Vectors) -> Vectors:
    """The same with CAS of whole knots."""
    return Vectors(of.edges_fl, np.round(of.cas_kt), of.log_s, of.entry_fl)


def altitude_noise_ft(of: Vectors) -> float:
    """Independent noise of the altitude at each edge, by the median size of third differences of the log times.

    They are fourth differences of that noise, which widen its variance 70 times; smooth changes of the rate leave none.
    """
    thirds = np.diff(of.log_s, 3, axis=1)
    thirds = thirds[np.isfinite(thirds)]
    return float(np.median(np.abs(thirds)) / (norm.ppf(0.75) * 70**0.5) * 100 * STEP) if len(thirds) else 0.0


def reported(samples: Vectors, rng: np.random.Generator, noise_ft: float) -> Vectors:
    """Samples as reports would show them, with so much noise of the altitude."""
    off = rng.normal(0.0, noise_ft, samples.cas_kt.shape) / (100 * STEP)
    cas = samples.cas_kt + rng.normal(0.0, IAS_NOISE_KT, samples.cas_kt.shape)
    return rounded(Vectors(samples.edges_fl, cas, samples.log_s + np.log1p(np.diff(off)), samples.entry_fl))


def coarse(of: Vectors) -> Vectors:
    """The same by 3,000 ft, with CAS over three edges, which hides that reports are of whole knots."""
    n = of.log_s.shape[1] // COARSE
    seconds = np.exp(of.log_s[:, : n * COARSE]).reshape(len(of), n, COARSE).sum(2)
    edges = np.arange(n + 1) * COARSE
    near = [of.cas_kt[:, np.clip(edges + k, 0, len(of.edges_fl) - 1)] for k in (-1, 0, 1)]
    return Vectors(of.edges_fl[edges], np.mean(near, 0), np.log(seconds), of.entry_fl)


def auc(flights: Vectors, samples: Vectors, rng: np.random.Generator, *, size: int = 200, repeats: int = 5) -> float:
    """Area under the ROC curve of a classifier of so many of either: 0.5 where it cannot separate them."""
    areas = []
    n = min(size, len(flights), len(samples))
    for _ in range(repeats):
        pair = []
        for side in (flights, samples):
            some = side.rows(rng.permutation(len(side))[:n])
            pair.append(some.rows(np.argsort(some.entry_fl, kind="stable")))
        parts = [_features(side) for side in pair]
        both = np.isfinite(parts[0]) & np.isfinite(parts[1])
        features = np.vstack([np.where(both, part, np.nan) for part in parts])[:, both.any(0)]
        label = np.repeat([0, 1], n)
        folds = StratifiedKFold(5, shuffle=True, random_state=int(rng.integers(1 << 30)))
        chances = cross_val_predict(
            HistGradientBoostingClassifier(**TREES), features, label, cv=folds, method="predict_proba"
        )
        areas.append(roc_auc_score(label, chances[:, 1]))
    return float(np.mean(areas))


def _features(of: Vectors) -> Array:
    """CAS, log time, and the changes of both from bin to bin."""
    return np.hstack([of.whole, np.diff(of.cas_kt), np.diff(of.log_s)])


def energy_distance(first: Vectors, second: Vectors, spread: Array) -> float:
    """Energy distance of root mean squares over what two descents both show, in standard deviations."""
    own, other = first.whole / spread, second.whole / spread
    across, within, among = _distances(own, other), _distances(own, own), _distances(other, other)
    for same in (within, among):
        np.fill_diagonal(same, np.nan)
    return float(2 * np.nanmean(across) - np.nanmean(within) - np.nanmean(among))


def _distances(one: Array, other: Array) -> Array:
    shown, seen = np.isfinite(one).astype(float), np.isfinite(other).astype(float)
    first, second = np.nan_to_num(one), np.nan_to_num(other)
    squares = first**2 @ seen.T + shown @ (second**2).T - 2 * first @ second.T
    common = shown @ seen.T
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(common >= LEAST_COMMON, np.sqrt(np.maximum(squares, 0) / common), np.nan)
