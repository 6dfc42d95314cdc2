"""Speeds asked at levels as rows of linear conditions on a CAS profile: one row for each."""

from math import inf
from typing import NamedTuple

import numpy as np

from descentflow.generation.conditional.constraints import SpeedAsked
from descentflow.generation.conditional.flown_profiles import Array, FlownProfiles
from descentflow.generation.conditional.latent_parts import LatentParts
from descentflow.generation.conditional.speed_conditions import Rows
from descentflow.representation.plausibility import Plausibility

NEVER = 1e6
"""CAS (m/s) that no descent has, which leaves a level of entry without probability."""


class NothingPlausible(Exception):
    """A request that the model knows no flight for; ``culprit`` is what cannot be met: a speed, or None for a point.

    Example:
        >>> try:
        ...     raise NothingPlausible(SpeedAsked("cas_kt", 50, 500.0, 500.0))
        ... except NothingPlausible as error:
        ...     error.culprit.text(200.0)
        'cas_kt 500 at FL200'
    """

    def __init__(self, culprit: SpeedAsked | None) -> None:
        """Say what cannot be met."""
        super().__init__(culprit)
        self.culprit = culprit


class Cells(NamedTuple):
    """C Gaussians before they are conditioned, and the rows of each.

    Attributes:
        component: (C,) which of the density's Gaussians each is.
        entry: (C,) index of its level of entry.
        log_probs: (C,) log shares, up to a constant.
        rows: Of each.
        asked: The speed that each row is of.

    Example:
        >>> none = np.zeros(1, int)
        >>> rows = Rows(np.zeros((1, 0, 4)), *(np.zeros((1, 0)) for _ in range(3)))
        >>> Cells(none, none, np.zeros(1), rows, ()).rows.n_rows
        0
    """

    component: np.ndarray
    entry: np.ndarray
    log_probs: Array
    rows: Rows
    asked: tuple[SpeedAsked, ...]


def speed_cells(
    speeds: tuple[SpeedAsked, ...],
    parts: LatentParts,
    grid: FlownProfiles,
    component: np.ndarray,
    entry: np.ndarray,
    log_probs: Array,
    bounds: Plausibility | None,
) -> Cells:
    """Rows of the speeds for each Gaussian and level of entry; bands cut to the bounds.

    Args:
        speeds: What is asked.
        parts: The density.
        grid: Of its decoder.
        component: (C,) which of the density's Gaussians each cell is of.
        entry: (C,) index of its level of entry.
        log_probs: (C,) log shares, up to a constant.
        bounds: Of the training flights; None for no bounds.

    Raises:
        NothingPlausible: If a speed is beyond the bounds.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> from descentflow.generation.conditional.latent_parts import parts_of
        >>> model = load_model("best.ckpt")
        >>> grid, bounds = FlownProfiles(model.representation.decoder), model.representation.plausibility
        >>> asked, zero = (SpeedAsked("cas_kt", grid.nearest(200), 270.0, 280.0),), np.zeros(1, int)
        >>> speed_cells(asked, parts_of(model, grid, None), grid, zero, zero + 180, np.zeros(1), bounds).rows.n_rows
        1
    """
    # Values before bands.
    order = tuple(sorted(speeds, key=lambda speed: speed.low < speed.high))
    level, low, high = _asked(order, grid, entry, bounds)
    cas, means = parts.profiles.cas, parts.means[component]
    matrix = cas.loadings.T[level]
    centre = cas.offset[level] + (matrix * means[:, None]).sum(2)
    return Cells(component, entry, log_probs, Rows(matrix, centre, low, high), order)


def _asked(
    order: tuple[SpeedAsked, ...], grid: FlownProfiles, entry: np.ndarray, bounds: Plausibility | None
) -> tuple[np.ndarray, Array, Array]:
    """Level, lowest and highest CAS (m/s) of each speed for each cell (C, J)."""
    level = np.zeros((len(entry), len(order)), dtype=int)
    low, high = (np.zeros(level.shape) for _ in range(2))
    for j, speed in enumerate(order):
        level[:, j] = speed.level if speed.level >= 0 else entry
        for k in np.unique(level[:, j]):
            lowest, highest = speed.cas_mps(float(grid.levels_fl[k]))
            least, most = (-inf, inf) if bounds is None else (float(bounds.cas_low[k]), float(bounds.cas_high[k]))
            if lowest < highest:
                lowest, highest = max(lowest, least), min(highest, most)
            if lowest > highest or not least <= lowest <= highest <= most:
                if len(np.unique(level[:, j])) == 1:
                    raise NothingPlausible(speed)
                lowest, highest = NEVER, NEVER  # no descent of this level of entry
            at = level[:, j] == k
            low[at, j], high[at, j] = lowest, highest
    return level, low, high
