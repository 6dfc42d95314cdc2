"""What the owner of a simulator is told to enter: nothing that cannot be, or that follows by itself."""

from dataclasses import replace

import finding_toys
import pytest
import torch

from descentflow.diagnosis.correction.recipe import recipe_of
from descentflow.diagnosis.findings.cause_found import Cause, ClosedShare, Closure, Heterogeneity, ScoreGain
from descentflow.diagnosis.inference.example_sides import example_likelihood
from descentflow.diagnosis.inference.search import fit_effects
from descentflow.diagnosis.inference.selection import Chosen, Outside, every_single
from descentflow.diagnosis.report.cause_section import cause_section
from descentflow.diagnosis.report.details import singles_of
from descentflow.diagnosis.report.sizes import sizes_of
from descentflow.effects import EFFECTS

NOTHING = ClosedShare(None, None, None)


def cause(name: str, theta: list[float], error: list[float]) -> Cause:
    effect = EFFECTS[name]
    sizes = sizes_of(effect, torch.tensor(theta).double(), torch.tensor(error).double(), 400)
    closure = Closure(NOTHING, NOTHING, NOTHING)
    score = ScoreGain(50.0, 40.0, 60.0)
    law = Heterogeneity(effect.heterogeneity, 0.0)
    return Cause(name, [], 1.0, {}, score, law, closure, [], label=effect.text, text=effect.text, sizes=sizes)


@pytest.mark.parametrize(
    ("name", "theta", "error", "entered"),
    [
        ("speed_brake", [0.36, 190.0, 265.0, 0.62, 0.2, 0, 0, 0], [0.02, 1, 1, 0.02, 0.05, 0, 0, 0], ["extra_cd0"]),
        ("vertical_rate_lag", [8.0, -0.3], [0.5, 0.05], ["lag_s"]),
        ("measurement_noise", [0.0, 0.7, 0, 0, 0, 0], [0.0, 0.1, 0, 0, 0, 0], ["ln_ratio_cas"]),
    ],
)
def test_noise_that_an_effect_makes_of_itself_is_told_and_not_entered(
    name: str, theta: list[float], error: list[float], entered: list[str]
) -> None:
    found = cause(name, theta, error)
    (step,) = recipe_of([found], EFFECTS, (150, 350))
    assert [number.label for number in step.numbers] == entered
    noisy = any("noise" in size.text for size in found.sizes)
    assert noisy
    assert ("noise" in step.text) is (name == "measurement_noise")


def test_engines_that_pull_backwards_are_refused_and_the_page_says_why() -> None:
    """Rates a tenth steeper at every level: more than no thrust at all would give with these coefficients."""
    likelihood = example_likelihood(EFFECTS["drag_polar"], [0.2], n=120)
    null = fit_effects(likelihood, ())
    only = {"idle_thrust": fit_effects(likelihood, ("idle_thrust",))}
    assert float(only["idle_thrust"].theta["idle_thrust"][0]) == pytest.approx(-1.0, abs=1e-6)
    singles = every_single(likelihood, null, lambda stage: None)
    chosen = Chosen(null, Outside(0.0, 0.0, 0.0, False), singles, null, {}, {}, {})
    found = {single.effect: single.refused for single in singles_of(likelihood, chosen)}
    assert found["idle_thrust"] == "idle thrust x 0.00 is the limit of what is possible"
    assert found["drag_polar"] == ""
    rows = [single for single in singles_of(likelihood, chosen) if single.effect == "idle_thrust"]
    details = replace(finding_toys.details(), singles=rows)
    page = "".join(cause_section(replace(finding_toys.findings(), details=details)))
    assert "idle thrust (idle thrust x 0.00 is the limit of what is possible)" in page
