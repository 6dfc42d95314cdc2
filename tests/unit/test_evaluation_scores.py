"""Scores beside their floor: the null, a shift, missing values, the nominal descent, units and the table's forms."""

from dataclasses import replace
from functools import cache
from math import isnan

import pytest
import torch
import toys

from descentflow.core.errors import DataError
from descentflow.core.units import FPM_MPS, KT_MPS
from descentflow.evaluation.metrics.descent_set import DescentSet
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
