"""The window that explains most, against every window fitted by itself."""

import pytest
import torch

from descentflow.diagnosis.inference.example_sides import example_likelihood
from descentflow.diagnosis.inference.linear_algebra import solve
from descentflow.diagnosis.inference.search import fit_effects
from descentflow.diagnosis.inference.window_search import band_columns, best_window
from descentflow.effects import EFFECTS

BRAKES = EFFECTS["speed_brake"]
PLANTED = [0.4, 193.0, 247.0, 1.0, 0.0, 0.0, 0.0, 0.0]


def test_the_best_window_is_the_best_of_all_fitted_one_by_one() -> None:
    held = example_likelihood(BRAKES, PLANTED)
    bands = band_columns(held, BRAKES, 0.4, held.real_state)
    found = best_window(held, BRAKES, held.moments(held.qy, held.with_common(bands)), bands.shape[2], 0.4)

    def fitted(low: float, high: float) -> tuple[float, float]:
        """Gain and size of one window, by a regression on it alone."""
        ends = torch.tensor([low, high], dtype=torch.float64)
        column = bands @ BRAKES.within(held.compared.state, *ends)["rate"]
        design = held.with_common(column[:, :, None])
        information, gradient = held.moments(held.qy, design).profiled()
        information = information + torch.diag(design.ridge)
        step = solve(information, gradient, information.diagonal())
        without = solve(information[:-1, :-1], gradient[:-1], information.diagonal()[:-1])
        return 0.5 * float(gradient @ step - gradient[:-1] @ without), float(step[-1])

    gain, size = fitted(found.low_fl, found.high_fl)
    # The ridge of the normal equations is 1e-6 of them.
    assert found.gain == pytest.approx(gain, rel=1e-4)
    assert found.size == pytest.approx(size, rel=1e-4)
    beside = [fitted(low, high)[0] for low in range(155, 300, 12) for high in range(low + 26, 330, 12)]
    assert found.gain >= max(beside)
    assert (found.low_fl, found.high_fl) == pytest.approx((193.0, 247.0), abs=3.0)


@pytest.mark.parametrize(
    "start", [None, {"speed_brake": torch.tensor([0.1, 280.0, 330.0, 1.0, 0.0, 0.0, 0.0, 0.0]).double()}]
)
def test_a_fit_ends_in_the_same_window_wherever_it_starts(start: dict[str, torch.Tensor] | None) -> None:
    held = example_likelihood(BRAKES, PLANTED, n=150)
    found = fit_effects(held, ("speed_brake",), start).theta["speed_brake"]
    assert found[1:3].tolist() == pytest.approx(PLANTED[1:3], abs=2.0)
    # A share of one: the example's flights all have it.
    assert float(found[0]) == pytest.approx(0.4, abs=0.05)
