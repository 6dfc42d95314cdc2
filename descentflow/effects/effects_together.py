"""Changes of a simulator's flights by several effects together, each in the flights that it takes."""

from collections.abc import Mapping

import torch
from torch import Tensor

from descentflow.core.counter_random import DrawNumbers
from descentflow.core.units import FL_M, KT_MPS
from descentflow.effects.effect import Effect, Shift
from descentflow.effects.flight_law import DiffersByFlight
from descentflow.effects.flight_state import FlightState, log_rate

SLOPE_LEVELS = 15
"""Levels over which the slope of CAS is taken on either side: reports are rounded to a knot."""
BY_LEVEL = ("rate", "cas", "tas", "wind", "height")
"""Quantities that change on every level."""
STREAMS = 100
"""Streams of random numbers that one effect may use."""
LAWS = 100_000
"""Stream of the number that decides which of the effects that differ by flight a flight has."""
FAR_OUT = 0.975
"""Quantile of what flights have of such an effect, to say how far it reaches: all but one in forty are within."""


def changes_together(
    state: FlightState,
    catalogue: Mapping[str, Effect],
    theta: Mapping[str, Tensor],
    draws: DrawNumbers | None,
    *,
    exact_shares: bool = False,
) -> tuple[dict[str, Tensor], dict[str, Tensor]]:
    """Changes that are flown, and that are reported alone, of all effects together, in the flights that each takes.

    At another speed the aircraft falls by its polar. A flight has at most one of the effects that differ by
    flight. Where one of them holds the rate, nothing else changes it.

    Args:
        state: The simulator's flights, which do not have the effects.
        catalogue: Effects by name.
        theta: Parameters of those that are added.
        draws: Seed and numbers of the flights, by which an effect takes its share of them and differs by flight. None
            to add every effect to every flight, far out in its law.
        exact_shares: Whether a share of these flights is that share of them, and no lot: the choice then depends on
            which flights are looked at together.

    Returns:
        Of the flight and of its reports: quantities of :data:`~descentflow.effects.effect.FLOWN`, each (n, K) or (n,).

    Example:
        >>> from dataclasses import replace
        >>> from descentflow.core.counter_random import DrawNumbers
        >>> from descentflow.effects import EFFECTS
        >>> from descentflow.effects._example_flights import example_flights
        >>> state = replace(example_flights(), affected=False)
        >>> warmer = {"temperature": torch.tensor([10.0])}
        >>> flown, reported = changes_together(state, EFFECTS, warmer, DrawNumbers(0))
        >>> round(float(flown["tas"].mean()), 3), float(reported["rate"].abs().max())
        (0.021, 0.0)
    """
    n = len(state.cas_mps)

    def numbers(stream: int) -> Tensor:
        drawn = draws.uniform(n, stream) if draws else torch.zeros(n, dtype=torch.float64)
        return _even(drawn) if exact_shares else drawn

    flown, reported = ({name: torch.zeros_like(state.cas_mps) for name in BY_LEVEL} for _ in range(2))
    held, begun = torch.zeros(n, dtype=torch.bool, device=state.cas_mps.device), 0.0
    rate_held = torch.zeros_like(state.cas_mps)
    for place, (name, given) in enumerate(theta.items()):
        effect = catalogue[name]
        share, whole = effect.mixture(given.double())
        law = isinstance(effect, DiffersByFlight) and effect.is_law(given)
        number = numbers(LAWS if law else place * STREAMS)
        first = begun if law and draws else 0.0
        begun += share if law else 0.0
        taken = torch.nonzero((number >= first) & (number < first + share))[:, 0].to(state.cas_mps.device)
        if not len(taken):
            continue
        own = state if len(taken) == n else state.rows(taken)
        if law and isinstance(effect, DiffersByFlight):
            uniform = _own_numbers(draws, effect.own_draws, place, n).to(taken.device)
            change = effect.own_change(own, whole, uniform[taken])
            if effect.holds_rate:
                held[taken], rate_held[taken] = True, change.flown["rate"]
                continue
        else:
            change = effect.change(own, whole)
        for total, shift in ((flown, change.flown), (reported, change.reported)):
            _add(total, shift, taken, n)
    if bool((flown["cas"] != 0).any()):
        faster = log_rate(state, faster_mps=flown["cas"] * KT_MPS)
        flown["rate"] = flown["rate"] + faster - state.own_log_rate
    flown["rate"] = torch.where(held[:, None], rate_held, flown["rate"])
    return flown, reported


def _even(number: Tensor) -> Tensor:
    """Numbers (n,) in the same order, evenly over [0, 1)."""
    return (number.argsort().argsort().double() + 0.5) / len(number)


def _own_numbers(draws: DrawNumbers | None, count: int, place: int, n: int) -> Tensor:
    """Numbers (n, count) by which flights have an effect each in their own way."""
    if draws is None:
        return torch.full((n, count), FAR_OUT, dtype=torch.float64)
    return torch.stack([draws.uniform(n, stream=place * STREAMS + 1 + i) for i in range(count)], 1)


def _add(total: dict[str, Tensor], shift: Shift, rows: Tensor, n: int) -> None:
    """Add the shifts of an effect in some of n flights."""
    for quantity, value in shift.items():
        if quantity not in total:
            total[quantity] = value.new_zeros(n, *value.shape[1:], dtype=torch.float64)
        total[quantity][rows] += value


def slope_over_levels(cas_mps: Tensor, spacing_m: float = FL_M) -> Tensor:
    """Slope dCAS/dHp (n, L) in 1/s over some levels on either side.

    Args:
        cas_mps: (n, L) on levels that are equally far apart.
        spacing_m: How far.

    Example:
        >>> slope_over_levels(torch.tensor([[100.0, 103.0, 106.0]]), 30.0)
        tensor([[0.1000, 0.1000, 0.1000]])
    """
    n = cas_mps.shape[1]
    index = torch.arange(n)
    low, high = (index - SLOPE_LEVELS).clamp(min=0), (index + SLOPE_LEVELS).clamp(max=n - 1)
    return (cas_mps[:, high] - cas_mps[:, low]) / ((high - low).to(cas_mps) * spacing_m)
