"""Sets that do not fit, levels with too few flights, the worst level, and the table that a reader sees."""

from dataclasses import replace
from math import isnan
from pathlib import Path

import pytest
import torch

from descentflow.core.units import KT_MPS
from descentflow.evaluation.evaluation_report import verdict
from descentflow.evaluation.metrics._distances import MIN_VALUES
from descentflow.evaluation.metrics.classifier import Detection
from descentflow.evaluation.metrics.descent_set import DescentSet
from descentflow.evaluation.metrics.score_table import Score, ScoreTable
from descentflow.evaluation.metrics.scores import score


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
    assert all(bool(one.score.isnan().all()) for one in table.levels)


def test_a_verdict_on_flights_that_are_all_alike_has_no_ratio() -> None:
    """Their noise floor is zero."""
    far = Score("rocd_below_transition", "wasserstein", "ft/min", equal_size=20.0, floor=0.0, floor_high=0.0, n_each=40)
    assert "held-out flights are all alike" in verdict(ScoreTable((far,)), Detection(torch.tensor([torch.nan]), ()))
