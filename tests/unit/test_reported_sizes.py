"""Sizes as reported, in aviation units with intervals, and the recipe for the owner of a simulator."""

import math

import pytest
import torch

from descentflow.diagnosis.findings._sizes import NINETY, share_of, sizes_of
from descentflow.diagnosis.findings.cause_found import Cause, ClosedShare, Closure
from descentflow.diagnosis.inference._described import recipe_of
from descentflow.effects import EFFECTS


def test_brakes_are_told_as_the_flights_with_brakes_have_them() -> None:
    """The mean over all flights would be entered wrongly: 0.36 over all is 0.58 in the 62 % that have them."""
    brakes, theta = EFFECTS["speed_brake"], torch.tensor([0.3596, 190.0, 265.0, 0.62, 0.1, 0, 0, 0]).double()
    error = torch.tensor([0.01, 1.0, 1.0, 0.0, 0.02, 0, 0, 0]).double()
    drag, low, high, noise = sizes_of(brakes, theta, error, 400)
    assert drag.value.estimate == pytest.approx(1.58)
    assert (low.value.estimate, high.unit) == (190.0, "FL")
    assert noise.text.startswith("short-scale noise x 1.18")
    share = share_of(brakes, theta, error, 400)
    assert share is not None
    # The error of a share is that of a count of 400.
    assert share.high - share.estimate == pytest.approx(NINETY * math.sqrt(0.62 * 0.38 / 400))
    # The interval against 20,000 draws of both estimates: their ratio is not quite linear, hence a tenth.
    draws = torch.randn(20_000, 2, generator=torch.Generator().manual_seed(1)).double()
    ratio = (0.3596 + 0.01 * draws[:, 0]) / (0.62 + math.sqrt(0.62 * 0.38 / 400) * draws[:, 1])
    width = float(ratio.quantile(0.95) - ratio.quantile(0.05))
    assert drag.value.high - drag.value.low == pytest.approx(width, rel=0.1)


def test_wind_is_told_in_knots_per_thousand_feet() -> None:
    slope = 1.6 * 0.514444 / 304.8
    (size,) = sizes_of(EFFECTS["wind_gradient"], torch.tensor([slope]).double(), torch.tensor([slope / 10]).double(), 9)
    assert size.unit == "kt per 1,000 ft"
    assert size.value.estimate == pytest.approx(1.6)
    assert size.text == "tailwind +1.6 kt per 1,000 ft (+1.34 to +1.86)"


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
    sized = cause(name, theta, error)
    (step,) = recipe_of([sized], EFFECTS, (150, 350))
    assert [number.label for number in step.numbers] == entered
    noisy = any("noise" in size.text for size in sized.sizes)
    assert noisy
    assert "noise" not in step.text
