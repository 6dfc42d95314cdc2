"""Which effects could stand for a named one, and how often that one explains best."""

from dataclasses import replace

import torch

from descentflow.diagnosis.inference.alike_effects import alike
from descentflow.diagnosis.inference.example_sides import example_likelihood
from descentflow.diagnosis.inference.search import fit_effects
from descentflow.effects import EFFECTS


def test_a_few_odd_flights_do_not_win_against_what_all_flights_say() -> None:
    """A rival that gains 400 nats in two flights of 160, so 1.4 standard errors, could not be named itself."""
    likelihood = example_likelihood(EFFECTS["temperature"], [2.0])
    null, fit, other = (fit_effects(likelihood, names) for names in ((), ("temperature",), ("mass",)))
    odd = torch.zeros(160, dtype=torch.float64)
    odd[:2] = 200.0
    rival = replace(other, log_score=null.log_score + odd)
    gain, error = likelihood.gain(rival.log_score, null.log_score)
    assert likelihood.gain(fit.log_score, null.log_score)[0] < gain < 2 * error
    group, probability = alike(likelihood, fit, {"mass": rival}, null)
    assert group == ("mass",)
    assert probability == 1.0


def test_effects_that_explain_alike_win_as_often() -> None:
    """A rival whose scores differ by noise alone: one half, to five standard errors of the lead's own noise."""
    likelihood = example_likelihood(EFFECTS["temperature"], [2.0])
    null, fit, other = (fit_effects(likelihood, names) for names in ((), ("temperature",), ("mass",)))
    noise = torch.randn(160, generator=torch.Generator().manual_seed(0), dtype=torch.float64)
    rival = replace(other, log_score=fit.log_score + noise - noise.mean())
    group, probability = alike(likelihood, fit, {"mass": rival}, null)
    assert group == ("mass",)
    # Of 2,000 fleets.
    assert abs(probability - 0.5) < 5 * 0.5 / 2000**0.5
