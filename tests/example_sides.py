"""Flights of both sides in closed form, to see what an effect does to the inference before any data."""

from collections.abc import Sequence
from dataclasses import replace

import torch

from descentflow.diagnosis.sides.two_sides import Compared
from descentflow.diagnosis.sides.vectors import Entry
from descentflow.effects import Effect
from descentflow.effects._example_flights import example_flights
from descentflow.measurements.quantity_registry import QUANTITIES

SPREADS = {"rate": 0.05, "cas": 5.0, "tas": 0.003}
"""Spread between flights of the quantities that the example compares."""
ALIKE = 0.8
"""Share of it that a flight has in all bands alike."""


def example_sides(effect: Effect | None = None, theta: Sequence[float] = (), n: int = 80) -> Compared:
    """Flights of a simulator and as many real ones, which have an effect.

    Args:
        effect: Of the real flights; none if absent.
        theta: Its parameters.
        n: Flights of each side.

    Example:
        >>> from descentflow.effects import EFFECTS
        >>> sides = example_sides(EFFECTS["temperature"], [10.0])
        >>> at = sides.columns("tas")
        >>> apart = sides.y[sides.real][:, at].mean() - sides.y[~sides.real][:, at].mean()
        >>> round(float(apart), 2)  # ten kelvin are two per cent of the true airspeed
        0.02
    """
    state = replace(example_flights(2 * n), affected=True)
    order = torch.randperm(2 * n, generator=torch.Generator().manual_seed(1))
    state = state.rows(order)
    bands = range(len(state.altitude_m))
    entries = tuple(Entry(name, band) for name in QUANTITIES if name in SPREADS for band in bands)
    scale = torch.tensor([SPREADS[e.quantity] for e in entries], dtype=torch.float64)
    noise = torch.randn(2 * n, len(entries), generator=torch.Generator().manual_seed(2), dtype=torch.float64)
    whole = noise.reshape(2 * n, -1, len(bands)).mean(2).repeat_interleave(len(bands), 1) * len(bands) ** 0.5
    y = scale * (ALIKE * whole + (1 - ALIKE**2) ** 0.5 * noise)
    each = torch.arange(2 * n)
    real = each >= n
    compared = Compared(entries, y, real, scale, each, each, state.altitude_m, 20.0, state)
    if effect is None:
        return compared
    shift = compared.vector(effect.shift(state, torch.tensor(theta, dtype=torch.float64)))
    return replace(compared, y=y + torch.where(real[:, None], shift, 0.0))
