"""The evidence of a change, by a marginal likelihood computed otherwise and by chance; and the folder of a watch."""

from pathlib import Path

import numpy as np
import polars as pl
import pytest
from scipy.stats import binom

from descentflow.core.errors import ConfigError, DataError
from descentflow.watching.change_evidence import DRIFT_DAYS, SIZES, DayMeans, _of_quantity, evidence
from descentflow.watching.state import DAYS, State, WatchSettings

REFERENCE = 12
OURS = WatchSettings("flown", "abc", "A320", REFERENCE, 0.05)


def days(n: int, quantities: int, seed: int, step: float = 0.0, at: int = 0, slope: float = 0.0) -> DayMeans:
    """Means of days of unit variance, of which a fifth is between flights; the first quantity changes on a day."""
    generator = np.random.default_rng(seed)
    mean = generator.normal(size=(n, quantities))
    mean[:, 0] += step * (np.arange(n) >= at) + slope * np.maximum(np.arange(n) - at + 1.0, 0.0)
    return DayMeans(mean, np.full((n, quantities), 0.2))


@pytest.mark.parametrize(("shape", "size"), [(0, 0), (0, 1), (1, 1)])
def test_the_ratio_is_that_of_integrals_over_mean_and_change(shape: int, size: int) -> None:
    """By inverses and determinants of whole matrices, and an integral over sigma on a grid."""
    means = days(16, 1, seed=4, step=1.5, at=13)
    n, day = 16, 13
    log_ratio = _of_quantity(means.mean[:, 0], means.within[:, 0], REFERENCE)[shape, size, n - 1, day]

    known = means.mean[:REFERENCE, 0] - means.mean[:REFERENCE, 0].mean()
    between = max(known.var(ddof=1) - 0.2, 0.0)
    serial = (known[1:] * known[:-1]).sum() / (known**2).sum() + 1 / REFERENCE + 0.5 * REFERENCE**-0.5
    serial = min(max(serial, 0.0), 0.7)
    apart = np.abs(np.arange(n)[:, None] - np.arange(n)[None, :])
    base = between * serial**apart + 0.2 * np.eye(n)
    moved = np.maximum(np.arange(n) - day + 1.0, 0.0)
    moved = (moved > 0).astype(float) if shape == 0 else moved / DRIFT_DAYS
    changed = base + SIZES[size] ** 2 * (between + 0.2) * np.outer(moved, moved)

    def marginal(covariance: np.ndarray) -> float:
        scale = np.geomspace(0.02, 50.0, 4000)
        inverse, ones = np.linalg.inv(covariance), np.ones(n)
        a = ones @ inverse @ ones
        rest = means.mean[:, 0] - (ones @ inverse @ means.mean[:, 0]) / a
        squares = rest @ inverse @ rest
        _, log_det = np.linalg.slogdet(covariance)
        # The integral over the mean under a flat prior; the one over sigma numerically, by its logarithm.
        logs = -0.5 * log_det - 0.5 * np.log(a) - (n - 1) * np.log(scale) - squares / (2 * scale**2)
        return float(np.logaddexp.reduce(logs))

    assert log_ratio == pytest.approx(marginal(changed) - marginal(base), abs=1e-3)


def test_streams_without_a_change_raise_an_alarm_in_less_than_a_share_alpha() -> None:
    count, alpha = 200, 0.2
    alarms = sum(evidence(days(50, 4, seed), REFERENCE).first_alarm(alpha) is not None for seed in range(count))
    # More than this, with a chance of one in a million, were the rate as high as alpha.
    assert alarms <= binom.ppf(1 - 1e-6, count, alpha)


def test_a_step_is_found_dated_and_told_from_a_drift() -> None:
    step = evidence(days(60, 4, seed=1, step=4.0, at=30), REFERENCE)
    alarm = step.first_alarm(0.05)
    assert alarm is not None
    assert 30 <= alarm <= 40
    likeliest, first, last = step.dates(59)
    assert abs(likeliest - 30) <= 1
    assert first <= 30 <= last
    assert step.shape[59].argmax() == 0
    assert step.quantity[59].argmax() == 0
    drift = evidence(days(60, 4, seed=2, slope=0.35, at=30), REFERENCE)
    assert drift.shape[59].argmax() == 1


def test_days_that_show_nothing_leave_the_evidence_as_it_was() -> None:
    whole = days(40, 2, seed=3, step=3.0, at=25)
    gaps = DayMeans(whole.mean.copy(), whole.within)
    gaps.mean[30:33] = np.nan
    with_gaps = evidence(gaps, REFERENCE)
    assert np.isfinite(with_gaps.log_e).all()
    # A change in the gap looks like one on the next day that is seen.
    assert with_gaps.dates(39)[0] in range(24, 28)


def test_a_quantity_of_a_short_reference_says_nothing() -> None:
    few = days(30, 1, seed=5, step=9.0, at=20)
    few.mean[: REFERENCE - 6] = np.nan
    assert np.abs(evidence(few, REFERENCE).log_e).max() < 0.1


def test_one_run_holds_a_folder(tmp_path: Path) -> None:
    state = State(tmp_path / "watched")
    with state.locked(), pytest.raises(DataError, match="another watch"), State(tmp_path / "watched").locked():
        pass


def test_a_folder_is_of_one_simulator_and_one_setting(tmp_path: Path) -> None:
    state = State(tmp_path)
    state.begin(OURS)
    assert state.begin(OURS) == OURS
    with pytest.raises(ConfigError, match="fingerprint abc"):
        state.begin(WatchSettings("flown", "other", "A320", REFERENCE, 0.05))


def test_days_come_in_any_order_and_give_the_same_bytes(tmp_path: Path) -> None:
    lines = [
        {
            "day": f"2024-03-{k:02d}",
            "file": f"{k}",
            "file_bytes": k,
            "fingerprint": "x",
            "flights": k,
            "rate: mean": None,
        }
        for k in range(1, 6)
    ]
    for name, order in (("first", lines), ("second", lines[::-1])):
        (tmp_path / name).mkdir()
        for line in order:
            State(tmp_path / name).add([line])
    assert (tmp_path / "first" / DAYS).read_bytes() == (tmp_path / "second" / DAYS).read_bytes()
    assert State(tmp_path / "first").days()["day"].is_sorted()


def test_an_accepted_change_stands_no_more_even_after_a_kill(tmp_path: Path) -> None:
    state = State(tmp_path)
    state.begin(OURS)
    alarm = {"change": {"day": "2024-03-20"}}
    state.keep_alarm(alarm)
    assert state.alarm() == alarm
    state.accept()
    assert state.settings is not None
    assert state.settings.since == "2024-03-20"
    assert state.alarm() is None
    state.keep_alarm(alarm)  # as if killed before the file was removed
    assert state.alarm() is None
    with pytest.raises(ConfigError, match="without an alarm"):
        state.accept()


@pytest.mark.parametrize("content", ["{", "[]", '{"version": 9}', '{"version": 1, "simulator": "x"}'])
def test_a_damaged_folder_is_refused(tmp_path: Path, content: str) -> None:
    (tmp_path / "watch.json").write_text(content)
    with pytest.raises(DataError):
        _ = State(tmp_path).settings
    assert isinstance(State(tmp_path).days(), pl.DataFrame)
