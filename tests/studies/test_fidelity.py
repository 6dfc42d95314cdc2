"""Vectors of the fidelity benchmark: SciPy's energy distance, and a classifier that separates what differs."""

import numpy as np
import toys
from scipy.spatial.distance import cdist

from benchmarks.fidelity_vectors import (
    Vectors,
    altitude_noise_ft,
    auc,
    energy_distance,
    reported,
    vectors_of,
)


def flights(n: int, seed: int) -> Vectors:
    shown = toys.flights(n, seed, gappy=False)
    return vectors_of(shown.levels_fl, shown.time_s, shown.cas_mps, shown.mask)


def test_energy_distance_is_that_of_scipys_distances() -> None:
    one, other = flights(40, 1), flights(60, 2)
    spread = np.ones(one.whole.shape[1])
    scale = one.whole.shape[1] ** 0.5

    def mean(first: np.ndarray, second: np.ndarray) -> float:
        found = cdist(first, second) / scale
        return float(found[found > 0].mean())

    expected = 2 * mean(one.whole, other.whole) - mean(one.whole, one.whole) - mean(other.whole, other.whole)
    assert abs(energy_distance(one, other, spread) - expected) < 1e-6


def test_noise_that_was_put_on_is_measured() -> None:
    """Of smooth flights, 300 with some 20 third differences each: known to 2 %, and what bends adds to its square."""
    smooth = flights(300, 4)
    noisy = reported(smooth, np.random.default_rng(0), 20.0)
    expected = (20.0**2 + altitude_noise_ft(smooth) ** 2) ** 0.5
    assert abs(altitude_noise_ft(noisy) / expected - 1) < 0.08


def test_the_classifier_separates_what_differs_alone() -> None:
    """An AUC of 100 pairs a repeat is known to 0.04; five repeats share the flights."""
    one, same = flights(200, 1), flights(200, 2)
    faster = Vectors(same.edges_fl, same.cas_kt + 40, same.log_s, same.entry_fl)
    assert 0.35 < auc(one, same, np.random.default_rng(1), size=100) < 0.65
    assert auc(one, faster, np.random.default_rng(1), size=100) > 0.9
