"""Flights drawn from a Gaussian with the covariance of measured ones: as many nulls as a test wants, at no cost."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import torch
from torch import Tensor

from descentflow.diagnosis.sides.two_sides import Compared


@dataclass(frozen=True)
class FlightLaw:
    """Covariance roots of what aircraft have in common and of what flights add, with the flights it was learnt from."""

    measured: Compared
    of_aircraft: Tensor
    of_flights: Tensor

    @classmethod
    def of(cls, measured: Compared) -> "FlightLaw":
        """Moments of pairs of flights of one aircraft, and of flights."""
        y = measured.y - measured.y.nanmean(0)
        z, seen = y.nan_to_num(0.0), y.isfinite().double()
        whole = (z.T @ z) / (seen.T @ seen).clamp(min=1)
        _, index = torch.unique(measured.airframe, return_inverse=True)
        count = int(index.max()) + 1
        total = torch.zeros(count, y.shape[1], dtype=y.dtype).index_add_(0, index, z)
        there = torch.zeros(count, y.shape[1], dtype=y.dtype).index_add_(0, index, seen)
        pairs = (there.T @ there - seen.T @ seen).clamp(min=1)
        shared = (total.T @ total - z.T @ z) / pairs
        scale = whole.diagonal().sqrt()
        unit = scale[:, None] * scale
        return cls(measured, scale[:, None] * _root(shared / unit), scale[:, None] * _root((whole - shared) / unit))

    def draw(self, simulated: Sequence[int], real: Sequence[int], seed: int, speeds: int | None = None) -> Compared:
        """Flights of aircraft with so many flights each, on both sides of one population.

        What a flight does not show is as in a measured flight, whose speeds it also has; those are drawn by the seed
        ``speeds``, if given.
        """
        sizes = torch.tensor([*simulated, *real])
        airframe = torch.arange(len(sizes)).repeat_interleave(sizes)
        n, p = len(airframe), self.measured.y.shape[1]
        chosen = torch.Generator().manual_seed(seed if speeds is None else speeds)
        like = torch.randint(len(self.measured.y), (n,), generator=chosen)
        generator = torch.Generator().manual_seed(seed + 10**6)
        common = torch.randn(len(sizes), p, generator=generator, dtype=torch.float64) @ self.of_aircraft.T
        own = torch.randn(n, p, generator=generator, dtype=torch.float64) @ self.of_flights.T
        y = torch.where(self.measured.y[like].isfinite(), common[airframe] + own, torch.nan)
        is_real = torch.arange(n) >= sum(simulated)
        return replace(self.measured, y=y, real=is_real, airframe=airframe, state=self.measured.state.rows(like))


def _root(matrix: Tensor) -> Tensor:
    """Root of the nearest positive semidefinite matrix."""
    values, vectors = torch.linalg.eigh((matrix + matrix.T) / 2)
    return vectors * values.clamp(min=0.0).sqrt()
