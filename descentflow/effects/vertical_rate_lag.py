"""Vertical rate reported late: smoothing in the transponder's sources."""

import math

import torch
from torch import Tensor

from descentflow.core.units import FPM_MPS
from descentflow.effects.effect import Effect, Parameter, Shift
from descentflow.effects.flight_state import FlightState

LEAST_LAG_S = 3.0
"""Transponders smooth the rates that they report over some three seconds anyway: less is no cause, s."""

MOST_BEYOND = 0.5
"""Share of a reported rate that is not flown, at the most: a fit on its way may ask for lags beyond all sense."""


class VerticalRateLag(Effect):
    """The rate reported is that of some seconds ago, of a greater height.

    Just below the top it is that of level flight: those levels are not compared. Smoothing, which makes it late, makes
    it less noisy too.

    Example:
        >>> from descentflow.effects._example_flights import example_flights
        >>> shift = VerticalRateLag().shift(example_flights(), torch.tensor([8.0, 0.0]))
        >>> bool(torch.equal(shift["rate"], shift["lag"]))  # reported late, and not flown otherwise
        True
    """

    name = "vertical_rate_lag"
    description = "vertical rates reported late"
    directions = ("vertical rates reported late", "vertical rates reported early")
    against = (
        "vertical rates reported later than in the simulator's flights",
        "vertical rates reported earlier than in the simulator's flights",
    )
    inherited_from = 6.0
    parameters = (
        Parameter("lag_s", -10.0, 60.0, "s", 2.0, label="lag"),
        Parameter(
            "ln_ratio_noise",
            -3.0,
            0.0,
            "1",
            0.1,
            -0.01,
            label="ln of the ratio of short-scale noise",
            shown_as="logarithm",
            symbol="short-scale noise",
            by_product=True,
        ),
    )
    needs = ("vertical_rate",)
    sensor = True

    def plausible(self, state: FlightState, theta: Tensor) -> bool:
        """True for a lag beyond what every transponder has; what makes a rate late need not damp its noise."""
        return LEAST_LAG_S < float(theta[0]) < self.parameters[0].high

    def shift(self, state: FlightState, theta: Tensor) -> Shift:
        """Reported rate, also against the altitude differenced over time.

        A first-order lag tau makes the report y of a rate r follow dy/dt = (r - y) / tau. Its mean over a band exceeds
        that of r by tau times the change of y over the seconds in the band, whatever r does within it. What that shifts
        in the rate itself is taken at the real flights' mean change: a flight's own is a difference of the very rates
        that it would be compared with, and a regression on it is biased (endogeneity: Wooldridge, Introductory
        Econometrics, chapter 15).
        """
        lag_s, ln_ratio_noise = theta
        change = state.rate_change_per_s
        if change is None:
            rate = state.schedule_log_rate.exp()
            late = usual = _late(rate, state, float(lag_s)) - rate.log()
        else:
            late = _exceeds(lag_s * torch.where(change.isfinite(), change, state.schedule_change_per_s))
            mean = state.usual_rate_change_per_s
            usual = late if mean is None else _exceeds(lag_s * mean).expand_as(late)
        return {"rate": usual, "lag": late, "noise_rate": ln_ratio_noise * torch.ones_like(late[:, 0])}


def _exceeds(share: Tensor) -> Tensor:
    """Logarithm of a reported mean rate y over the mean r that is flown, where y - r is this share of y."""
    return -torch.log1p(-share.clamp(max=MOST_BEYOND))


def _late(rate_mps: Tensor, state: FlightState, lag_s: float) -> Tensor:
    """Logarithm of what is reported of rates (n, K) at ascending levels, by the first-order lag itself.

    A prepared descent begins some seconds after its report has reached the least rate, and so does the lag here: the
    settings by which the flights were cleaned say after how many, and which rate.
    """
    if lag_s <= 0:
        return rate_mps.log()
    slowest_mps = state.cleaning.slowest_fpm * FPM_MPS
    begun = rate_mps - (rate_mps - slowest_mps).clamp(min=0.0) * math.exp(-state.cleaning.transient_s / lag_s)
    reported, below_top = begun[:, -1], (state.depth_m > 0).unbind(1)
    late = [reported]
    for level in range(rate_mps.shape[1] - 2, -1, -1):
        rate = rate_mps[:, level]
        keep = torch.exp(-state.width_m / rate / lag_s)
        reported = torch.where(below_top[level], keep * reported + (1 - keep) * rate, begun[:, level])
        late.append(reported)
    return torch.stack(late[::-1], 1).log()
