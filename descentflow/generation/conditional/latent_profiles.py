"""Drag and speed as linear functions of latent numbers, with the same bits for a draw in whatever batch it is."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from descentflow.generation.conditional.flown_profiles import Array


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


class Curves(NamedTuple):
    """Profiles (n, W) of n descents: drag (N, on the decoder's scale) and CAS (m/s).

    Example:
        >>> one = Curves(np.array([[9000.0]]), np.array([[140.0]]))
        >>> one.moved(2.0, Curves(np.array([[200.0]]), np.array([[0.5]])))
        Curves(drag=array([[9400.]]), cas=array([[141.]]))
    """

    drag: Array
    cas: Array

    def moved(self, s: Array | float, change: "Curves") -> "Curves":
        """Moved by s (n, 1) times a change."""
        return Curves(self.drag + s * change.drag, self.cas + s * change.cas)

    def rows(self, index: np.ndarray) -> "Curves":
        """Of the descents at these positions."""
        return Curves(self.drag[index], self.cas[index])


@dataclass(frozen=True)
class LatentProfiles:
    """The profiles that latent numbers (n, D) make.

    Attributes:
        drag: Of N, on the scale of the decoder, see :class:`~descentflow.representation.drag_scale.DragScale`.
        cas: Of m/s.

    Example:
        >>> line = LinearProfile(np.zeros(2), np.array([[1.0, 2.0]]))
        >>> LatentProfiles(line, line).of(np.array([[3.0]])).cas
        array([[3., 6.]])
    """

    drag: LinearProfile
    cas: LinearProfile

    def of(self, u: Array) -> Curves:
        """Profiles of (n, D)."""
        return Curves(self.drag.of(u), self.cas.of(u))

    def change(self, direction: Array) -> Curves:
        """Change of the profiles along directions (n, D)."""
        return Curves(self.drag.change(direction), self.cas.change(direction))
