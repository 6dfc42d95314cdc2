"""A statistic is one entry: registered, it is in the table, the file, the intervals and the figure."""

from math import isnan

import pytest
import torch
import toys
from torch import Tensor

from descentflow.evaluation.figures._score_figures import level_scores_figure
from descentflow.evaluation.metrics._distances import Pooled, Values
from descentflow.evaluation.metrics.descent_set import DescentSet
from descentflow.evaluation.metrics.score_registry import STATISTICS, LevelStatistic, ProfileStatistic
from descentflow.evaluation.metrics.scores import score


def descents(n: int, seed: int) -> DescentSet:
    return DescentSet.of_profiles(toys.flights(n, seed, bottom_fl=280, top_fl=300))


def squared_error_of_the_mean(pooled: Pooled) -> Tensor:
    return (pooled.mean_first - pooled.mean_second).square()[:, 0]


def bias_of_the_mean_profile(samples: Values, real: Values) -> Tensor:
    return torch.where(real[1], real[0] - samples[0].mean(0), 0.0).sum(1) / real[1].sum(1)


TOYS = (
    LevelStatistic("toy", "toy distance", "toy", "toy unit", False, in_figure=True, compute=squared_error_of_the_mean),
    ProfileStatistic("toy_profile", "toy of profiles", "toy profile", compute=bias_of_the_mean_profile),
)


@pytest.fixture
def _registered(monkeypatch: pytest.MonkeyPatch) -> None:
    for one in TOYS:
        monkeypatch.setitem(STATISTICS, one.name, one)


@pytest.mark.usefixtures("_registered")
def test_a_new_statistic_is_found_everywhere() -> None:
    samples, real = descents(80, 1), descents(60, 0)
    table = score(samples, real, 290.0, n_splits=2)
    found = [(row.quantity, row.statistic) for row in table]
    assert found[:5] == [("time_to_bottom_of_descent", name) for name in ("ks", "wasserstein", "mae", "crps", "toy")]
    assert ("cas_above_transition", "toy") in found
    assert found[-2:] == [("rocd_profile", "toy_profile"), ("descent", "joint_energy")]
    row, mae = (table.get("cas_below_transition", name) for name in ("toy", "mae"))
    assert row.unit == "toy unit"
    assert row.score >= mae.score**2, "the mean of squares is at least the square of the mean"
    assert isnan(row.floor)
    assert isnan(row.equal_size)
    assert row.note == "", "it has no noise floor, which is no lack"
    whole = table.get("rocd_profile", "toy_profile")
    assert whole.unit == "ft/min"
    assert not isnan(whole.floor)
    written = table.frame().filter(statistic="toy")
    assert written["score"].to_list() == [r.score for r in table if r.statistic == "toy"]
    figure = level_scores_figure(table, 290.0)
    assert "toy, CAS (toy unit)" in [ax.get_xlabel() for ax in figure.axes]
