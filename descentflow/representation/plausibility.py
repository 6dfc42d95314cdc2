"""Plausibility bounds on sampled profiles (paper, section 2.4) and the levels where descents start."""

from typing import Any, Literal

import torch
from torch import Tensor, nn

from descentflow.core.units import FL_M
from descentflow.physics.airspeed import cas_to_tas_mps
from descentflow.representation.decoder.trajectories import Trajectories, rows_at_once
from descentflow.representation.drag_scale import DragScale
from descentflow.representation.fpca.roughness import SPREAD_WEIGHT, smoother
from descentflow.representation.profiles import Profiles

Bounds = Literal["expected", "paper"]
MARGIN = 0.05
"""The paper's bounds: 95 % of the minimum and 105 % of the maximum observed in training at each level."""

CHANGE_QUANTILE, CHANGE_MARGIN = 0.999, 0.4
"""Of the changes between neighbouring levels that training flights show, and how far beyond it a sample may go."""
LEAST_CHANGE_MPS2 = 0.1
"""Changes that samples may have in any case: a hundredth of g, 40 ft/min in two seconds, is what reports resolve."""

RULES = (
    "not_finite",
    "drag_below_bound",
    "drag_above_bound",
    "cas_below_bound",
    "cas_above_bound",
    "descends_too_slowly",
    "speed_changes_too_fast",
    "rate_changes_too_fast",
)
"""Reasons to reject a draw, in the order in which reports list them."""
MANY = 3000
"""Flights from which on extremes are taken as they are: what a type has in the paper, of 41,011 flights of 13 types."""


class Plausibility(nn.Module):
    """Plausible range of the training flights: bounds per level, the slowest descent, changes, and entry levels.

    To change the bounds, fit with another ``data.margin``.

    Shapes: bounds (L,), ``slowest_rate_mps`` () negative, ``fastest_change_mps2`` () and
    ``fastest_rate_change_mps2`` () greatest magnitude of the acceleration along the path, and of the vertical one,
    between neighbouring levels (infinite without these rules), ``entry_counts`` (L,) number of training flights whose
    highest level it is.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> model = load_model("best.ckpt")
        >>> bounds, flown = model.representation.plausibility, model.representation.decoder(model.sample(50, seed=0))
        >>> bounds.broken_rules(flown).shape  # (draws, rules)
        torch.Size([50, 8])
    """

    drag_low: Tensor
    drag_high: Tensor
    cas_low: Tensor
    cas_high: Tensor
    slowest_rate_mps: Tensor
    fastest_change_mps2: Tensor
    fastest_rate_change_mps2: Tensor
    entry_counts: Tensor

    def __init__(self, **buffers: Tensor) -> None:
        """Build from the buffers named in the class; :meth:`from_profiles` computes them.

        Changes between levels are unbounded where nothing is said of them.
        """
        super().__init__()
        unbounded = torch.tensor(torch.inf, dtype=torch.float64)
        changes = {"fastest_change_mps2": unbounded, "fastest_rate_change_mps2": unbounded}
        for name, value in {**changes, **buffers}.items():
            # Not persistent: the checkpoint holds them once, as this module's own state.
            self.register_buffer(name, value, persistent=False)

    @classmethod
    def from_profiles(
        cls,
        profiles: Profiles,
        margin: float = MARGIN,
        bounds: Bounds = "expected",
        drag_scale: DragScale | None = None,
    ) -> "Plausibility":
        """Bounds of training flights.

        Args:
            profiles: Training flights; every level must be observed by at least one.
            margin: Share of each extreme by which its bound lies outside it, above zero; 0.05 in the paper.
            bounds: ``expected`` moves extremes of fewer than 3,000 flights to where those of 3,000 are expected
                (:mod:`~descentflow.representation.plausibility`) and bounds changes between neighbouring levels by the
                99.9 % quantile of the flights' and 40 %; ``paper`` takes extremes as they are, and no changes.
            drag_scale: On which extremes of drag are moved; newtons if absent.
        """
        if bounds == "paper":
            drag_low, drag_high = level_bounds(profiles.drag_n, profiles.mask, margin)
            cas_low, cas_high = level_bounds(profiles.cas_mps, profiles.mask, margin)
        else:
            drag_low, drag_high = expected_bounds(profiles.drag_n, profiles.mask, margin, drag_scale)
            cas_low, cas_high = expected_bounds(profiles.cas_mps, profiles.mask, margin)
        slowest = profiles.rate_mps[profiles.mask].max() * (1 - margin)
        if bounds == "paper":
            changes = (slowest.new_tensor(torch.inf),) * 2
        else:
            slowest, changes = slowest / outward(torch.tensor(len(profiles))), _largest_changes(profiles)
        return cls(
            drag_low=drag_low,
            drag_high=drag_high,
            cas_low=cas_low,
            cas_high=cas_high,
            # Cleaning keeps descending rows only; should one slip through, a sample must still descend.
            slowest_rate_mps=slowest.clamp(max=-1e-3),
            fastest_change_mps2=changes[0],
            fastest_rate_change_mps2=changes[1],
            entry_counts=torch.bincount(profiles.entry_level, minlength=len(profiles.levels_fl)),
        )

    def broken_rules(self, flown: Trajectories) -> Tensor:
        """Mask (n, len(RULES)) of the rules that each descent breaks at or below its entry level."""
        if torch.compiler.is_compiling():
            return self._broken(flown)
        size = rows_at_once(flown.time_s)
        return torch.cat([self._broken(flown.subset(slice(i, i + size))) for i in range(0, max(len(flown), 1), size)])

    def _broken(self, flown: Trajectories) -> Tensor:
        """The mask of descents whose arrays the caches hold."""
        mask, seconds = flown.mask, _seconds(flown.rate_mps, flown.levels_fl * FL_M)
        of_levels = (
            ~(flown.drag_n + flown.cas_mps + flown.rate_mps).isfinite(),
            flown.drag_n < self.drag_low,
            flown.drag_n > self.drag_high,
            flown.cas_mps < self.cas_low,
            flown.cas_mps > self.cas_high,
            ~(flown.rate_mps <= self.slowest_rate_mps),
        )
        of_changes = (
            (flown.tas_mps.diff(dim=1) / seconds).abs() > self.fastest_change_mps2,
            (flown.rate_mps.diff(dim=1) / seconds).abs() > self.fastest_rate_change_mps2,
        )
        # Of two neighbours, the lower one is flown where the upper one is.
        broken = [(rule & mask).any(1) for rule in of_levels] + [(rule & mask[:, 1:]).any(1) for rule in of_changes]
        return torch.stack(broken, 1)

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


def acceleration_mps2(speed_mps: Tensor, rate_mps: Tensor, altitude_m: Tensor) -> Tensor:
    """Change of a speed between neighbouring levels (n, L - 1) by the time between them, positive where it grows.

    Args:
        speed_mps: (n, L), for instance the true airspeed, or the rate itself.
        rate_mps: (n, L) of pressure altitude, negative in descent.
        altitude_m: (L,) ascending.

    Example:
        >>> tas, rate = torch.tensor([[200.0, 206.0]]), torch.tensor([[-10.0, -10.0]])
        >>> acceleration_mps2(tas, rate, torch.tensor([6000.0, 6030.0]))  # 6 m/s lost in 3 s
        tensor([[-2.]])
    """
    return -speed_mps.diff(dim=1) / _seconds(rate_mps, altitude_m)


def _seconds(rate_mps: Tensor, altitude_m: Tensor) -> Tensor:
    """Time (n, L - 1) between neighbouring levels."""
    slowness = -1 / rate_mps
    return altitude_m.diff() * 0.5 * (slowness[:, 1:] + slowness[:, :-1])


def expected_bounds(
    values: Tensor, mask: Tensor, margin: float = MARGIN, drag_scale: DragScale | None = None
) -> tuple[Tensor, Tensor]:
    """:func:`level_bounds`, from extremes that are moved outward where few flights show a level.

    Args:
        values: (n, L).
        mask: (n, L) observed.
        margin: Share of the extreme's magnitude.
        drag_scale: On which extremes of drag are moved: there flights spread as normals do.

    Example:
        >>> values = 140 + 10 * torch.randn(20, 1)
        >>> low, high = expected_bounds(values, torch.ones(20, 1, dtype=torch.bool), margin=0.0)
        >>> bool(low < values.min()), bool(high > values.max())
        (True, True)
    """
    count, on_scale = mask.sum(0), values
    if drag_scale is not None:
        on_scale = drag_scale.scaled(values, drag_scale.cas_mps)
    mean = torch.where(mask, on_scale, 0.0).sum(0) / count
    low, high = (moved_outward(one, mean, count) for one in level_bounds(on_scale, mask, margin=0.0))
    if drag_scale is not None:
        low, high = (drag_scale.drag_n(one, drag_scale.cas_mps) for one in (low, high))
    return low - margin * low.abs(), high + margin * high.abs()


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


def _largest_changes(profiles: Profiles) -> tuple[Tensor, Tensor]:
    """Bounds () of both accelerations; infinite where no flight shows two neighbouring levels."""
    both = profiles.mask[:, 1:] & profiles.mask[:, :-1]
    if not bool(both.any()):
        infinite = profiles.drag_n.new_tensor(torch.inf)
        return infinite, infinite
    rank = min(int(CHANGE_QUANTILE * int(both.sum())) + 1, int(both.sum()))
    speeds = cas_to_tas_mps(profiles.cas_mps, profiles.altitude_m), profiles.rate_mps
    changes = [acceleration_mps2(speed, profiles.rate_mps, profiles.altitude_m) for speed in speeds]
    first, second = (
        ((1 + CHANGE_MARGIN) * change[both].abs().kthvalue(rank).values).clamp(min=LEAST_CHANGE_MPS2)
        for change in changes
    )
    return first, second


def outward(n: Tensor) -> Tensor:
    """Factor (...) by which extremes of n flights are moved away from the mean: to where those of 3,000 are expected.

    For a normal distribution, whose expected extremes are Blom's (1958); 1 from 3,000 flights on.

    Args:
        n: (...) flights, at least one.

    Example:
        >>> outward(torch.tensor([2, 20, 100, 3000, 4000])).round(decimals=2)
        tensor([5.9900, 1.8900, 1.4100, 1.0000, 1.0000], dtype=torch.float64)
    """
    # One flight alone says nothing of a spread: it counts as two.
    return _expected_extreme(torch.tensor(MANY)) / _expected_extreme(n.clamp(min=2, max=MANY))


def moved_outward(extreme: Tensor, mean: Tensor, n: Tensor) -> Tensor:
    """Extremes (L,) of n (L,) flights with a mean (L,), where those of at least 3,000 would be expected.

    Of fewer flights they lie as far from the mean as those of the levels about them, at the least.

    Args:
        extreme: (L,) all of them below the mean, or all above.
        mean: (L,).
        n: (L,) flights that show each level.

    Example:
        >>> mean, n = torch.full((3,), 140.0), torch.tensor([20, 20, 20])
        >>> moved_outward(torch.tensor([150.0, 150.0, 150.0]), mean, n).round(decimals=1)
        tensor([158.9000, 158.9000, 158.9000], dtype=torch.float64)
        >>> moved_outward(torch.tensor([150.0, 141.0, 150.0]), mean, n).round(decimals=1)  # neighbours tell
        tensor([158.9000, 153.2000, 158.9000], dtype=torch.float64)
    """
    far = outward(n) * (extreme - mean)
    about = smoother(n.to(far), SPREAD_WEIGHT) @ far
    further = (about * far.sign() > far.abs()) & (n < MANY)
    return mean + torch.where(further, about, far)


def _expected_extreme(n: Tensor) -> Tensor:
    n = n.to(torch.float64)
    extreme: Tensor = torch.special.ndtri((n - 0.375) / (n + 0.25))
    return extreme
