r"""The window of altitude in which an effect explains most, among all of them at once.

A flight that has a windowed effect of size a in a whole band b shows :math:`a\,g_{ib}` there (the secant of its
change), and in a window the share :math:`v_b` of that. With information :math:`I` and gradient :math:`h` of one
coefficient a band, all else profiled out, a window of weights :math:`v` gains

.. math:: \tfrac12\,\frac{(v^\top h)_+^2}{v^\top I\,v}, \qquad a = \frac{v^\top h}{v^\top I\,v}.

Weights are differences of cumulative shares, :math:`v = c(\mathrm{high}) - c(\mathrm{low})`, so numerator and
denominator of every pair of ends are sums and differences of one table of ends: no window is fitted by itself.
"""

from dataclasses import dataclass

import torch
from torch import Tensor

from descentflow.diagnosis.inference.effect_shifts import EffectShifts
from descentflow.diagnosis.inference.linear_algebra import Moments, solve
from descentflow.effects.flight_state import FlightState
from descentflow.effects.windowed_effect import WindowedEffect

STEP_FL = 0.5
"""Ends of windows are tried in steps of so much: less than an aircraft needs to answer."""
FIRST_SIZE = 0.3
"""At which the first secants are taken; they are taken again at what is found."""
SECANTS = 3
"""Times that they are taken: the change is close to linear in the size."""
NO_INFORMATION = 1e-12
"""Of a window that no flight was seen in."""


@dataclass(frozen=True)
class Window:
    """A window with what it gains (nats) at the best size.

    Example:
        >>> Window(200.0, 240.0, size=0.4, gain=120.0).high_fl
        240.0
    """

    low_fl: float
    high_fl: float
    size: float
    gain: float


def band_columns(shifts: EffectShifts, effect: WindowedEffect, size: float, state: FlightState) -> Tensor:
    """Secants (n, p, s) of flights' changes at a size, one column for each band of each quantity that shows it.

    Args:
        shifts: What is compared.
        effect: That is windowed.
        size: At which the secants are taken.
        state: The n flights.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_likelihood
        >>> from descentflow.effects import EFFECTS
        >>> likelihood = example_likelihood(EFFECTS["temperature"], [10.0])
        >>> brakes, state = EFFECTS["speed_brake"], likelihood.real_state
        >>> band_columns(likelihood, brakes, 0.3, state).shape  # 11 bands of the rate among 33 entries
        torch.Size([80, 33, 11])
    """
    entries = shifts.compared.entries
    change = effect.whole_change(state, torch.tensor(size, dtype=torch.float64)) / size
    bands = len(state.altitude_m)
    shown = list(effect.below(state, torch.zeros(1, dtype=torch.float64)))
    columns = torch.zeros(len(change), len(entries), bands * len(shown), dtype=shifts.y.dtype)
    for at, entry in enumerate(entries):
        if entry.quantity in shown:
            columns[:, at, shown.index(entry.quantity) * bands + entry.band] = change[:, entry.band]
    return columns


def best_window(shifts: EffectShifts, effect: WindowedEffect, moments: Moments, n_bands: int, size: float) -> Window:
    """The window of the largest gain.

    Args:
        shifts: Of the flights.
        effect: Whose window it is.
        moments: Of columns whose last ``n_bands`` are :func:`band_columns`.
        n_bands: How many these are.
        size: At which they were taken.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_likelihood
        >>> from descentflow.effects import EFFECTS
        >>> brakes = EFFECTS["speed_brake"]
        >>> likelihood = example_likelihood(brakes, [0.3, 200, 240, 1, 0, 0, 0, 0])
        >>> moments = likelihood.moments(likelihood.qy, likelihood.at_start("speed_brake"))
        >>> found = best_window(likelihood, brakes, moments, 11, 0.3)
        >>> round(found.low_fl), round(found.high_fl)
        (200, 240)
    """
    information, gradient = _of_bands(moments, n_bands)
    low_fl, high_fl = effect.range_fl(shifts.compared.state)
    inset = effect.inset_fl / 2
    ends = torch.arange(low_fl - inset, high_fl + inset + STEP_FL, STEP_FL, dtype=torch.float64)
    below = torch.cat(list(effect.below(shifts.compared.state, ends).values()), 1)
    table, slope = below @ information @ below.T, below @ gradient
    own = table.diagonal()
    # Rows are lower ends and columns upper ones.
    explained = (slope - slope[:, None]).clamp(min=0.0)
    weight = own + own[:, None] - 2 * table
    height = ends - ends[:, None] + effect.inset_fl
    allowed = (height >= effect.narrowest_fl) & (height <= effect.longest_fl(shifts.compared.state))
    gain = torch.where(allowed & (weight > NO_INFORMATION), 0.5 * explained**2 / weight, 0.0)
    at = int(gain.argmax())
    low, high = divmod(at, len(ends))
    found = size if float(gain.max()) == 0.0 else float(explained[low, high] / weight[low, high])
    return Window(float(ends[low]) - inset, float(ends[high]) + inset, found, float(gain.max()))


def _of_bands(moments: Moments, n_bands: int) -> tuple[Tensor, Tensor]:
    """Information (s, s) and gradient (s,) of the last columns, with all others at their best."""
    whole, gradient = moments.profiled()
    whole = whole + torch.diag(moments.ridge)
    n = len(whole) - n_bands
    other, cross, raw = whole[:n, :n], whole[:n, n:], moments.curvature.diagonal()[:n]
    solved = torch.stack([solve(other, column, raw) for column in torch.cat([gradient[:n, None], cross], 1).T], 1)
    return whole[n:, n:] - cross.T @ solved[:, 1:], gradient[n:] - cross.T @ solved[:, 0]
