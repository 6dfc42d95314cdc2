"""Numbers of the surveillance part against other implementations."""

from collections.abc import Callable

import numpy as np
import pytest
import torch

from descentflow.physics.airspeed import mach_to_cas_mps, mach_to_tas_mps
from descentflow.surveillance.cleaning.rates import ALTITUDE_ERROR_FT, RATE_ERROR_FPM, RATE_WINDOWS_S, local_slope
from descentflow.surveillance.rows.air_data import cas_of_mach_kt, isa_tas_of_mach_kt


@pytest.mark.parametrize(("ours", "theirs"), [(cas_of_mach_kt, mach_to_cas_mps), (isa_tas_of_mach_kt, mach_to_tas_mps)])
def test_speeds_of_mach_are_those_of_the_performance_model(ours: Callable, theirs: Callable) -> None:
    mach, altitude_ft = (a.ravel() for a in np.meshgrid(np.linspace(0.1, 0.95, 30), np.linspace(-1000, 45_000, 47)))
    expected = theirs(torch.tensor(mach), torch.tensor(altitude_ft * 0.3048)) / 0.514444
    # 1e-6: the two round a0 differently (340.294 m/s against sqrt(gamma R T0)).
    np.testing.assert_allclose(ours(mach, altitude_ft), expected.numpy(), rtol=1e-6)


def test_local_slopes_are_those_of_polyfit_in_the_same_window() -> None:
    generator = np.random.default_rng(5)
    flight = np.repeat([0, 1, 2], 60)
    seconds = np.concatenate([np.cumsum(generator.exponential(scale, 60)) for scale in (0.8, 3.0, 9.0)])
    values = 30_000 - 30 * seconds + generator.normal(0, 10, len(seconds))
    slopes = local_slope(flight, seconds, values)
    expected = np.full(len(values), np.nan)
    for row in range(len(values)):
        for half in RATE_WINDOWS_S:
            near = (flight == flight[row]) & (np.abs(seconds - seconds[row]) <= half)
            # The slope's standard error is that of one altitude over the root of the sum of squares of time.
            error_fpm = 60 * ALTITUDE_ERROR_FT / max(np.std(seconds[near]) * near.sum() ** 0.5, 1e-9)
            if error_fpm <= RATE_ERROR_FPM:
                expected[row] = np.polyfit(seconds[near] - seconds[row], values[near], 1)[0]
                break
    assert np.isfinite(expected).sum() > 150
    np.testing.assert_allclose(slopes, expected, rtol=1e-7)
