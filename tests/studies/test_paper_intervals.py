"""Bootstrap intervals of scores over held-out flights."""

import pytest
import toys

from descentflow.core.units import KT_MPS
from descentflow.evaluation.metrics.descent_set import DescentSet
from descentflow.evaluation.metrics.scores import score
from studies.paper.score_intervals import score_intervals


def sets(n: int, seed: int) -> DescentSet:
    return DescentSet.of_profiles(toys.flights(n, seed, top_fl=190))


def test_the_width_is_that_of_a_mean_over_flights() -> None:
    """Error of the mean CAS with samples 20 kt away: its deviation is that of the flights' mean, in closed form."""
    samples, real = sets(3000, 1), sets(200, 2)
    samples.cas_mps.add_(20 * KT_MPS)
    table = score(samples, real, 170.0, n_splits=1)
    found = {(i.quantity, i.statistic): i for i in score_intervals(table, samples, real, 170.0, n_resamples=200)}
    one = found["cas_below_transition", "mae"]
    below = real.levels_fl <= 170
    mean_by_flight = (real.cas_mps[:, below] / KT_MPS).mean(1)
    expected = 2 * 1.645 * float(mean_by_flight.std()) / 200**0.5
    # 200 resamples tell a standard deviation to 5 %; few flights of these lack a level.
    assert one.high - one.low == pytest.approx(expected, rel=0.2)
