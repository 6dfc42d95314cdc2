"""Descents of given profiles, with the same bits for a draw in whatever batch it is.

Products of matrices sum in another order in another batch, and torch takes the last few numbers of an array by another
routine than the others: both change the last digit. Here rows are as wide as full vectors, with the sides of the rate's
jumps in what would be padding, and profiles are summed number by number
(:mod:`~descentflow.generation.conditional.latent_profiles`).
"""

from copy import copy

import numpy as np
import torch
from numpy.typing import NDArray

from descentflow.core.units import FL_M
from descentflow.generation.given_temperature import airspeed_ratio
from descentflow.physics.level_table import level_rate, level_table
from descentflow.representation.decoder.descent_decoder import DescentDecoder
from descentflow.representation.decoder.flight_grid import flight_grid
from descentflow.representation.decoder.trajectories import climbed_s

Array = NDArray[np.float64]
VECTOR = 16
"""Numbers that torch takes at a time on any processor, or a multiple of them."""
BLOCK_VALUES = 1 << 15
"""Values of a quantity below which torch gives an array to one thread; rows of a block stay in its caches."""


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
        self.grid = flight_grid(decoder.aircraft, altitude_m)
        breaks = self.grid.breaks
        self.levels_fl, self.n_levels, self.n_sides = levels.numpy(), len(levels), len(breaks.base)
        self.width = -(-(self.n_levels + self.n_sides) // VECTOR) * VECTOR
        padding = self.width - self.n_levels - self.n_sides
        columns_m = torch.cat([altitude_m, breaks.altitude_m, altitude_m[:1].expand(padding)])
        self.table = level_table(decoder.aircraft, columns_m)
        self.base, self.share = np.array(breaks.base, dtype=int), np.array([float(s) for s in breaks.share])
        self.airspeed_ratio = np.ones(self.width)
        self.drag_scale = decoder.drag_scale

    def in_air(self, deviation_k: float) -> "FlownProfiles":
        """The same grid with distances in air of another temperature: at the same Mach number, which sets the rate."""
        if deviation_k == 0.0:
            return self
        found = copy(self)
        found.airspeed_ratio = self.columns(
            airspeed_ratio(torch.tensor([deviation_k], dtype=torch.float64), torch.from_numpy(self.levels_fl)).numpy()
        )[0]
        return found

    def columns(self, values: Array) -> Array:
        """Values (..., L) of the levels in all columns (..., W): continued to the jumps, padded."""
        sides = values[..., self.base] + self.share * (values[..., self.base + 1] - values[..., self.base])
        padding = np.repeat(values[..., :1], self.width - self.n_levels - self.n_sides, -1)
        return np.ascontiguousarray(np.concatenate([values, sides, padding], -1))

    def drag_n(self, linear: Array, cas_mps: Array) -> Array:
        """Drag in N (n, W) of profiles that are linear in latent numbers (n, W), on the decoder's scale, at a CAS."""
        # At the jumps of the rate, the drag at the levels is continued, as the decoder does.
        return self.columns(self.drag_scale.drag_n(*self._at_levels(linear, cas_mps)).numpy())

    def drag_slope(self, linear: Array, cas_mps: Array) -> Array:
        """Change of the drag in N (n, W) with such profiles."""
        return self.columns(self.drag_scale.slope(*self._at_levels(linear, cas_mps)).numpy())

    def _at_levels(self, *columns: Array) -> list[torch.Tensor]:
        return [torch.from_numpy(values[:, : self.n_levels]) for values in columns]

    def fly(self, drag_n: Array, cas_mps: Array) -> tuple[Array, Array, Array, Array]:
        """Mach, true airspeed (m/s), rate (m/s, negative in descent) and its reciprocal, each (n, W).

        Args:
            drag_n: (n, W).
            cas_mps: (n, W).
        """
        out = tuple(np.empty_like(drag_n) for _ in range(4))
        for part in self._blocks(len(drag_n)):
            here = tuple(torch.from_numpy(values[part]) for values in out)
            level_rate(self.table, torch.from_numpy(drag_n[part]), torch.from_numpy(cas_mps[part]), out=here)
        return out[0], out[1], out[2], out[3]

    def _blocks(self, n: int) -> list[slice]:
        size = max(BLOCK_VALUES // self.width, 1)
        return [slice(start, start + size) for start in range(0, n, size)]

    def seconds(self, slowness: Array) -> Array:
        """Time (n, L) from each level to the lowest, as a number that grows downwards from zero at the lowest.

        Args:
            slowness: (n, W) of :meth:`fly`.
        """
        levels, sides = (torch.from_numpy(part) for part in np.split(slowness, [self.n_levels], 1))
        return climbed_s(self.grid, levels, sides).numpy()

    def metres(self, tas_mps: Array, rate_mps: Array, seconds: Array) -> Array:
        """Distance through the air (n, L) in the same way: horizontal speed is taken as linear in time."""
        n = self.n_levels
        speed = np.sqrt(np.clip((tas_mps[:, :n] * self.airspeed_ratio[:n]) ** 2 - rate_mps[:, :n] ** 2, 0.0, None))
        return _summed(0.5 * (speed[:, 1:] + speed[:, :-1]) * np.diff(seconds, axis=1))

    def nearest(self, level_fl: float) -> int:
        """Index of the level nearest to a flight level."""
        return int(np.abs(self.levels_fl - level_fl).argmin())


def _summed(legs: Array) -> Array:
    total = np.zeros((len(legs), legs.shape[1] + 1))
    np.cumsum(legs, axis=1, out=total[:, 1:])
    return total
