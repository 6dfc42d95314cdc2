"""Flights of which some have an effect each in its own way, by construction."""

from dataclasses import replace

import torch
from example_sides import example_sides
from torch import Tensor

from descentflow.core.units import FL_M
from descentflow.diagnosis.inference.two_sides import Compared
from descentflow.effects import EFFECTS

BRAKES, PATH = EFFECTS["speed_brake"], EFFECTS["geometric_path"]
STEADY = 0.15
"""Of the noise of the example: flights of one fleet differ less in shape than in level."""


def steady_sides(n: int) -> Compared:
    """Flights of both sides without an effect, whose rates are alike in shape."""
    sides = example_sides(n=n)
    rate = sides.of("rate")
    level = sides.y[:, rate].mean(1, keepdim=True)
    y = sides.y.clone()
    y[:, rate] = level + STEADY * (y[:, rate] - level)
    return replace(sides, y=y)


def with_own_windows(n: int, share: float, size: float, seed: int = 0) -> tuple[Compared, Tensor, Tensor]:
    """Brakes at each flight's own levels, 50 FL high about FL230 +- 20; who has them (n,), and the lower ends (n,)."""
    sides = steady_sides(n)
    generator = torch.Generator().manual_seed(seed)
    chosen = torch.rand(n, generator=generator) < share
    low = 205 + 20 * torch.randn(n, generator=generator, dtype=torch.float64)
    state = sides.state.rows(torch.nonzero(sides.real)[:, 0])
    change = BRAKES.whole_change(state, torch.tensor(size, dtype=torch.float64))
    inset = BRAKES.inset_fl / 2
    within = BRAKES.below(state, low + 50 - inset)["rate"] - BRAKES.below(state, low + inset)["rate"]
    return _moved(sides, torch.where(chosen[:, None], change * within, 0.0)), chosen, low


def on_own_paths(n: int, share: float, drag: float, seed: int = 0) -> tuple[Compared, Tensor]:
    """Some flights on paths 10 +- 3 % shallower than idle, all others with more drag; who is on a path (n,)."""
    sides = steady_sides(n)
    generator = torch.Generator().manual_seed(seed)
    chosen = torch.rand(n, generator=generator) < share
    shallower = 0.1 + 0.03 * torch.randn(n, 1, generator=generator, dtype=torch.float64)
    state = sides.state.rows(torch.nonzero(sides.real)[:, 0])
    noise = sides.y[sides.real][:, sides.of("rate")]
    # A path takes the place of whatever the rate would be, but for the noise of its shape.
    path = PATH.ways(state, torch.tensor([1.0, 0.1, 0.03]).double(), 0.0 * noise).offset - shallower
    path = path + noise - noise.mean(1, keepdim=True)
    idle = noise + EFFECTS["drag_polar"].shift(state, torch.tensor([drag]).double())["rate"]
    y = sides.y.clone()
    real, rate = torch.nonzero(sides.real), torch.nonzero(sides.of("rate"))[:, 0]
    y[real, rate] = torch.where(chosen[:, None], path, idle)
    return replace(sides, y=y), chosen


def with_held_rates(n: int, share: float, slower: float, seed: int = 0) -> Compared:
    """Some flights that are slower by 60 FL from some level of their own, FL160 to FL200: a rate held there."""
    sides = steady_sides(n)
    generator = torch.Generator().manual_seed(seed)
    chosen = torch.rand(n, generator=generator) < share
    low = (160 + 40 * torch.rand(n, generator=generator, dtype=torch.float64)) * FL_M
    within = sides.state.share_below(low + 60 * FL_M) - sides.state.share_below(low)
    return _moved(sides, torch.where(chosen[:, None], -slower * within, 0.0))


def _moved(sides: Compared, rate: Tensor) -> Compared:
    y = sides.y.clone()
    y[torch.nonzero(sides.real), torch.nonzero(sides.of("rate"))[:, 0]] += rate
    return replace(sides, y=y)
