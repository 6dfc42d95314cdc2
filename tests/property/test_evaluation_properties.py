"""Properties of distances for any values: scipy's numbers, symmetry, invariances, and bounds between them."""

from typing import Any

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats
from torch import Tensor

from descentflow.evaluation.metrics.noise_floor import level_distances

# Few distinct values make ties, neighbours in the last bit test that none are made, and both signs of very different
# size take the slow way of sorting.
NUMBERS = st.one_of(
    st.integers(-3, 3).map(float),
    st.sampled_from([130.0, np.nextafter(130.0, 131.0), np.nextafter(130.0, 129.0), 5e-324, -5e-324, 0.0, -0.0]),
    st.floats(-1e6, 1e6),
)
SAMPLES = st.lists(NUMBERS, min_size=1, max_size=12)


def column(values: list[float]) -> tuple[Tensor, Tensor]:
    tensor = torch.tensor(values, dtype=torch.float64)[:, None]
    return tensor, torch.ones_like(tensor, dtype=torch.bool)


def distances(one: list[float], two: list[float]) -> tuple[float, float, float]:
    by_name = level_distances(*column(one), *column(two))
    return float(by_name["ks"]), float(by_name["wasserstein"]), float(by_name["mae"])


@settings(max_examples=150, deadline=None)
@given(SAMPLES, SAMPLES)
def test_any_values_as_scipy(one: list[float], two: list[float]) -> None:
    ks, wasserstein, _ = distances(one, two)
    with np.errstate(divide="ignore"):  # scipy's p-value of a single value
        # To the last bits: a tie made or missed would change it by at least 1 / 144.
        assert ks == pytest.approx(stats.ks_2samp(one, two, method="asymp").statistic, abs=1e-14)
    assert wasserstein == pytest.approx(stats.wasserstein_distance(one, two), rel=1e-12, abs=1e-12)


@settings(max_examples=50, deadline=None)
@given(SAMPLES, SAMPLES)
def test_crps_and_the_energy_distance_of_empirical_distributions(one: list[float], two: list[float]) -> None:
    one = [*one, one[0]]  # two samples at the least
    n, m = len(one), len(two)
    among_one, among_two = (sum(abs(x - y) for x in values for y in values) for values in (one, two))
    crossed = 2 * float(level_distances(*column(one), *column(two))["crps"]) + among_one / (n * (n - 1))
    energy = crossed - among_one / n**2 - among_two / m**2
    scale = 1e-9 * max(abs(x) for x in (*one, *two))  # rounding of differences up to 1e6
    assert energy >= -1e-9 - scale
    assert energy == pytest.approx(stats.energy_distance(one, two) ** 2, rel=1e-9, abs=1e-9 + scale)


@settings(max_examples=40, deadline=None)
@given(st.data())
def test_hidden_values_are_never_read(data: Any) -> None:
    # Integers counted from the bits of 2.0 would, for what is absent, end in those of NaN.
    first, two = data.draw(SAMPLES | st.just([2.0, 3.0])), data.draw(SAMPLES | st.just([2.0]))
    junk = st.sampled_from([float("nan"), float("inf"), 1e300, 0.0])
    values, mask = [], []
    for value in first:
        hidden = data.draw(st.lists(junk, max_size=2))
        values += [*hidden, value]
        mask += [False] * len(hidden) + [True]
    gappy = torch.tensor(values, dtype=torch.float64)[:, None], torch.tensor(mask)[:, None]
    with_hidden, expected = level_distances(*gappy, *column(two)), level_distances(*column(first), *column(two))
    for field in ("ks", "fewest"):
        assert torch.equal(with_hidden[field], expected[field])
    for field in ("wasserstein", "mae"):  # more terms, though zero, may be added in another order
        torch.testing.assert_close(with_hidden[field], expected[field], rtol=1e-12, atol=1e-9)
