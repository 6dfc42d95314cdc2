"""Density given a request, from which its descents are drawn."""

from dataclasses import replace
from math import inf

import numpy as np
import torch
from scipy.special import ndtri
from torch import Tensor

from descentflow.densities.density import Density
from descentflow.densities.gaussian import TransformedDensity
from descentflow.generation.conditional._draws import NothingPlausible, Proposed
from descentflow.generation.conditional._latent_density import Array, LatentDensity
from descentflow.generation.conditional._point_condition import PointCondition
from descentflow.generation.conditional._speed_conditions import (
    LEAST_TAIL,
    Conditions,
    Rows,
    conditions,
    gain_of,
    log_total,
)
from descentflow.generation.conditional.constraints import DescentRequest, SpeedAsked
from descentflow.representation.decoder.descent_decoder import DescentDecoder
from descentflow.representation.decoder.trajectories import Trajectories
from descentflow.representation.plausibility import Plausibility

UNFLOWN_CAS_MPS = 1e6
"""CAS (m/s) that no descent has, which leaves a level of entry without probability."""
PROPOSALS, PROPOSALS_OF_A_STAND_IN = 16, 256
"""Proposals for one weighted draw; more where Gaussians stand in for a density that is no mixture."""


class FreeTarget:
    """Draws of a density that is no mixture, where nothing but entry and context is asked.

    Args:
        density: What the weights are drawn from.
        request: Of an entry and a context alone.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> model = load_model("best.ckpt")
        >>> target = FreeTarget(model, DescentRequest(entry=180))
        >>> proposed = target.propose(np.full((1, target.width), 0.5))
        >>> proposed.entry, proposed.u.shape[1] == model.dimension + target.decoder.residuals.n_numbers
        (tensor([180]), True)
    """

    proposals = 1

    def __init__(self, density: Density, request: DescentRequest) -> None:
        """Tabulate the shares of levels of entry."""
        self.density, self.context, self.decoder = density, request.context, density.representation.decoder
        shares = np.exp(entry_shares(density.representation.plausibility))
        if request.entry >= 0:
            shares = (np.arange(len(shares)) == request.entry).astype(np.float64)
        self.up_to = shares.cumsum()
        self.width = 3 + self.decoder.dimension

    @torch.no_grad()
    def propose(self, uniform: Array) -> Proposed:
        """One proposal for each row."""
        d, density = self.density.dimension, self.density
        index = np.searchsorted(self.up_to, uniform[:, 0] * self.up_to[-1], side="right")
        entry = torch.from_numpy(np.minimum(index, len(self.up_to) - 1))
        white = torch.from_numpy(ndtri(uniform[:, 2 : 2 + d]))
        if isinstance(density, TransformedDensity):
            weights = density.of_white(white, self.context.expand(len(uniform), -1)).double()
        else:
            # Of any other density a number can be drawn by a seed alone.
            seeds = (uniform[:, 1] * 2**53).astype(np.int64).tolist()
            weights = torch.cat([density.sample(1, seed, self.context) for seed in seeds]).double()
        residual = self.decoder.residuals.draw(weights, entry, torch.from_numpy(uniform[:, 2 + d]))
        return Proposed(torch.cat([weights, residual], 1), entry, np.zeros(len(uniform)))

    def fly(self, u: Tensor, entry: Tensor) -> Trajectories:
        """Descents of weights and residual numbers (n, D)."""
        d = self.decoder.dimension
        flown: Trajectories = self.decoder(u[:, :d], entry, residual=u[:, d:])
        return flown


class ConditionedTarget:
    """Gaussians given speeds and perhaps a point.

    Args:
        latent: The density as C Gaussians.
        entry: (C,) index of the level of entry of each.
        speeds: The C Gaussians given the speeds.
        points: The same given a time or a distance, or none.
        decoder: Flies them.
    """

    def __init__(
        self,
        latent: LatentDensity,
        entry: Array,
        speeds: Conditions,
        points: tuple[PointCondition, ...],
        decoder: DescentDecoder,
    ) -> None:
        """Hold what was conditioned."""
        self.latent, self.entry, self.speeds = latent, entry, speeds
        self.points, self.decoder = points, decoder
        self.width = 4 + latent.means.shape[1] + speeds.rows.n_rows
        self.held_gain, _ = gain_of(latent.weights_alone, speeds.rows)
        shares = points[0].log_probs if points else speeds.log_probs
        # Cells are Gaussians, level of entry by level of entry.
        by_entry = np.exp(shares - log_total(shares)).reshape(len(np.unique(entry)), -1)
        self.up_to = by_entry.sum(1).cumsum()
        self.of_entry = by_entry.cumsum(1) / np.maximum(by_entry.sum(1, keepdims=True), 1e-300)
        equal = speeds.in_closed_form and not points
        self.proposals = PROPOSALS_OF_A_STAND_IN if latent.prior.exact is not None else 1 if equal else PROPOSALS

    @torch.no_grad()
    def propose(self, uniform: Array) -> Proposed:
        """One proposal for each row."""
        row = np.minimum(np.searchsorted(self.up_to, uniform[:, 0], side="right"), len(self.up_to) - 1)
        cell = row * self.of_entry.shape[1] + (uniform[:, -2, None] > self.of_entry[row, :-1]).sum(1)
        end, entry = 2 + self.latent.means.shape[1], torch.from_numpy(self.entry[cell])
        u = (self.latent.roots[cell] @ ndtri(uniform[:, 2:end])[:, :, None])[:, :, 0]
        u, log_weight = self.speeds.meet(cell, u, uniform[:, end:-2])
        # With another residual the weights meet the same speeds.
        own = self.latent.with_residuals(cell, entry, u, uniform[:, -1])
        off = self.speeds.rows.matrix[cell] @ (u - own)[:, :, None]
        u = own + (self.held_gain[cell] @ off)[:, :, 0]
        whole = torch.from_numpy(u + self.latent.means[cell])
        for point in self.points:
            whole, more = point.meet(cell, u, uniform[:, 1])
            log_weight = log_weight + more
        return Proposed(whole, entry, log_weight + self.latent.log_ratio(whole))

    def fly(self, u: Tensor, entry: Tensor) -> Trajectories:
        """Descents of latent numbers (n, D)."""
        return self.decoder.fly_scaled(self.latent.curves.scaled_profiles(u), entry)


def conditioned_target(request: DescentRequest, latent: LatentDensity, density: Density) -> ConditionedTarget:
    """The density's Gaussians given a request.

    Args:
        request: As checked by :meth:`DescentRequest.check`.
        latent: The density, before or after what was flown.
        density: Itself; bands are cut to the bounds of its training flights unless something was flown.

    Raises:
        NothingPlausible: If a speed is beyond the bounds of the training flights, or as rare as no flight.

    Example:
        >>> from descentflow.core.units import KT_MPS
        >>> from descentflow.densities.checkpoint import load_model
        >>> from descentflow.generation.conditional._latent_density import LatentDensities
        >>> model = load_model("best.ckpt")
        >>> request = DescentRequest(180, (SpeedAsked("cas_kt", 50, 280.0, 280.0),))
        >>> target = conditioned_target(request, LatentDensities(model).before(), model)
        >>> proposed = target.propose(np.full((1, target.width), 0.4))
        >>> round(float(target.fly(proposed.u, proposed.entry).cas_mps[0, 50]) / KT_MPS, 6)  # kt
        280.0
    """
    parts = density.representation
    decoder, levels_fl = parts.decoder, parts.decoder.levels_fl.numpy()
    log_entries = entry_shares(parts.plausibility)
    entries = _entries(request, log_entries)
    if not len(entries):
        raise NothingPlausible(max(request.speeds, key=lambda speed: speed.level))
    n = len(latent.means)
    component, entry = np.tile(np.arange(n), len(entries)), np.repeat(entries, n)
    own = np.tile(latent.log_probs, len(entries))
    shares = own if request.entry >= 0 else own + log_entries[entry]
    # Values before bands.
    asked = tuple(sorted(request.speeds, key=lambda speed: speed.low < speed.high))
    bounds = parts.plausibility.cas_low.numpy(), parts.plausibility.cas_high.numpy()
    if request.goes_on:
        bounds = np.full_like(levels_fl, -inf), np.full_like(levels_fl, inf)
    level, low, high = _asked(asked, levels_fl, entry, *bounds)
    cells = replace(latent, means=latent.means[component], roots=latent.roots[component])
    offset, loadings = latent.cas
    matrix = loadings.T[level]
    rows = Rows(matrix, offset[level] + (matrix @ cells.means[:, :, None])[:, :, 0], low, high)
    speeds = conditions(shares, cells.means, cells.roots, rows)
    for speed, tail in zip(asked, speeds.tails, strict=True):
        if not tail >= LEAST_TAIL:
            raise NothingPlausible(speed)

    points = tuple(PointCondition(cells, decoder, request, speeds) for _ in request.points)
    for point in points:
        if not point.tail >= LEAST_TAIL:
            raise NothingPlausible(point.asked)
    return ConditionedTarget(cells, entry, speeds, points, decoder)


def entry_shares(bounds: Plausibility) -> Array:
    """Log shares (L,) of the levels of entry of training flights.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> bool(np.isclose(np.exp(entry_shares(load_model("best.ckpt").representation.plausibility)).sum(), 1.0))
        True
    """
    counts = bounds.entry_counts.cpu().double().numpy()
    with np.errstate(divide="ignore"):
        log_shares: Array = np.log(counts / counts.sum())
    return log_shares


def _entries(request: DescentRequest, log_entries: Array) -> np.ndarray:
    """Levels of entry that the request leaves open."""
    if request.entry >= 0:
        return np.array([request.entry])
    lowest = max((speed.level for speed in request.speeds), default=-1)
    return np.flatnonzero(np.isfinite(log_entries) & (np.arange(len(log_entries)) >= lowest))


def _asked(
    order: tuple[SpeedAsked, ...], levels_fl: Array, entry: np.ndarray, cas_low: Array, cas_high: Array
) -> tuple[np.ndarray, Array, Array]:
    """Level, lowest and highest CAS (m/s) of each speed for each cell (C, J)."""
    level = np.zeros((len(entry), len(order)), dtype=int)
    low, high = (np.zeros(level.shape) for _ in range(2))
    for j, speed in enumerate(order):
        level[:, j] = speed.level if speed.level >= 0 else entry
        for k in np.unique(level[:, j]):
            lowest, highest = speed.cas_mps(float(levels_fl[k]))
            least, most = float(cas_low[k]), float(cas_high[k])
            if lowest < highest:
                lowest, highest = max(lowest, least), min(highest, most)
            if lowest > highest or not least <= lowest <= highest <= most:
                if len(np.unique(level[:, j])) == 1:
                    raise NothingPlausible(speed)
                lowest, highest = UNFLOWN_CAS_MPS, UNFLOWN_CAS_MPS  # no descent of this level of entry
            at = level[:, j] == k
            low[at, j], high[at, j] = lowest, highest
    return level, low, high
