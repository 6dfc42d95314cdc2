r"""Rates of single flights about the mean of their side, and their spread.

Rates are by altitude over time: the reported rate minus how late it is, so that no late report passes for brakes.

Normal flights of a side spread about that mean with

.. math:: S = S_0 + \varepsilon^2 I + l^2 m m^\top + w^2 I + t^2 K + s^2 K_\mathrm{short},

the covariance :math:`S_0` of the simulator's flights, a level m of all bands (mass), white noise, and smooth departures
of two lengths. The four sizes are the likeliest of a grid, each flight weighed by how surely it is normal. A simulator
whose flights hardly differ, down to a single trajectory, has :math:`S_0` near zero: the real side's spread is then
learnt whole.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
import torch

from descentflow.core.linear_gaussian import Array, Precisions
from descentflow.diagnosis.inference.moments import Moments
from descentflow.diagnosis.sides.assumptions import Assumptions
from descentflow.diagnosis.sides.two_sides import Compared


@dataclass(frozen=True)
class FlightRates:
    """ln of the rate of each flight about the mean of its side.

    Attributes:
        values: (n, m), zero where not seen.
        seen: (n, m).
        entries: (m,) positions among what is compared.
        bands: (m,).
    """

    values: Array
    seen: np.ndarray
    entries: np.ndarray
    bands: np.ndarray


def flight_rates(compared: Compared, known: Moments) -> FlightRates:
    """Take what is flown by each flight.

    Args:
        compared: Flights of both sides.
        known: Their moments.
    """
    entries = np.flatnonzero(known.quantity == "rate")
    bands = np.array([compared.entries[i].band for i in entries], dtype=int)
    late = compared.table("lag", torch.from_numpy(known.departures)).numpy()
    values = known.departures[:, entries] - np.nan_to_num(late[:, bands])
    seen = np.isfinite(values)
    return FlightRates(np.where(seen, values, 0.0), seen, entries, bands)


SPREAD_SWEEPS = 2
"""Sweeps over the four sizes."""


@dataclass(frozen=True)
class Spread:
    """Covariance of a simulator's flights and the shapes by which others may differ more.

    Attributes:
        base: (m, m).
        shapes: (m, m) each, of unit size.
        grid: Sizes that are tried.

    Example:
        >>> Spread(np.eye(2), (np.eye(2),), (0.0, 1.0)).at([1.0])[0, 0]
        np.float64(2.0)
    """

    base: Array
    shapes: tuple[Array, ...]
    grid: tuple[float, ...]

    def at(self, sizes: Sequence[float]) -> Array:
        """Covariance (m, m) at sizes."""
        return sum((size**2 * shape for size, shape in zip(sizes, self.shapes, strict=True)), self.base)

    def likeliest(self, values: Array, seen: np.ndarray, weight: Array, first: Sequence[float]) -> list[float]:
        """Sizes by coordinate ascent on a grid.

        Args:
            values: (n, m), zero where not seen.
            seen: (n, m).
            weight: (n,) how surely each flight is normal.
            first: Sizes at which to begin.
        """
        best = list(first)

        @cache
        def score(*sizes: float) -> float:
            return float(weight @ Precisions(self.at(sizes), seen).log_density(values))

        top = score(*best)
        for _ in range(SPREAD_SWEEPS):
            for k in range(len(self.shapes)):
                for size in self.grid:
                    tried = [*best[:k], size, *best[k + 1 :]]
                    if (value := score(*tried)) > top:
                        top, best = value, tried
        return best


def spread_of(values: Array, seen: np.ndarray, level: Array, kernel: Array, assumed: Assumptions) -> Spread:
    """Spread of a simulator's flights.

    Args:
        values: (n, m) of the simulator's flights, zero where not seen.
        seen: (n, m).
        level: (m,) of one more mass, in every band.
        kernel: (m, m) smooth correlation over altitude.
        assumed: Constants.

    Example:
        >>> values = np.random.default_rng(0).normal(size=(500, 3))
        >>> spread = spread_of(values, np.full((500, 3), True), np.ones(3), np.eye(3), Assumptions())
        >>> bool(np.allclose(spread.base.diagonal(), 1.0, atol=0.2))
        True
    """
    both = seen.T.astype(float) @ seen
    sample = values.T @ values / np.maximum(both - 1.0, 1.0)
    least, vectors = np.linalg.eigh(sample)
    positive = (vectors * np.maximum(least, 0.0)) @ vectors.T
    one = np.eye(len(sample))
    unit = level / np.sqrt((level**2).mean())
    shapes = (np.outer(unit, unit), one, kernel, kernel ** (1.0 / assumed.short**2))
    return Spread(positive + assumed.white**2 * one, shapes, assumed.wider)
