"""Descents flown along a geometric path: the rate follows groundspeed and no longer thrust and drag."""

from typing import NamedTuple

import torch
from torch import Tensor

from descentflow.effects.effect import AT_BOUND, FlightChange, Parameter, Shift
from descentflow.effects.flight_law import MOST_SPREAD, DiffersByFlight, Learnt, Windows, positive_size, spread_of
from descentflow.effects.flight_state import FlightState
from descentflow.physics.airspeed import cas_to_tas_mps

LEAST_SHALLOWER = 0.005
"""Paths are planned to be flown with some thrust in hand."""
MOST_SHALLOWER = 0.6
"""Bound of a fit."""
FIRST_LAW = (0.5, 0.08, 0.05)
"""Share, and mean and spread of how much shallower, from which laws start."""
SMOOTH_M = 1800.0
"""Height over which what a flight has beyond the polar changes, and its noise does not."""
LEAST_SPREAD = 0.005
"""Least spread between flights of how much shallower: paths are planned in tenths of a degree, some 3 %."""


class PathLaw(NamedTuple):
    """Parameters by name, in their order in theta (3,)."""

    share: Tensor
    shallower: Tensor
    spread: Tensor


class GeometricPath(DiffersByFlight):
    """A share of the flights holds a path angle; idle thrust must not be needed below it, so it is a shallow one.

    Each flight holds an angle of its own: ``shallower`` is the mean of those, ``spread`` how they differ.

    Example:
        >>> from descentflow.effects._example_flights import example_flights
        >>> shift = GeometricPath().shift(example_flights(), torch.tensor([0.5, 0.1, 0.0]))
        >>> bool((shift["rate"] < 0).all())  # a shallower path than idle thrust allows
        True
    """

    name = "geometric_path"
    description = "a fixed path over the ground instead of an idle descent"
    parameters = (
        Parameter("share", 0.0, 1.0, "1", 0.1, label="share of the flights on a path", shown_as="flights"),
        Parameter(
            "shallower",
            0.0,
            MOST_SHALLOWER,
            "1",
            0.05,
            0.1,
            label="shallower than the idle path by",
            shown_as="percent",
        ),
        spread_of("spread_shallower", 0.25, "1", 0.02, "spread of that between flights on a path", "percent"),
    )
    splits = ("groundspeed",)
    holds_rate = True
    own_draws = 1

    def plausible(self, state: FlightState, theta: Tensor) -> bool:
        """All flights may hold one; a path at the very angle that idle allows is a fit driven to its bound."""
        law = PathLaw(*theta)
        return float(law.share) > 0.0 and LEAST_SHALLOWER < float(law.shallower) < MOST_SHALLOWER - AT_BOUND

    def mixture(self, theta: Tensor) -> tuple[float, Tensor]:
        """Flights hold it or do not."""
        law = PathLaw(*theta)
        return float(law.share), torch.stack(law._replace(share=torch.ones_like(law.share)))

    def shift(self, state: FlightState, theta: Tensor) -> Shift:
        """From the idle path's angle to one held, shallower by a share than the shallowest of the idle path."""
        law, beyond = PathLaw(*theta), state.beyond_polar
        return {"rate": law.share * (_to_the_shallowest(state, beyond, beyond) - law.shallower)}

    def law_start(self, state: FlightState) -> Tensor:
        """Some flights on paths of their own."""
        return torch.tensor(FIRST_LAW, dtype=torch.float64)

    def windows(self, state: FlightState, theta: Tensor) -> Windows:
        """One window, the whole flight; which angle it holds is its size."""
        # Whoever holds a path flies it in any air: what its air would do to an idle descent is off its rate in vain.
        flat = _to_the_shallowest(state, state.beyond_polar, state.beyond_polar) - state.own_air
        bands = range(flat.shape[1])
        table = torch.stack([torch.zeros(len(bands)), torch.ones(len(bands))]).double()
        one = torch.tensor([1])
        return Windows(tuple(("rate", band) for band in bands), -torch.ones_like(flat), flat, table, one - 1, one)

    def log_prior(self, state: FlightState, theta: Tensor) -> Tensor:
        """There is one window."""
        return torch.zeros(1, dtype=torch.float64)

    def size(self, theta: Tensor) -> tuple[float, float, float]:
        """Share on a path, and how much shallower."""
        share, shallower, spread = theta.tolist()
        return share, shallower, spread

    def learn(self, state: FlightState, theta: Tensor, learnt: Learnt) -> Tensor:
        """Share, mean and spread."""
        mean, spread = learnt.mean_and_spread()
        mean = max(mean, LEAST_SHALLOWER)
        spread = min(max(spread, LEAST_SPREAD), MOST_SPREAD * mean)
        return self.clamp(torch.tensor([learnt.share, mean, spread], dtype=torch.float64))

    def own_change(self, state: FlightState, theta: Tensor, uniform: Tensor) -> FlightChange:
        """A path of each flight's own."""
        law = PathLaw(*theta)
        shallower = positive_size(uniform[:, 0], law.shallower, law.spread)[:, None]
        own = torch.as_tensor(state.beyond_polar).expand_as(state.cas_mps)
        return FlightChange(flown={"rate": _to_the_shallowest(state, _smooth(state, own), own) - shallower})


def _smooth(state: FlightState, own: Tensor) -> Tensor:
    """Values (n, K) whose departures from their mean are smooth: the lowest of a flight's own noise is no idle path."""
    apart = (state.altitude_m[:, None] - state.altitude_m) / SMOOTH_M
    weight, seen = torch.exp(-0.5 * apart**2), state.mask.double()
    common = torch.where(state.mask, own, 0.0).sum(0) / seen.sum(0).clamp(min=1.0)
    departure = torch.where(state.mask, own - common, 0.0)
    return common + (departure @ weight) / (seen @ weight).clamp(min=1e-9)


def _to_the_shallowest(state: FlightState, idle: Tensor | float, beyond: Tensor | float) -> Tensor:
    """Change (n, K) of the logarithm of the rate to the shallowest angle of the simulator's idle path.

    Args:
        state: The flights.
        idle: ln of the rate of the idle path beyond the polar's.
        beyond: ln of the rate that they would have beyond the polar's.
    """
    ground = cas_to_tas_mps(state.cas_mps, state.altitude_m) + state.tailwind_mps
    angle = state.schedule_log_rate - ground.clamp(min=30.0).log()
    shallowest = torch.where(state.mask, angle + idle, torch.inf).amin(1, keepdim=True)
    return shallowest.clamp(max=1e3) - angle - beyond
