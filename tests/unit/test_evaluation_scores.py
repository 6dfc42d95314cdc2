"""Scores and their table: units, floors, levels left out, and a statistic that is one entry of the registry."""

from dataclasses import replace
from functools import cache
from math import isnan
from pathlib import Path

import pytest
import torch
import toys
from torch import Tensor

from descentflow.core.errors import DataError
from descentflow.core.units import FPM_MPS, KT_MPS
from descentflow.evaluation.evaluation_report import verdict
from descentflow.evaluation.figures._score_figures import level_scores_figure
from descentflow.evaluation.metrics.classifier import Detection
from descentflow.evaluation.metrics.descent_set import DescentSet
from descentflow.evaluation.metrics.distances import MIN_VALUES, Pooled, Values
from descentflow.evaluation.metrics.score_registry import STATISTICS, LevelStatistic, ProfileStatistic
from descentflow.evaluation.metrics.score_table import Score, ScoreTable
from descentflow.evaluation.metrics.scores import score


@cache
def flights(n: int, seed: int = 0) -> DescentSet:
    return DescentSet.of_profiles(toys.flights(n, seed, bottom_fl=280, top_fl=300))


def faster(descents: DescentSet, knots: float) -> DescentSet:
    return replace(descents, cas_mps=descents.cas_mps + knots * KT_MPS)


def test_units_are_those_of_the_field() -> None:
    real = flights(60)
    moved = replace(faster(real, 7.0), rate_mps=real.rate_mps - 90 * FPM_MPS, time_s=real.time_s * 2)
    table = score(moved, real, 290.0)
    assert {(r.quantity.split("_")[0], r.unit) for r in table if r.statistic not in ("ks", "joint_energy")} == {
        ("time", "s"), ("cas", "kt"), ("rocd", "ft/min"),
    }  # fmt: skip
    for name, shift in (("cas", 7.0), ("rocd", 90.0)):
        for statistic in ("wasserstein", "mae"):
            assert table.get(f"{name}_below_transition", statistic).score == pytest.approx(shift, rel=1e-9)
    mean = float(real.time_to_bottom_s().mean())
    assert mean > 0
    assert table.get("time_to_bottom_of_descent", "mae").score == pytest.approx(mean, rel=1e-9)


@pytest.mark.parametrize("n", [0, 1, 3])
def test_too_few_flights_have_a_reason_and_no_score(n: int) -> None:
    table = score(flights(60, 1), flights(60).subset(torch.arange(n)), 290.0)
    assert all(isnan(row.score) and row.note for row in table)
    assert table.scalars() == {}


def test_refusals() -> None:
    real = flights(20)
    other = DescentSet.of_profiles(toys.flights(20, bottom_fl=281, top_fl=300))
    with pytest.raises(DataError, match="samples on 20 levels"):
        score(other, real, 290.0)


def plain(n: int, seed: int = 0, n_levels: int = 11) -> DescentSet:
    generator = torch.Generator().manual_seed(seed)
    levels = torch.arange(200, 200 + n_levels, dtype=torch.float64)
    cas = 140 + 5 * torch.randn(n, 1, generator=generator, dtype=torch.float64).expand(n, n_levels)
    time = (levels[-1] - levels) * (4 + torch.rand(n, 1, generator=generator, dtype=torch.float64))
    return DescentSet(levels, time, cas, -30.48 / time.diff()[:, :1].neg().expand_as(cas), cas, cas > 0)


def test_levels_with_too_few_flights_are_left_out_and_counted() -> None:
    samples, real = plain(40, 1), plain(20)
    mask = real.mask.clone()
    mask[MIN_VALUES - 1 :, -2:] = False  # three flights at the two highest levels
    far = real.cas_mps.clone()
    far[:, -2:] += 1000  # would dominate the mean if it were not left out
    row = score(samples, replace(real, mask=mask, cas_mps=far), 205.0).get("cas_above_transition", "wasserstein")
    assert row.score < 20
    assert row.n_levels == 3
    assert row.worst_fl <= 208
    assert row.note == "2 of 5 levels left out: fewer than 4 descents"


def test_nominal_is_compared_with_what_was_observed() -> None:
    real = plain(20)
    mask = real.mask.clone()
    mask[:10, 0] = False
    junk = torch.where(mask, real.cas_mps, torch.nan)
    table = score(plain(40, 1), replace(real, mask=mask, cas_mps=junk), 200.0, plain(1, 3))
    expected = abs(float(real.cas_mps[10:, 0].mean() - plain(1, 3).cas_mps[0, 0])) / KT_MPS
    assert table.get("cas_below_transition", "mae").nominal == pytest.approx(expected, rel=1e-12)


def test_nominal_must_cover_the_levels() -> None:
    real = plain(20)
    mask = torch.ones(1, 11, dtype=torch.bool)
    mask[0, -1] = False
    table = score(plain(40, 1), real, 205.0, replace(plain(1), mask=mask))
    above, below = (table.get(f"cas_{side}_transition", "mae") for side in ("above", "below"))
    assert isnan(above.nominal)
    assert above.note == "the nominal descent does not cover these levels"
    assert below.nominal >= 0
    assert below.note == ""


def test_the_text_explains_what_is_absent() -> None:
    text = str(score(plain(40, 1), plain(3), float("inf"), plain(1)))
    lines = text.splitlines()
    assert max(map(len, lines)) <= 120
    assert "nan" not in text
    named = [line for line in lines if line.startswith("not compared, ")]
    assert "not compared, fewer than 4 descents that span the grid (40 sampled, 3 real in all): " in named[0]
    assert "not compared, no level of the grid is above the transition: " in text
    # They have no line of dashes in the table.
    assert not any(line.startswith("time_to_bottom_of_descent") for line in lines)


def test_absent_numbers_are_empty_fields(tmp_path: Path) -> None:
    path = tmp_path / "scores.csv"
    table = score(plain(40, 1), plain(3), 205.0, n_splits=2)
    table.frame().write_csv(path)
    header, first, *rest = path.read_text().splitlines()
    assert len(rest) == 22
    assert header.split(",")[:6] == ["quantity", "statistic", "unit", "score", "equal_size", "floor"]
    assert first.startswith("time_to_bottom_of_descent,ks,1,,,,,,,,40,3,1,0,,")
    assert all(bool(level.score.isnan().all()) for level in table.levels)


def test_a_verdict_on_flights_that_are_all_alike_has_no_ratio() -> None:
    """Their noise floor is zero."""
    far = Score("rocd_below_transition", "wasserstein", "ft/min", equal_size=20.0, floor=0.0, floor_high=0.0, n_each=40)
    assert "held-out flights are all alike" in verdict(ScoreTable((far,)), Detection(torch.tensor([torch.nan]), ()))


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
    for statistic in TOYS:
        monkeypatch.setitem(STATISTICS, statistic.name, statistic)


@pytest.mark.usefixtures("_registered")
def test_a_new_statistic_is_found_everywhere() -> None:
    samples, real = descents(80, 1), descents(60, 0)
    table = score(samples, real, 290.0, n_splits=2)
    names = [(row.quantity, row.statistic) for row in table]
    assert names[:5] == [("time_to_bottom_of_descent", name) for name in ("ks", "wasserstein", "mae", "crps", "toy")]
    assert ("cas_above_transition", "toy") in names
    assert names[-2:] == [("rocd_profile", "toy_profile"), ("descent", "joint_energy")]
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
