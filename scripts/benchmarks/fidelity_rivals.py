"""Generators without physics, of the same flights: two mixtures, and a smoothed bootstrap."""

import warnings

import numpy as np
from sklearn.decomposition import PCA
from sklearn.exceptions import ConvergenceWarning
from sklearn.experimental import enable_iterative_imputer  # noqa: F401 (makes the import below possible)
from sklearn.impute import IterativeImputer
from sklearn.mixture import GaussianMixture
from sklearn.preprocessing import StandardScaler

from benchmarks.fidelity_vectors import Array, Vectors

EXPLAINED = 0.99
"""Share of variance that components keep; the rest is that of a flight."""
MOST_COMPONENTS = 10
FLIGHTS_EACH = 5
"""Flights for each component of a mixture, at least."""
ROUNDING = 1e-6
"""Least range of a number, kt or log seconds, of which flights show one value."""
COMPONENTS_OF_TRAFFIC = 3
"""Of the mixture in traffic's own example of its ``Generation``."""


class Components:
    """Principal components of standardised vectors, whose gaps are drawn given what flights show."""

    def __init__(self, train: Vectors, seed: int) -> None:
        """Complete the flights, and take components."""
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ConvergenceWarning)
            # What flights show bounds what is drawn: of few flights, the posterior knows rates of nothing and of all.
            # Numbers that no flight shows are above all of their entries, and zero does for them.
            shown = np.where(np.isfinite(train.whole).any(0), train.whole, 0.0)
            ends = {"min_value": np.nanmin(shown, 0) - ROUNDING, "max_value": np.nanmax(shown, 0) + ROUNDING}
            filled = IterativeImputer(
                sample_posterior=True, max_iter=5, n_nearest_features=10, random_state=seed, **ends
            )
            whole = np.asarray(filled.fit_transform(shown))
        self.whole = whole
        self.train, self.mean, self.spread = train, whole.mean(0), np.maximum(whole.std(0), 1e-9)
        standard = (whole - self.mean) / self.spread
        self.pca = PCA(EXPLAINED, svd_solver="full").fit(standard)
        self.weights = self.pca.transform(standard)
        self.left = standard - self.pca.inverse_transform(self.weights)

    def vectors(self, weights: Array, left: Array, entry_fl: Array) -> Vectors:
        """Descents of weights and of what components leave out, up to their entry levels."""
        return self.up_to((self.pca.inverse_transform(weights) + left) * self.spread + self.mean, entry_fl)

    def up_to(self, whole: Array, entry_fl: Array) -> Vectors:
        """Descents of whole vectors, up to their entry levels."""
        cas, log_s = np.split(whole, [len(self.train.edges_fl)], axis=1)
        above = self.train.edges_fl > entry_fl[:, None]
        return Vectors(
            self.train.edges_fl, np.where(above, np.nan, cas), np.where(above[:, 1:], np.nan, log_s), entry_fl
        )


def smoothed_bootstrap(train: Vectors, n: int, seed: int) -> Vectors:
    """Flights drawn again, with weights moved by a kernel that keeps their variance (Silverman and Young 1987)."""
    parts, rng = Components(train, seed), np.random.default_rng(seed)
    m, d = parts.weights.shape
    width = m ** (-1 / (d + 4))
    chosen = rng.integers(0, m, n)
    noise = rng.normal(size=(n, d)) * parts.weights.std(0)
    moved = np.sqrt(1 - width**2) * parts.weights[chosen] + width * noise
    return parts.vectors(moved, parts.left[chosen], train.entry_fl[chosen])


def mixture_on_components(train: Vectors, n: int, seed: int) -> Vectors:
    """A mixture over weights and entry level, of as many Gaussians as the Bayesian criterion chooses."""
    parts, rng = Components(train, seed), np.random.default_rng(seed)
    entry = train.entry_fl + rng.uniform(-0.5, 0.5, len(train))
    scale = np.append(parts.weights.std(0), max(entry.std(), 1e-3))
    joint = np.column_stack([parts.weights, entry - entry.mean()]) / scale
    numbers = range(1, max(min(MOST_COMPONENTS, len(joint) // FLIGHTS_EACH), 1) + 1)
    fits = [GaussianMixture(k, reg_covar=1e-2, n_init=2, random_state=seed).fit(joint) for k in numbers]
    drawn = min(fits, key=lambda one: one.bic(joint)).sample(n)[0] * scale
    left = parts.left[rng.integers(0, len(joint), n)]
    return parts.vectors(drawn[:, :-1], left, _on_grid(drawn[:, -1] + entry.mean(), train))


def as_traffic_does(train: Vectors, n: int, seed: int) -> Vectors:
    """``traffic.algorithms.generation.Generation`` of the same numbers: each flight's in a row, scaled, a mixture.

    Written out, for traffic does not import with pandas 3; gaps are drawn first, which it cannot have.
    """
    parts, rng = Components(train, seed), np.random.default_rng(seed)
    scaler = StandardScaler()
    entry = train.entry_fl + rng.uniform(-0.5, 0.5, len(train))
    rows = scaler.fit_transform(np.column_stack([parts.whole, entry]))
    mixture = GaussianMixture(min(COMPONENTS_OF_TRAFFIC, len(train)), random_state=seed).fit(rows)
    drawn = scaler.inverse_transform(mixture.sample(n)[0])
    return parts.up_to(drawn[:, :-1], _on_grid(drawn[:, -1], train))


def _on_grid(entry_fl: Array, train: Vectors) -> Array:
    return np.clip(np.round(entry_fl), train.edges_fl[0] + 11, train.edges_fl[-1] + 9)


RIVALS = {
    "mixture on PCA": mixture_on_components,
    "as traffic does": as_traffic_does,
    "smoothed bootstrap": smoothed_bootstrap,
}
