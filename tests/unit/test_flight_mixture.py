"""The mixture of flights with and without brakes: its share, size and window."""

import numpy as np
import pytest
import torch

from descentflow.diagnosis.inference.flight_mixture import FlightWindows, fit_mixture, flight_windows
from descentflow.effects import EFFECTS
from descentflow.effects._example_flights import example_flights


def brakes_in(
    n: int, share: float, drag: float, window_fl: tuple[float, float] = (210.0, 260.0)
) -> tuple[np.ndarray, FlightWindows, np.ndarray]:
    """Flights, of which a share has brakes out between two levels of its own."""
    state = example_flights(n)
    effect = EFFECTS["speed_brake"]
    seen = np.ones((n, 11), dtype=bool)
    windows = flight_windows(effect, state, np.arange(11), seen)  # type: ignore[arg-type]
    rng = np.random.default_rng(5)
    has = np.arange(n) < share * n
    window = effect.within(state, *map(torch.tensor, window_fl))["rate"].numpy()  # type: ignore[attr-defined]
    values = 0.02 * rng.normal(size=(n, 11)) + has[:, None] * drag * window * windows.shape
    return values - values.mean(0), windows, has


def test_a_mixture_finds_the_share_size_and_window_of_brakes() -> None:
    values, windows, has = brakes_in(300, 0.4, 0.5)
    seen = np.ones(values.shape, dtype=bool)
    spread = 4e-4 * np.eye(11)
    mixture = fit_mixture(values, seen, spread, [], [windows], 25)
    without = fit_mixture(values, seen, spread, [], [], 1)
    assert mixture.log_likelihood > without.log_likelihood + 500
    assert mixture.shares["speed_brake"] == pytest.approx(0.4, abs=0.02)
    law = mixture.laws["speed_brake"]
    _, mean, _ = windows.effect.size(law.theta)
    assert mean == pytest.approx(0.5, rel=0.1)
    assert np.mean((mixture.normal < 0.5) == has) > 0.98
    low, high = law.theta[1:3].tolist()
    assert (low, high) == (pytest.approx(210, abs=8), pytest.approx(260, abs=8))
    # Of all sizes 1.2 times: the mean over all flights of the drag added.
    assert float(law.at(1.2)[0]) == pytest.approx(1.2 * float(law.at(1.0)[0]), rel=1e-6)


def test_windows_between_the_steps_of_the_first_grid_are_found() -> None:
    """About a law of one window the grid is finer, so that no step of it decides where brakes run out."""
    values, windows, _ = brakes_in(300, 0.4, 0.5, window_fl=(214.0, 257.0))
    seen, spread = np.ones(values.shape, dtype=bool), 4e-4 * np.eye(11)
    first = fit_mixture(values, seen, spread, [], [windows], 8).laws["speed_brake"].theta
    about = flight_windows(windows.effect, windows.state, np.arange(11), seen, first)
    law = fit_mixture(values, seen, spread, [], [about], 25).laws["speed_brake"]
    assert law.effect.grid_fl < EFFECTS["speed_brake"].grid_fl  # type: ignore[attr-defined]
    assert law.theta[1:3].tolist() == [pytest.approx(214, abs=2), pytest.approx(257, abs=2)]


def test_a_mixture_finds_nothing_in_normal_flights() -> None:
    values, windows, _ = brakes_in(300, 0.0, 0.5)
    mixture = fit_mixture(values, np.ones(values.shape, dtype=bool), 4e-4 * np.eye(11), [], [windows], 25)
    assert mixture.shares["speed_brake"] < 0.02
