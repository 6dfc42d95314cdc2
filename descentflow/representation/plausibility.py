"""Plausibility bounds on sampled profiles (paper, section 2.4) and the levels where descents start."""

from typing import Any

import torch
from torch import Tensor, nn

from descentflow.core.errors import ConfigError
from descentflow.representation.decoder.trajectories import Trajectories
from descentflow.representation.profiles import Profiles

MARGIN = 0.05
"""The paper's bounds: 95 % of the minimum and 105 % of the maximum observed in training at each level."""

RULES = (
    "not_finite",
    "drag_below_bound",
    "drag_above_bound",
    "cas_below_bound",
    "cas_above_bound",
    "descends_too_slowly",
)
"""Reasons to reject a draw, in the order in which reports list them."""


class Plausibility(nn.Module):
    """Plausible range of the training flights: bounds per level, the slowest descent, and entry levels.

    To change the bounds, fit with another ``data.margin``.

    Shapes: bounds (L,), ``slowest_rate_mps`` () negative, ``entry_counts`` (L,) number of training flights
    whose highest level it is.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> model = load_model("best.ckpt")
        >>> bounds, flown = model.representation.plausibility, model.representation.decoder(model.sample(50, seed=0))
        >>> bounds.broken_rules(flown).shape  # (draws, rules)
        torch.Size([50, 6])
    """

    drag_low: Tensor
    drag_high: Tensor
    cas_low: Tensor
    cas_high: Tensor
    slowest_rate_mps: Tensor
    entry_counts: Tensor

    def __init__(self, **buffers: Tensor) -> None:
        """Build from the buffers named in the class; :meth:`from_profiles` computes them."""
        super().__init__()
        for name, value in buffers.items():
            # Not persistent: the checkpoint holds them once, as this module's own state.
            self.register_buffer(name, value, persistent=False)

    @classmethod
    def from_profiles(cls, profiles: Profiles, margin: float = MARGIN) -> "Plausibility":
        """Bounds of training flights.

        Args:
            profiles: Training flights; every level must be observed by at least one.
            margin: Share of each extreme by which its bound lies outside it, above zero; 0.05 in the paper.

        Raises:
            ConfigError: If the margin is not positive.
        """
        if not margin > 0:
            raise ConfigError(
                f"a margin of {margin:g} about the training flights", expected="a share above 0", mend="try 0.05"
            )
        drag_low, drag_high = level_bounds(profiles.drag_n, profiles.mask, margin)
        cas_low, cas_high = level_bounds(profiles.cas_mps, profiles.mask, margin)
        slowest = profiles.rate_mps[profiles.mask].max() * (1 - margin)
        return cls(
            drag_low=drag_low,
            drag_high=drag_high,
            cas_low=cas_low,
            cas_high=cas_high,
            # Cleaning keeps descending rows only; should one slip through, a sample must still descend.
            slowest_rate_mps=slowest.clamp(max=-1e-3),
            entry_counts=torch.bincount(profiles.entry_level, minlength=len(profiles.levels_fl)),
        )

    def broken_rules(self, flown: Trajectories) -> Tensor:
        """Which rules each descent breaks at or below its entry level: (n, len(RULES)) bool."""
        mask = flown.mask
        rows = (
            ~(flown.drag_n.isfinite() & flown.cas_mps.isfinite() & flown.rate_mps.isfinite()),
            flown.drag_n < self.drag_low,
            flown.drag_n > self.drag_high,
            flown.cas_mps < self.cas_low,
            flown.cas_mps > self.cas_high,
            ~(flown.rate_mps <= self.slowest_rate_mps),
        )
        return torch.stack([(row & mask).any(1) for row in rows], 1)

    def draw_entry(self, n: int, generator: torch.Generator) -> Tensor:
        """Indices (n,) of entry levels, drawn as the training flights entered."""
        return torch.multinomial(self.entry_counts.cpu().double(), n, replacement=True, generator=generator)

    def to_state(self) -> dict[str, Any]:
        """Tensors from which :meth:`from_state` rebuilds the module."""
        return {name: buffer.cpu() for name, buffer in self.named_buffers(remove_duplicate=False)}

    @classmethod
    def from_state(cls, state: dict[str, Any]) -> "Plausibility":
        """Rebuild from :meth:`to_state`."""
        return cls(**state)


def level_bounds(values: Tensor, mask: Tensor, margin: float = MARGIN) -> tuple[Tensor, Tensor]:
    """Lower and upper bound per level: the extremes over observing flights, each moved outward by ``margin``.

    Taking 95 % of a negative minimum would tighten the bound; the outward move is of its magnitude instead.

    Args:
        values: (n, L).
        mask: (n, L) observed.
        margin: Share of the extreme's magnitude.

    Example:
        >>> level_bounds(torch.tensor([[-10.0], [20.0]]), torch.tensor([[True], [True]]))
        (tensor([-10.5000]), tensor([21.]))
    """
    low = torch.where(mask, values, torch.inf).amin(0)
    high = torch.where(mask, values, -torch.inf).amax(0)
    return low - margin * low.abs(), high + margin * high.abs()
