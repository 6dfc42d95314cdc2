"""Descents by a table of rates: what is read, what is drawn, what is flown."""

import json
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from flying.flight_plans import FlightPlan
from flying.rate_table import drawn, fly, read_tables

PROFILE = {
    "flight_level": [0, 100, 300],
    "cas_des": [250, 250, 290],
    "mach_des": [0.78, 0.78, 0.78],
    "rocd_des": [1500, 1500, 2500],
}
SPREADS = {"rocd_des": {"norm_mean": 2500, "sigma": 1000, "minimum": 2000, "maximum": 3000}}
PLAN = FlightPlan("f", "a1", "A320", datetime(2024, 3, 1, tzinfo=UTC), 360, 100, 0.8, 300, (4.0,), ())


def written(tmp_path: Path, **changes: object) -> Path:
    path = tmp_path / "profile.json"
    path.write_text(json.dumps({"aircraft": {"MEDIUM": {**PROFILE, **changes}}}))
    return path


def test_time_is_the_integral_of_the_rates(tmp_path: Path) -> None:
    """Held at 2,500 ft/min above FL300; below, dh/dt = -(1500 + h - 100 levels x 5): a logarithm. Steps of a second."""
    flown = fly(read_tables(written(tmp_path))["MEDIUM"], PLAN)
    expected = 60 * (60 / 25 + 200 / 10 * np.log(2500 / 1500))
    assert flown["time_s"][-1] == pytest.approx(expected, abs=2.0)
    assert (flown["altitude"][0], flown["vertical_rate"][0]) == (36000.0, -2500.0)


def test_draws_follow_the_truncated_normal(tmp_path: Path) -> None:
    """Kolmogorov-Smirnov of 2,000 draws: a right sampler fails one run in 10,000, and the seed is fixed."""
    table, generator = read_tables(written(tmp_path, rocd_des=2500))["MEDIUM"], np.random.default_rng(3)
    rates = [float(drawn(table, SPREADS, generator).rate_fpm[0]) for _ in range(2000)]
    law = stats.truncnorm(-0.5, 0.5, loc=2500, scale=1000)
    assert stats.kstest(rates, law.cdf).pvalue > 1e-4
    slow = drawn(read_tables(written(tmp_path, rocd_des=100))["MEDIUM"], {}, generator)
    assert set(slow.rate_fpm) == {500.0}
