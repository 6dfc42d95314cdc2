"""Samples judged by folds of aircraft: scores against closed forms, and a fleet of known truth to the end."""

from statistics import NormalDist

import numpy as np
import pytest

import descentflow as df
from benchmarks import real_fidelity
from benchmarks.fidelity_vectors import Vectors
from benchmarks.real_fidelity import BASELINE, BOTTOM_FL, Scores, judge, longest, pooled, scored, shown_by_some


def test_scores_of_normal_times_are_those_of_the_closed_forms() -> None:
    """CRPS of a normal (Gneiting and Raftery 2007, equation 21); the log density is widened by its kernel."""
    times = np.random.default_rng(0).normal(600.0, 30.0, 40_000)
    for off in (0.0, 1.0, -2.5):
        crps, log_score, held = scored(times, 600.0 + 30.0 * off)
        normal = NormalDist()
        expected = 30 * (off * (2 * normal.cdf(off) - 1) + 2 * normal.pdf(off) - np.pi**-0.5)
        assert crps == pytest.approx(100 * expected / (600.0 + 30.0 * off), rel=0.03)
        assert log_score == pytest.approx(np.log(20.0 * normal.pdf(off)), abs=0.3)
        assert held == float(abs(off) < 1.645)


def test_one_time_has_its_error_for_a_score() -> None:
    crps, log_score, held = scored(np.array([550.0]), 500.0)
    assert crps == pytest.approx(10.0)
    assert np.isnan(log_score)
    assert np.isnan(held)
    assert np.isnan(scored(np.array([]), 500.0)).all()


def test_a_flight_is_judged_by_its_longest_stretch() -> None:
    assert longest(np.array([True, True, False, True, True, True, False, True])).tolist() == [3, 4, 5]
    assert longest(np.zeros(5, dtype=bool)).tolist() == []


def test_bins_that_one_flight_shows_are_left_out_at_the_top() -> None:
    log_s = np.array([[4.0, np.nan, 4.0], [4.0, 4.0, np.nan], [4.0, 4.0, np.nan]])
    cut = shown_by_some(Vectors(np.arange(100.0, 140.0, 10.0), np.full((3, 4), 280.0), log_s, np.full(3, 130.0)))
    assert cut.edges_fl.tolist() == [100.0, 110.0, 120.0]
    assert cut.log_s.shape == (3, 2)
    assert cut.cas_kt.shape == (3, 3)


def test_a_fleet_is_judged_by_models_of_its_other_aircraft(monkeypatch: pytest.MonkeyPatch) -> None:
    """Flights of one law: the Gaussian's CRPS is near the bootstrap's, WRAP's is no number of ours, all are judged."""
    pytest.importorskip("openap", reason="pip install '.[openap]'")
    for name, value in {"FOLDS": 2, "DRAWS": 200, "WRAP_DRAWS": 3}.items():
        monkeypatch.setattr(real_fidelity, name, value)
    fleet = pooled({"world": df.prepare(df.simulate("A320", 40, seed=3), bottom_fl=BOTTOM_FL)}, "A320", ("A320",))
    scores: Scores = {}
    judge(fleet, "A320", ("gaussian",), 0, scores, ask_node_fdm=False)
    assert set(scores) == {"gaussian", BASELINE, "OpenAP's WRAP"}
    assert len(scores["gaussian"]) > 30
    assert all(len(found) == 1 for found in scores["gaussian"].values())
    mean = {name: np.nanmean([found[0][0] for found in of.values()]) for name, of in scores.items()}
    assert 0.75 < mean["gaussian"] / mean[BASELINE] < 1.33
    assert mean["OpenAP's WRAP"] > mean[BASELINE]
