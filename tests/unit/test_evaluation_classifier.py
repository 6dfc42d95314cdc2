"""The classifier's AUC: its arithmetic, its coverage for flights against flights, and that it names what is wrong."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from scipy.stats import binomtest
from sklearn.metrics import roc_auc_score

from descentflow.core.units import FPM_MPS
from descentflow.evaluation.metrics.classifier import MIN_PAIRS, SETTINGS, contributions, detect
from descentflow.evaluation.metrics.descent_set import DescentSet
from descentflow.evaluation.metrics.scores import score

LEVELS = torch.arange(200, 360, 10, dtype=torch.float64)


def descents(n: int, seed: int, *, gaps: float = 0.0) -> DescentSet:
    """Smooth random descents with random entries; a share of the levels is not observed."""
    generator = torch.Generator().manual_seed(seed)
    across = torch.linspace(-1, 1, len(LEVELS)).double()
    offset, slope, pace, bend = torch.randn(4, n, 1, generator=generator).double()
    cas = 140 + 8 * offset + 4 * slope * across
    rate = -10 + pace + 0.5 * bend * across.square() + 0.1 * torch.randn(n, len(LEVELS), generator=generator).double()
    time = torch.zeros_like(cas)
    entry = torch.randint(8, len(LEVELS) + 4, (n, 1), generator=generator)
    mask = torch.arange(len(LEVELS)) <= entry
    mask &= torch.rand(n, len(LEVELS), generator=generator) >= gaps
    return DescentSet(LEVELS, time, cas, rate, time, mask)


@pytest.fixture
def _few_trees(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(SETTINGS, "max_iter", 10)


def test_the_mean_of_the_contributions_is_scikit_learns_auc() -> None:
    generator = np.random.default_rng(0)
    real, fake = generator.normal(0.5, size=80).round(1), generator.normal(size=80).round(1)
    each, auc = contributions(real, fake)
    expected = roc_auc_score(np.repeat([1, 0], 80), np.concatenate([real, fake]))
    assert auc == pytest.approx(expected, rel=1e-12)
    assert each.mean() == pytest.approx(expected, rel=1e-12)


@pytest.mark.usefixtures("_few_trees")
def test_intervals_cover_one_half_for_flights_against_flights() -> None:
    judged = [detect(descents(70, 2 * k), descents(60, 2 * k + 1, gaps=0.2), seed=k, explain=False) for k in range(100)]
    covered = sum(low <= 0.5 <= high for low, high in (detection.interval for detection in judged))
    # Seeds are fixed; were they not, 90 % intervals would fail this once in a thousand runs.
    assert binomtest(covered, len(judged), 0.9).pvalue > 0.001
    aucs = torch.tensor([detection.auc for detection in judged])
    # Nor may it lean to one side: four standard errors, once in 16,000 runs.
    assert float(aucs.mean()) == pytest.approx(0.5, abs=4 * float(aucs.std()) / len(judged) ** 0.5)


def test_levels_that_hardly_a_pair_shows_do_no_harm() -> None:
    samples, real = descents(60, 1), descents(60, 2)
    mask = real.mask.clone()
    mask[:, -1] = False
    mask[1:, -2] = False
    constant = samples.cas_mps.clone()
    constant[:, 0] = 120.0
    both = replace(samples, cas_mps=constant), replace(real, mask=mask, cas_mps=constant)
    assert 0 < detect(*both).auc < 1
    flat = replace(real, cas_mps=constant[:1].expand(60, -1) * 0, rate_mps=constant * 0)
    assert detect(flat, flat).auc == 0.5


def test_it_looks_where_the_samples_are_wrong() -> None:
    samples, real = descents(400, 1), descents(300, 2)
    wrong = samples.rate_mps.clone()
    wrong[:, 4:6] -= 400 * FPM_MPS  # FL240 and FL250
    detection = detect(replace(samples, rate_mps=wrong), real)
    assert detection.auc > 0.9
    first = detection.most_looked_at()[0]
    assert (first.quantity, first.low_fl, first.high_fl) == ("rate", 240.0, 250.0)
    cas, rate = detection.importance[:2]
    assert rate.loss > 0.3
    assert abs(cas.loss) < 0.05
    assert "rate FL240-250" in str(detection)


def test_a_wrong_dependence_is_seen_by_the_joint_scores_alone() -> None:
    """Each quantity keeps its profiles, but CAS and rate of a flight no longer belong together."""
    whole = [replace(one, mask=torch.ones_like(one.mask)) for one in (descents(300, 1), descents(300, 2))]
    together = [replace(one, rate_mps=one.rate_mps - 0.3 * (one.cas_mps - 140)) for one in whole]
    shuffled = replace(together[1], rate_mps=together[1].rate_mps.roll(1, 0))
    right, wrong = (score(one, together[0], 250.0, n_splits=10, costly=True) for one in (together[1], shuffled))
    for quantity in ("cas_profile", "rocd_profile"):
        one, two = (table.get(quantity, "energy") for table in (right, wrong))
        # The same profiles; the pairs of samples whose differences are averaged are others.
        assert two.score == pytest.approx(one.score, rel=0.03)
    assert wrong.get("descent", "joint_energy").score > 1.01 * right.get("descent", "joint_energy").score
    assert wrong.get("descent", "auc").score > right.get("descent", "auc").score + 0.1
    assert wrong.get("descent", "auc").floor == pytest.approx(0.5, abs=0.1)


def test_too_few_flights_are_not_judged_and_the_table_says_so() -> None:
    row = score(descents(90, 1), descents(MIN_PAIRS - 1, 2), 250.0, n_splits=2, costly=True).get("descent", "auc")
    assert np.isnan(row.score)
    assert row.note == "fewer than 25 flights"
    row = score(descents(90, 1), descents(2 * MIN_PAIRS - 2, 2), 250.0, n_splits=2, costly=True).get("descent", "auc")
    assert 0 < row.score < 1
    assert row.note == "no noise floor: fewer than 25 flights on each side"
