"""Descents of profiles that are linear in latent numbers, with the same bits for a draw in whatever batch it is.

Products of matrices sum in another order in another batch, and torch takes the last few numbers of an array by another
routine than the others: both change the last digit. Here profiles are summed number by number, and rows are as wide as
full vectors, with the sides of the rate's jumps in what would be padding.
"""

from dataclasses import dataclass, fields

import numpy as np
import torch
from numpy.typing import NDArray

from descentflow.core.units import FL_M
from descentflow.physics.fused_table import LevelTable, fused_rate
from descentflow.representation.decoder.descent_decoder import DescentDecoder
from descentflow.representation.decoder.flight_grid import flight_grid

Array = NDArray[np.float64]
VECTOR = 16
"""Numbers that torch takes at a time on any processor, or a multiple of them."""
BLOCK_VALUES = 1 << 15
"""Values of a quantity below which torch gives an array to one thread; rows of a block stay in its caches."""


@dataclass(frozen=True)
class LinearProfile:
    """``offset + u loadings`` of latent numbers u (n, D): shapes (W,) and (D, W), in the columns of a grid.

    Example:
        >>> line = LinearProfile(np.zeros(2), np.array([[1.0, 2.0]]))
        >>> line.of(np.array([[3.0]]))
        array([[3., 6.]])
    """

    offset: Array
    loadings: Array

    def of(self, u: Array) -> Array:
        """Profiles (n, W) of (n, D)."""
        total = np.repeat(self.offset[None], len(u), 0)
        part = np.empty_like(total)
        for column, loading in zip(u.T, self.loadings, strict=True):
            if loading.any():
                np.multiply(column[:, None], loading, out=part)
                total += part
        return total

    def change(self, direction: Array) -> Array:
        """Change of the profile (n, W) along directions (n, D)."""
        return LinearProfile(np.zeros_like(self.offset), self.loadings).of(direction)


class FlownProfiles:
    """The decoder's equations on its own grid, for profiles of drag (N) and CAS (m/s) with W columns.

    Columns are the L levels, both sides of each jump of the rate, and padding.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> decoder = load_model("best.ckpt").representation.decoder
        >>> flown = FlownProfiles(decoder)
        >>> mean = torch.zeros(1, decoder.dimension).double()
        >>> drag, cas = (flown.columns(values.numpy()) for values in decoder.curves(mean))
        >>> since = flown.seconds(flown.fly(drag, cas)[3])
        >>> bool(abs(since[0, 0] - since[0, -1] - decoder(mean).time_s[0, 0]) < 1e-9)
        True
    """

    def __init__(self, decoder: DescentDecoder) -> None:
        """Tabulate a decoder's levels, for its aircraft, mass and no temperature deviation."""
        levels = decoder.levels_fl.detach().cpu()
        altitude_m = levels * FL_M
        grid = flight_grid(decoder.aircraft, altitude_m)
        breaks, tables = grid.breaks, (grid.levels, grid.sides)
        self.levels_fl, self.n_levels, self.n_sides = levels.numpy(), len(levels), len(breaks.base)
        self.width = -(-(self.n_levels + self.n_sides) // VECTOR) * VECTOR
        padding = self.width - self.n_levels - self.n_sides
        joined = [
            torch.cat([*(getattr(t, f.name) for t in tables), getattr(tables[0], f.name)[:1].expand(padding)])
            for f in fields(LevelTable)
        ]
        self.table = LevelTable(*(column.contiguous() for column in joined))
        self.base, self.share = np.array(breaks.base, dtype=int), np.array([float(s) for s in breaks.share])
        self.half_step_m = grid.half_step_m.numpy()
        self.cells = [(cell, float(lower), float(upper)) for cell, lower, upper in breaks.cells]
        self.inner = breaks.inner.numpy()

    def columns(self, values: Array) -> Array:
        """Values (..., L) of the levels in all columns (..., W): continued to the jumps, padded."""
        sides = values[..., self.base] + self.share * (values[..., self.base + 1] - values[..., self.base])
        padding = np.repeat(values[..., :1], self.width - self.n_levels - self.n_sides, -1)
        return np.ascontiguousarray(np.concatenate([values, sides, padding], -1))

    def fly(self, drag_n: Array, cas_mps: Array) -> tuple[Array, Array, Array, Array]:
        """Mach, true airspeed (m/s), rate (m/s, negative in descent) and its reciprocal, each (n, W)."""
        out = tuple(np.empty_like(drag_n) for _ in range(4))
        size = max(BLOCK_VALUES // self.width, 1)
        for start in range(0, len(drag_n), size):
            part = slice(start, start + size)
            here = tuple(torch.from_numpy(values[part]) for values in out)
            fused_rate(self.table, torch.from_numpy(drag_n[part]), torch.from_numpy(cas_mps[part]), here)
        return out[0], out[1], out[2], out[3]

    def seconds(self, slowness: Array) -> Array:
        """Time (n, L) from each level to the lowest, as a number that grows downwards from zero at the lowest."""
        levels = slowness[:, : self.n_levels]
        legs = (levels[:, 1:] + levels[:, :-1]) * self.half_step_m
        for column, (cell, lower, upper) in enumerate(self.cells):
            legs[:, cell] = levels[:, cell] * lower + levels[:, cell + 1] * upper
            for side in range(self.n_sides):
                legs[:, cell] += slowness[:, self.n_levels + side] * self.inner[side, column]
        return _summed(legs)

    def metres(self, tas_mps: Array, rate_mps: Array, seconds: Array) -> Array:
        """Distance through the air (n, L) in the same way: horizontal speed is taken as linear in time."""
        n = self.n_levels
        speed = np.sqrt(np.clip(tas_mps[:, :n] ** 2 - rate_mps[:, :n] ** 2, 0.0, None))
        return _summed(0.5 * (speed[:, 1:] + speed[:, :-1]) * np.diff(seconds, axis=1))

    def nearest(self, level_fl: float) -> int:
        """Index of the level nearest to a flight level."""
        return int(np.abs(self.levels_fl - level_fl).argmin())


def _summed(legs: Array) -> Array:
    total = np.zeros((len(legs), legs.shape[1] + 1))
    np.cumsum(legs, axis=1, out=total[:, 1:])
    return total
