"""Draws by number: the same seed and number give the same draw, in any batch, order, thread or process."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from scipy.special import ndtri

from descentflow.core.counter_random import DrawNumbers
from descentflow.generation.conditional.flown_profiles import Array, FlownProfiles
from descentflow.generation.conditional.latent_parts import LatentParts
from descentflow.generation.conditional.point_condition import Flown, PointCondition
from descentflow.generation.conditional.speed_conditions import Conditions, log_total

FIRST_STREAM = 1 << 32
"""Streams of random numbers below it are those of corrections."""
LEAST = 2.0**-54
"""In place of a uniform number that is zero, half of the next: its normal is finite."""
BLOCK = 512
"""Draws whose latent numbers are computed at a time."""


@dataclass(frozen=True)
class Numbers:
    """Draws ``first``, ``first + 1`` and so on of a seed.

    Example:
        >>> ten = Numbers(seed=3, first=0).uniform(10, 5, stream=0)
        >>> np.array_equal(Numbers(seed=3, first=6).uniform(2, 5, stream=0), ten[6:8])
        True
    """

    seed: int
    first: int

    def uniform(self, n: int, width: int, stream: int) -> Array:
        """Numbers (n, width) in (0, 1) of n draws; other streams are other numbers."""
        numbers = DrawNumbers(self.seed, self.first * width).uniform(n * width, FIRST_STREAM + stream)
        found: Array = np.maximum(numbers.numpy().reshape(n, width), LEAST)
        return found


@dataclass(frozen=True)
class Drawn:
    """n draws of D latent numbers.

    Attributes:
        u: (n, D) latent numbers.
        entry: (n,) index of the level of entry.
        flown: What they fly.
        log_weight: (n,) log weights, up to a constant; minus infinity where a draw cannot be.

    Example:
        >>> flown = Flown(*(np.zeros((2, 3)) for _ in range(6)))
        >>> drawn = Drawn(np.zeros((2, 4)), np.zeros(2, int), flown, np.log([1.0, 3.0]))
        >>> resampled(drawn.log_weight[None], np.array([0.3]))[0]  # the second has three quarters of the weight
        array([1])
    """

    u: Array
    entry: np.ndarray
    flown: Flown
    log_weight: Array


class Target(Protocol):
    """Latent draws: uniform numbers (n, ``width``) in (0, 1) make n draws.

    Example:
        >>> class Normal:
        ...     width = 2
        ...
        ...     def draw(self, uniform):
        ...         flown = Flown(*(np.zeros((len(uniform), 1)) for _ in range(6)))
        ...         return Drawn(ndtri(uniform), np.zeros(len(uniform), int), flown, np.zeros(len(uniform)))
        >>> target: Target = Normal()
        >>> u = target.draw(Numbers(seed=0, first=0).uniform(10_000, target.width, stream=0)).u
        >>> bool(abs(u.mean()) < 0.03 and abs(u.std() - 1) < 0.03)  # four standard errors
        True
    """

    width: int

    def draw(self, uniform: Array) -> Drawn:
        """One draw for each row."""


class ConditionedTarget:
    """Gaussians given speeds and perhaps a point.

    Args:
        parts: The density as K Gaussians.
        grid: Of the decoder.
        component: (C,) which of the K each conditioned Gaussian is of.
        entry: (C,) index of its level of entry.
        speeds: The C Gaussians given the speeds.
        point: The same given a time or a distance; None if none is asked.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> from descentflow.generation.conditional.latent_parts import parts_of
        >>> from descentflow.generation.conditional.speed_conditions import Rows, conditions
        >>> model = load_model("best.ckpt")
        >>> grid = FlownProfiles(model.representation.decoder)
        >>> parts, level = parts_of(model, grid, None), grid.nearest(200)
        >>> cas, cas_mps = parts.profiles.cas, np.full((len(parts.means), 1), 145.0)
        >>> of_level = np.repeat(cas.loadings[None, None, :, level], len(parts.means), 0)
        >>> rows = Rows(of_level, cas.of(parts.means)[:, [level]], cas_mps, cas_mps)
        >>> speeds = conditions(parts.log_probs, parts.means, parts.roots, rows)
        >>> components = np.arange(len(parts.means))
        >>> target = ConditionedTarget(parts, grid, components, 0 * components + grid.nearest(330), speeds, None)
        >>> drawn = target.draw(Numbers(seed=0, first=0).uniform(100, target.width, stream=0))
        >>> target.in_closed_form, np.allclose(drawn.flown.cas[:, level], 145.0, rtol=0, atol=1e-9)  # m/s
        (True, True)
    """

    def __init__(
        self,
        parts: LatentParts,
        grid: FlownProfiles,
        component: np.ndarray,
        entry: np.ndarray,
        speeds: Conditions,
        point: PointCondition | None,
    ) -> None:
        """Hold what was conditioned."""
        self.parts, self.grid, self.component, self.entry, self.speeds, self.point = (
            parts,
            grid,
            component,
            entry,
            speeds,
            point,
        )
        self.width = 2 + parts.means.shape[1] + speeds.rows.n_rows
        shares = speeds.log_probs if point is None else point.log_probs
        self.up_to = np.exp(shares - log_total(shares)).cumsum()

    @property
    def in_closed_form(self) -> bool:
        """True where every draw has the same weight."""
        return self.speeds.in_closed_form and self.point is None and self.parts.prior is None

    def draw(self, uniform: Array) -> Drawn:
        """One draw for each row."""
        blocks = [self._block(uniform[start : start + BLOCK]) for start in range(0, len(uniform), BLOCK)]
        return blocks[0] if len(blocks) == 1 else joined(blocks)

    def _block(self, uniform: Array) -> Drawn:
        cell = np.minimum(np.searchsorted(self.up_to, uniform[:, 0], side="right"), len(self.up_to) - 1)
        size = self.parts.means.shape[1]
        white = ndtri(uniform[:, 2 : 2 + size])
        component = self.component[cell]
        u = (self.parts.roots[component] * white[:, None]).sum(2)
        u, log_weight = self.speeds.meet(cell, u, uniform[:, 2 + size :])
        if self.point is None:
            u = u + self.parts.means[component]
            flown = Flown.of(self.grid, self.parts.profiles.of(u))
        else:
            u, flown, more = self.point.meet(cell, u, uniform[:, 1])
            u, log_weight = u + self.parts.means[component], log_weight + more
        if self.parts.prior is not None:
            log_weight = log_weight + self.parts.log_ratio(u)
        return Drawn(u, self.entry[cell], flown, log_weight)


def joined(parts: list[Drawn]) -> Drawn:
    """Draws one after another.

    Example:
        >>> flown = Flown(*(np.zeros((2, 3)) for _ in range(6)))
        >>> some = Drawn(np.zeros((2, 4)), np.zeros(2, int), flown, np.zeros(2))
        >>> joined([some, some]).u.shape
        (4, 4)
    """
    together = zip(*(_values(p.flown) for p in parts), strict=True)
    flown = Flown(*(np.concatenate(values) for values in together))
    u, entry, log_weight = (np.concatenate([getattr(p, name) for p in parts]) for name in ("u", "entry", "log_weight"))
    return Drawn(u, entry, flown, log_weight)


def rows_of(drawn: Drawn, index: np.ndarray) -> Drawn:
    """The draws at these positions.

    Example:
        >>> flown = Flown(*(np.zeros((2, 3)) for _ in range(6)))
        >>> rows_of(Drawn(np.zeros((2, 4)), np.zeros(2, int), flown, np.zeros(2)), np.array([1])).u.shape
        (1, 4)
    """
    flown = Flown(*(values[index] for values in _values(drawn.flown)))
    return Drawn(drawn.u[index], drawn.entry[index], flown, drawn.log_weight[index])


def _values(flown: Flown) -> list[Array]:
    """All that was flown, in the order of its fields."""
    return [flown.drag, flown.cas, flown.mach, flown.tas, flown.rate, flown.seconds]


def resampled(log_weight: Array, uniform: Array) -> tuple[np.ndarray, Array]:
    """One proposal for each draw by the weights (n, M) of its own, and how many effective ones there were (n,).

    Args:
        log_weight: (n, M), minus infinity where a proposal cannot be.
        uniform: (n,) in (0, 1).

    Example:
        >>> resampled(np.log([[1.0, 1.0, 2.0]]), np.array([0.9]))
        (array([2]), array([2.66666667]))
    """
    with np.errstate(invalid="ignore"):
        shares = np.exp(log_weight - log_weight.max(1, keepdims=True))
    shares = np.where(np.isfinite(shares), shares, 0.0)
    total = shares.cumsum(1)
    chosen = (total <= uniform[:, None] * total[:, -1:]).sum(1)
    with np.errstate(invalid="ignore"):
        effective = np.where(total[:, -1] > 0, total[:, -1] ** 2 / (shares**2).sum(1), 0.0)
    return np.minimum(chosen, log_weight.shape[1] - 1), effective
