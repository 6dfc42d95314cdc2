"""Limits, tests of equivalence and deviations, against closed forms, chance and flights of known truth."""

from pathlib import Path

import numpy as np
import pytest
from scipy.stats import binom
from scipy.stats import t as student

from descentflow.core.errors import ConfigError
from descentflow.qualification.equivalence import MeanOfFlights, judge, mean_of
from descentflow.qualification.limits import Limit, read_limits

NO_FLIGHTS = MeanOfFlights(0.0, 0.0, 0, 0)


def test_the_mean_of_independent_flights_has_the_variance_of_the_textbook() -> None:
    values = np.random.default_rng(0).normal(size=40)
    mean = mean_of(values, np.arange(40), np.arange(40))
    assert mean.variance == pytest.approx(values.var(ddof=1) / 40)
    assert mean.freedom == 39


def test_flights_of_one_aircraft_and_of_one_day_count_once() -> None:
    """Four copies of each value, all of an aircraft, say no more than one; the same by day."""
    values, alone = np.random.default_rng(1).normal(size=30), np.arange(30)
    once = mean_of(values, alone, np.zeros(30, dtype=int))
    four = mean_of(np.repeat(values, 4), np.repeat(alone, 4), np.zeros(120, dtype=int))
    by_day = mean_of(np.repeat(values, 4), np.arange(120), np.repeat(alone, 4))
    assert four.variance == pytest.approx(once.variance)
    assert by_day.variance == pytest.approx(once.variance)
    assert by_day.freedom == once.freedom == 29


def test_the_parts_of_aircraft_and_days_add() -> None:
    """Of a balanced table of independent aircraft and days, E[V] is the sum of both variances of the mean."""
    generator = np.random.default_rng(2)
    aircraft, day = (index.reshape(-1) for index in np.indices((40, 40)))
    variances = []
    for _ in range(200):
        by_aircraft, by_day = generator.normal(size=40), 2.0 * generator.normal(size=40)
        variances.append(mean_of(by_aircraft[aircraft] + by_day[day], aircraft, day).variance)
    # 200 draws of a variance with 39 degrees of freedom: its mean is known to 1.6 %, four of which are allowed.
    assert np.mean(variances) == pytest.approx((1.0 + 4.0) / 40, rel=0.064)


@pytest.mark.parametrize("truth", [1.0, -1.0])
def test_a_mean_at_the_limit_is_called_inside_in_five_of_a_hundred(truth: float) -> None:
    generator, count = np.random.default_rng(3), 2000
    called = 0
    for _ in range(count):
        values = truth + generator.normal(size=20)
        own = np.arange(20)
        called += judge(mean_of(values, own, own), NO_FLIGHTS, 1.0).verdict == "inside"
    # Beyond these with a chance of one in a million were the rate 5 %.
    low, high = binom.ppf([5e-7, 1 - 5e-7], count, 0.05)
    assert low <= called <= high


def test_a_mean_beyond_the_limit_is_outside_and_many_judgements_ask_more() -> None:
    real = MeanOfFlights(1.25, 0.01, 30, 31)
    assert judge(real, NO_FLIGHTS, 1.0).verdict == "outside"
    assert judge(real, NO_FLIGHTS, 1.0, tests=20).verdict == "not enough flights"


def test_as_many_more_flights_as_are_named_decide() -> None:
    real = MeanOfFlights(0.5, 0.09, 99, 100)
    count = judge(real, NO_FLIGHTS, 1.0 - 1e-9).more_flights
    times = (100 + (count or 0)) / 100
    half = student.ppf(0.95, 99 * times) * (0.09 / times) ** 0.5
    assert half == pytest.approx(0.5, rel=0.01)


def test_a_mean_at_its_limit_and_few_simulated_flights_are_said() -> None:
    at_limit = judge(MeanOfFlights(1.0, 0.01, 30, 31), NO_FLIGHTS, 1.0)
    few = judge(MeanOfFlights(0.5, 0.01, 30, 31), MeanOfFlights(0.0, 1.0, 5, 6), 1.0)
    assert (at_limit.more_flights, at_limit.decides) == (None, "no number, the mean is at its limit")
    assert (few.more_flights, few.decides) == (None, "73 more simulated flights")
    # By hand: a half-width of 0.5, 30 degrees of freedom, the fewer.
    assert [student.ppf(0.95, 30) * (0.01 + 6 / n) ** 0.5 <= 0.5 for n in (78, 79)] == [False, True]
    both = judge(MeanOfFlights(0.5, 0.1, 30, 31), MeanOfFlights(0.0, 0.1, 30, 31), 1.0)
    assert (both.more_flights, both.decides) == (None, "39 real and 39 simulated more")


def test_one_aircraft_decides_nothing() -> None:
    alone = mean_of(np.array([0.1, 0.2]), np.zeros(2, dtype=int), np.arange(2))
    assert judge(alone, NO_FLIGHTS, 5.0).verdict == "not enough flights"


def test_the_published_limits() -> None:
    """14 CFR Part 60, Table A2A, 1.d.4: 3 kt, and 5 % or 200 ft/min."""
    airspeed, rate = read_limits("part60").limits
    assert (airspeed.absolute, rate.absolute, rate.relative) == (3.0, 200.0, 0.05)
    assert airspeed.width(280.0) == 3.0
    assert [rate.width(2000.0), rate.width(6000.0)] == [200.0, pytest.approx(300.0)]


def test_look_ahead_judges_nothing_until_a_limit_is_given() -> None:
    limits = read_limits("look_ahead")
    assert limits.minutes == [5.0, 10.0, 20.0]
    assert {limit.width(1.0) for limit in limits.limits} == {None}


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("limits: []", "with limits"),
        ("limits:\n- {quantity: drag, absolute: 3}", "drag"),
        ("limits:\n- {quantity: rate, absolute: -3}", "absolute"),
        ("limits:\n- {quantity: rate, absolut: 3}", "absolut"),
        ("limits:\n- {quantity: time_ahead, absolute: 3}", "without minutes"),
        ("limits:\n- {quantity: rate, minutes: 5}", "with minutes"),
        ("limits:\n- {quantity: rate, absolute: 3, levels: [240, 100]}", "levels"),
        ("limits:\n- {quantity: top_of_descent, relative: 0.1}", "relative"),
        ("limit:\n- {quantity: rate}", "with limit"),
        ("sources: x\nlimits:\n- {quantity: rate, absolute: 3}", "sources"),
    ],
)
def test_limits_that_cannot_be_read_are_refused_by_name(tmp_path: Path, text: str, named: str) -> None:
    path = tmp_path / "ours.yaml"
    path.write_text(text)
    with pytest.raises(ConfigError, match=named):
        read_limits(path)


def test_limits_of_no_such_name_are_refused_with_those_that_there_are() -> None:
    with pytest.raises(ConfigError, match="look_ahead, part60"):
        read_limits("part61")


def test_a_limit_holds_in_its_own_levels() -> None:
    limit = Limit("rate", 200.0, levels=(100.0, 240.0))
    assert limit.holds_at(100.0, 110.0)
    assert not limit.holds_at(235.0, 245.0)
