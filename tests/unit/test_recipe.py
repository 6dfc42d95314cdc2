"""Recipe for the owner of a simulator: nothing that cannot be entered, or that follows by itself."""

import pytest
import torch

from descentflow.diagnosis.findings._cause_found import Cause, ClosedShare, Closure
from descentflow.diagnosis.findings._sizes import sizes_of
from descentflow.diagnosis.inference._described import recipe_of
from descentflow.effects import EFFECTS

NOTHING = ClosedShare(None, None, None)


def cause(name: str, theta: list[float], error: list[float]) -> Cause:
    effect = EFFECTS[name]
    sizes = sizes_of(effect, torch.tensor(theta).double(), torch.tensor(error).double(), 400)
    return Cause(name, [], 1.0, {}, 50.0, Closure(NOTHING), label=effect.text, text=effect.text, sizes=sizes)


@pytest.mark.parametrize(
    ("name", "theta", "error", "entered"),
    [
        ("speed_brake", [0.36, 190.0, 265.0, 0.62, 0.2, 0, 0, 0], [0.02, 1, 1, 0.02, 0.05, 0, 0, 0], ["extra_cd0"]),
        ("vertical_rate_lag", [8.0, -0.3], [0.5, 0.05], ["lag_s"]),
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
    assert "noise" not in step.text
