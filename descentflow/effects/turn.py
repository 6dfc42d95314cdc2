"""Turns: a banked aircraft needs more lift, and has more induced drag, over the levels where it turns."""

from collections.abc import Mapping

import torch
from torch import Tensor

from descentflow.effects.effect import Effect, Parameter, Shift
from descentflow.effects.flight_state import FlightState, log_rate

LEAST_DRAG = 0.005
"""Mean share of induced drag below which nothing is turned: it moves the rate by less than what is negligible."""
AS_MEASURED = (0.5, 1.5)
"""Of the induced drag that headings say, what rates may show: signatures of the rate are off by half at most."""


class Turn(Effect):
    """Induced drag higher where flights turn, in the levels and by as much as their headings say.

    The size is the mean over levels, its course over them is the measured one. It should be as large as measured, and
    is no turn if it is not. Flights whose directions are not known, such as those of a corrected simulator, have the
    mean at every level.

    Example:
        >>> from dataclasses import replace
        >>> from descentflow.effects._example_flights import example_flights
        >>> turned = torch.tensor([0.0] * 4 + [0.22] + [0.0] * 6).double()  # by headings, in the fifth of eleven bands
        >>> state = replace(example_flights(), turned_more=turned)
        >>> shift = Turn().shift(state, torch.tensor([0.02]).double())["rate"].mean(0)
        >>> (shift > 0.01).nonzero()[:, 0]
        tensor([4])
        >>> [Turn().plausible(state, torch.tensor([size]).double()) for size in (0.02, 0.05)]
        [True, False]
    """

    name = "turn"
    description = "turns, in which a bank takes more lift and so more drag"
    directions = ("more turns, which add induced drag", "fewer turns, which add induced drag")
    needs = ("heading",)
    splits = ("heading", "track")
    parameters = (
        Parameter(
            "extra_cd2",
            -0.5,
            0.5,
            "1",
            0.02,
            label="induced drag added, mean over all flights and levels",
            shown_as="change",
            symbol="CD2",
        ),
    )

    def recipe(self, sizes: Mapping[str, str]) -> str:
        """To fly the turns is better than to add their mean."""
        return f"the turns of the flights, or their mean: {super().recipe(sizes)}"

    def shift(self, state: FlightState, theta: Tensor) -> Shift:
        """Rate by the energy equation, with the induced drag of the bank."""
        return {"rate": log_rate(state, induced=1 + theta[0] * _course(state)) - state.own_log_rate}

    def plausible(self, state: FlightState, theta: Tensor) -> bool:
        """As large as headings say."""
        if state.turned_more is None:
            return False
        least, most = AS_MEASURED
        measured = _mean(state, state.turned_more)
        return abs(measured) >= LEAST_DRAG and least <= float(theta[0]) / measured <= most


def _course(state: FlightState) -> Tensor:
    """Course (K,) over the levels with mean one; zero where flights do not turn, one where nothing is known of it."""
    if state.turned_more is None:
        return torch.ones_like(state.altitude_m) * float(not state.affected)
    mean = _mean(state, state.turned_more)
    return state.turned_more / mean if abs(mean) >= LEAST_DRAG else torch.zeros_like(state.turned_more)


def _mean(state: FlightState, values: Tensor) -> float:
    """Mean of values (K,) over the bands of all flights."""
    seen = state.mask.sum(0)
    return float((values * seen).sum() / seen.sum().clamp(min=1))
