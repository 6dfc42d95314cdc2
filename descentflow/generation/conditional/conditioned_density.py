"""Density conditioned on a request, from which its descents are drawn."""

from dataclasses import replace

import numpy as np
import torch
from scipy.special import ndtri
from torch import Tensor

from descentflow.densities.density import Density
from descentflow.densities.transformed import TransformedDensity
from descentflow.generation.conditional.entry_shares import EntryShares
from descentflow.generation.conditional.flown_profiles import Array, FlownProfiles
from descentflow.generation.conditional.latent_draws import ConditionedTarget, Drawn
from descentflow.generation.conditional.latent_parts import LatentParts
from descentflow.generation.conditional.latent_profiles import LatentProfiles
from descentflow.generation.conditional.point_condition import Flown, PointCondition
from descentflow.generation.conditional.requests import Request
from descentflow.generation.conditional.speed_cells import NothingPlausible, speed_cells
from descentflow.generation.conditional.speed_conditions import LEAST_TAIL, conditions
from descentflow.representation.plausibility import Plausibility


class FreeTarget:
    """Draws of a density that is no mixture, where nothing but entry and context is asked.

    Args:
        density: What the weights are drawn from.
        grid: Of its decoder.
        profiles: Of samples, see :func:`~descentflow.generation.conditional.latent_parts.sample_profiles`.
        log_entries: (L,) log shares of the levels of entry.
        context: (1, c) of the density; None if it takes none.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> from descentflow.generation.conditional.latent_parts import sample_profiles
        >>> model = load_model("best.ckpt")
        >>> decoder = model.representation.decoder
        >>> grid = FlownProfiles(decoder)
        >>> log_entries = np.where(np.arange(grid.n_levels) == grid.nearest(330), 0.0, -np.inf)
        >>> target = FreeTarget(model, grid, sample_profiles(decoder, grid), log_entries, None)
        >>> drawn = target.draw(np.full((1, target.width), 0.5))
        >>> bool(grid.levels_fl[drawn.entry[0]] == 330)
        True
        >>> drawn.u.shape == (1, target.width - 2), np.allclose(drawn.u[:, model.dimension :], 0.0)
        (True, True)
    """

    def __init__(
        self,
        density: Density,
        grid: FlownProfiles,
        profiles: LatentProfiles,
        log_entries: Array,
        context: Tensor | None,
    ) -> None:
        """Hold what is drawn of."""
        self.density, self.grid, self.profiles, self.context = density, grid, profiles, context
        self.up_to = np.exp(log_entries).cumsum()
        self.width = 2 + len(profiles.drag.loadings)

    in_closed_form = True

    @torch.no_grad()
    def draw(self, uniform: Array) -> Drawn:
        """One draw for each row."""
        d = self.density.dimension
        entry = np.searchsorted(self.up_to, uniform[:, 1] * self.up_to[-1], side="right")
        white = ndtri(uniform[:, 2:])
        rows = None if self.context is None else self.context.expand(len(uniform), -1)
        if isinstance(self.density, TransformedDensity):
            weights = self.density.of_white(torch.from_numpy(white[:, :d].copy()), rows)
        else:
            # Of any other density a number can be drawn by a seed alone.
            seeds = (uniform[:, 0] * 2**53).astype(np.int64).tolist()
            weights = torch.cat([self.density.sample(1, seed, self.context) for seed in seeds])
        u = np.concatenate([weights.double().numpy(), white[:, d:]], 1)
        flown = Flown.of(self.grid, self.profiles.of(u))
        return Drawn(u, np.minimum(entry, self.grid.n_levels - 1), flown, np.zeros(len(u)))


def conditioned_target(
    request: Request, parts: LatentParts, grid: FlownProfiles, shares: EntryShares, bounds: Plausibility
) -> ConditionedTarget:
    """The density's Gaussians given a request.

    Args:
        request: As checked by :meth:`Request.check`.
        parts: The density, before or after what was flown.
        grid: Of its decoder.
        shares: Of levels of entry and of components.
        bounds: Of the training flights, to which bands are cut unless something was flown.

    Raises:
        NothingPlausible: If a speed is beyond the bounds of the training flights, or as rare as no flight.

    Example:
        >>> from descentflow.core.units import KT_MPS
        >>> from descentflow.densities.checkpoint import load_model
        >>> from descentflow.generation.conditional.constraints import SpeedAsked
        >>> from descentflow.generation.conditional.latent_parts import parts_of
        >>> model = load_model("best.ckpt")
        >>> grid, bounds = FlownProfiles(model.representation.decoder), model.representation.plausibility
        >>> level = grid.nearest(200)
        >>> request = Request(grid.nearest(330), (SpeedAsked("cas_kt", level, 280.0, 280.0),))
        >>> target = conditioned_target(request, parts_of(model, grid, None), grid, EntryShares(model), bounds)
        >>> drawn = target.draw(np.full((1, target.width), 0.4))
        >>> round(float(drawn.flown.cas[0, level]) / KT_MPS, 6)  # kt
        280.0
    """
    entries = _entries(request, shares)
    if not len(entries):
        raise NothingPlausible(max(request.speeds, key=lambda speed: speed.level))
    n_components = len(parts.means)
    component, entry = np.tile(np.arange(n_components), len(entries)), np.repeat(entries, n_components)
    log_probs = np.concatenate([_log_shares(request, parts, shares, int(e)) for e in entries])
    bounds_asked = None if request.flown is not None else bounds
    cells = speed_cells(request.speeds, parts, grid, component, entry, log_probs, bounds_asked)
    own = replace(parts, means=parts.means[cells.component], roots=parts.roots[cells.component])
    speeds = conditions(cells.log_probs, own.means, own.roots, cells.rows)
    for speed, tail in zip(cells.asked, speeds.tails, strict=True):
        if not tail >= LEAST_TAIL:
            raise NothingPlausible(speed)
    point = None
    if request.point is not None:
        point = PointCondition(request.point, own, grid, int(entries[0]), speeds)
        if not point.tail >= LEAST_TAIL:
            raise NothingPlausible(None)
    return ConditionedTarget(parts, grid, cells.component, cells.entry, speeds, point)


def _entries(request: Request, shares: EntryShares) -> np.ndarray:
    """Levels of entry that the request leaves open."""
    if request.entry is not None:
        return np.array([request.entry])
    lowest = max((speed.level for speed in request.speeds), default=-1)
    return np.flatnonzero(np.isfinite(shares.log_entries) & (np.arange(len(shares.log_entries)) >= lowest))


def _log_shares(request: Request, parts: LatentParts, shares: EntryShares, entry: int) -> Array:
    """Log shares (K,) of the components that enter at a level, up to a constant of the request."""
    own = None if request.flown is not None else shares.log_components(entry)
    log_entry = 0.0 if request.entry is not None else shares.log_entries[entry]
    found: Array = (parts.log_probs if own is None else own) + log_entry
    return found
