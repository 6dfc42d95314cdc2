r"""Speeds asked at levels as rows of linear conditions, in whichever way each is held.

Where speed is one CAS profile, a speed at a level is one row. Where the lower of a Mach number and a CAS is flown, a
band of it is met in one of two cases, of which no draw can be both,

.. math:: c \in [a, b],\ m \ge a \qquad\text{or}\qquad c > b,\ m \in [a, b],

with c the CAS and m that of the Mach number, which at a level is a Mach number too. Together they are
:math:`\min(c, m) \in [a, b]`; a value is a band of no width. Each way has two rows, linear in the latent numbers, so
that every Gaussian becomes as many as there are cases that hold all the speeds that are asked.
"""

from itertools import chain, product
from math import inf
from typing import NamedTuple

import numpy as np
import torch
from scipy.special import log_ndtr
from torch import Tensor

from descentflow.core.errors import ConfigError
from descentflow.core.units import FL_M
from descentflow.generation.conditional.constraints import SpeedAsked
from descentflow.generation.conditional.flown_profiles import Array, FlownProfiles
from descentflow.generation.conditional.latent_parts import LatentParts
from descentflow.generation.conditional.latent_profiles import LinearProfile
from descentflow.generation.conditional.speed_conditions import LEAST_SD, Rows
from descentflow.physics.airspeed import cas_to_mach, mach_to_cas_mps
from descentflow.representation.plausibility import Plausibility

NEVER = 1e6
"""CAS (m/s) that no descent has, which leaves a level of entry without probability."""
LEAST_LOG_SHARE = -40.0
"""Log probability of a way of holding a speed below which it is left out where the other way is more likely."""
MOST_CELLS = 40_000
"""Gaussians that are conditioned at once."""
STEP_MACH = 1e-4
"""Step over which the change of CAS with the Mach number is taken."""


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


class _Row(NamedTuple):
    """One row of each of C cells: (C, D), and (C,) at their means and as bounds."""

    matrix: Array
    centre: Array
    low: Array
    high: Array


def speed_cells(
    speeds: tuple[SpeedAsked, ...],
    parts: LatentParts,
    grid: FlownProfiles,
    component: np.ndarray,
    entry: np.ndarray,
    log_probs: Array,
    bounds: Plausibility | None,
) -> Cells:
    """Rows of the speeds for each Gaussian, level of entry and way of holding them; bands cut to the bounds.

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
        ConfigError: If there are more cases than can be conditioned at once.

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
    means, profiles = parts.means[component], parts.profiles
    held: list[list[tuple[_Row, ...]]] = []
    for k, lowest, highest in zip(level.T, low.T, high.T, strict=True):
        if profiles.mach is None:
            held.append([(_row(profiles.cas, means, k, np.ones(len(k)), lowest, highest),)])
        else:
            altitude = torch.from_numpy(grid.levels_fl[k] * FL_M)
            held.append(_either_way(profiles.cas, profiles.mach, means, k, altitude, lowest, highest))
    return _in_every_way(held, Cells(component, entry, log_probs, _stacked([], *means.shape), order), parts)


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


def _row(line: LinearProfile, means: Array, level: np.ndarray, unit: Array, low: Array, high: Array) -> _Row:
    """A profile at a level of each cell, times a unit (C,), between two bounds."""
    matrix = line.loadings[:, level].T * unit[:, None]
    return _Row(matrix, line.offset[level] * unit + (matrix * means).sum(1), low, high)


def _either_way(
    cas: LinearProfile, mach: LinearProfile, means: Array, level: np.ndarray, altitude: Tensor, low: Array, high: Array
) -> list[tuple[_Row, ...]]:
    """Split into held and free, where the CAS is held and where the Mach number is."""
    about = np.where(np.isfinite(high), np.minimum(high, NEVER), np.where(np.isfinite(low), low, 100.0))
    at = cas_to_mach(torch.from_numpy(about), altitude)
    faster, slower = (mach_to_cas_mps(at + step, altitude) for step in (STEP_MACH, -STEP_MACH))
    # In m/s, so that a value's density is per m/s in either way.
    unit, one = ((faster - slower) / (2 * STEP_MACH)).numpy(), np.ones(len(level))

    def number(cas_mps: Array) -> Array:
        """The Mach number of a CAS at the level, in those units."""
        known = np.where(np.isfinite(cas_mps), cas_mps, about)
        found: Array = unit * cas_to_mach(torch.from_numpy(known), altitude).numpy()
        return np.where(np.isfinite(cas_mps), found, cas_mps)

    no_end, beyond = np.full(len(level), inf), np.minimum(high, NEVER)
    return [
        (_row(cas, means, level, one, low, high), _row(mach, means, level, unit, number(low), no_end)),
        (_row(mach, means, level, unit, number(low), number(high)), _row(cas, means, level, one, beyond, no_end)),
    ]


def _in_every_way(held: list[list[tuple[_Row, ...]]], plain: Cells, parts: LatentParts) -> Cells:
    """The cells once for each way of holding all speeds: rows of what is held first, then of what is not."""
    likely = [_likely(ways, parts.roots[plain.component]) for ways in held]
    found: list[Cells] = []
    for ways in product(*(range(len(one)) for one in held)):
        kept = np.ones(len(plain.entry), dtype=bool)
        for number, way in enumerate(ways):
            kept &= likely[number][way]
        rows = list(chain(*zip(*(held[number][way] for number, way in enumerate(ways)), strict=True)))
        index = np.flatnonzero(kept)
        chosen = _stacked([_Row(*(values[index] for values in row)) for row in rows], len(index), parts.means.shape[1])
        asked = plain.asked * (len(rows) // max(len(held), 1))
        found.append(Cells(plain.component[index], plain.entry[index], plain.log_probs[index], chosen, asked))
    total = sum(len(cells.entry) for cells in found)
    if total > MOST_CELLS:
        raise ConfigError(
            f"{len(held)} speeds at once of a model that holds each as a Mach number or as a CAS, in {total} cases",
            expected=f"at most {MOST_CELLS} cases, of all components and levels of entry",
            mend="ask for fewer speeds, or give entry_fl as well",
        )
    if len(found) == 1:
        return found[0]
    rows_of_all = Rows(*(np.concatenate(values) for values in zip(*(cells.rows for cells in found), strict=True)))
    component, entry, log_probs = (np.concatenate([cells[k] for cells in found]) for k in range(3))
    return Cells(component, entry, log_probs, rows_of_all, found[0].asked)


def _likely(ways: list[tuple[_Row, ...]], roots: Array) -> list[np.ndarray]:
    """For each way of holding a speed, the cells (C,) in which it can be: what is not held may be where it must be."""
    if len(ways) == 1:
        return [np.ones(len(roots), dtype=bool)]
    shares = []
    for _, beside in ways:
        sd = np.linalg.norm((beside.matrix[:, None] @ roots)[:, 0], axis=1)
        shares.append(log_ndtr((beside.centre - beside.low) / np.maximum(sd, LEAST_SD)))
    most = np.maximum(*shares)
    return [(share >= LEAST_LOG_SHARE) | (share == most) for share in shares]


def _stacked(rows: list[_Row], n_cells: int, size: int) -> Rows:
    """Rows (C, J, D) and (C, J)."""
    if not rows:
        return Rows(np.zeros((n_cells, 0, size)), *(np.zeros((n_cells, 0)) for _ in range(3)))
    return Rows(*(np.stack(values, 1) for values in zip(*rows, strict=True)))
