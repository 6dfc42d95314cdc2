"""A Gaussian over vectors with missing entries: covariance by EM, and precision matrices by pattern of what is seen."""

from dataclasses import dataclass

import torch
from torch import Tensor

ITERATIONS = 6
"""Of EM; what is missing is mostly the top of the grid, and its neighbours say nearly all of it."""


@dataclass(frozen=True)
class Whitening:
    """Precision of what each flight shows.

    Shapes: ``pattern`` (n,) index of each flight's pattern, ``precision`` (patterns, p, p) zero where an entry is missing,
    ``covariance`` (p, p).
    """

    pattern: Tensor
    precision: Tensor
    covariance: Tensor

    def apply(self, values: Tensor) -> Tensor:
        """Precision times values: (n, p) or (n, p, k) of the flights, missing entries anything finite."""
        flat = values if values.dim() == 3 else values[..., None]
        found = torch.empty_like(flat)
        for k in range(len(self.precision)):
            at = torch.nonzero(self.pattern == k)[:, 0]
            if len(at):
                part = flat[at]
                stacked = self.precision[k] @ part.permute(1, 0, 2).reshape(part.shape[1], -1)
                found[at] = stacked.reshape(part.shape[1], len(at), -1).permute(1, 0, 2)
        return found if values.dim() == 3 else found[..., 0]

    def rows(self, index: Tensor) -> "Whitening":
        """Of the flights at these positions."""
        return Whitening(self.pattern[index], self.precision, self.covariance)

    def total(self, chosen: Tensor) -> Tensor:
        """Sum of the precisions (p, p) of the chosen flights (n,) bool or weights."""
        weight = torch.zeros(len(self.precision), dtype=self.precision.dtype)
        weight.index_add_(0, self.pattern, chosen.to(weight.dtype))
        return torch.einsum("k,kij->ij", weight, self.precision)


def whiten(y: Tensor, groups: Tensor, free: Tensor) -> Whitening:
    """Estimate a covariance within groups and invert it for every pattern.

    Args:
        y: (n, p), NaN where missing.
        groups: (n,) bool: both groups have a mean of their own, which is taken off.
        free: (p,) unused entries of the mean are still taken off: a claim of zero must not inflate the spread.
    """
    seen = y.isfinite()
    patterns, pattern = torch.unique(seen, dim=0, return_inverse=True)
    centred = y.clone()
    for side in (groups, ~groups):
        if bool(side.any()):
            centred[side] = y[side] - y[side].nanmean(0).nan_to_num(0.0)
    scale = centred.square().nanmean(0).sqrt().clamp(min=1e-12)
    z = torch.where(seen, centred / scale, 0.0)
    n, p = z.shape
    # Many flights speak for themselves; few are helped by a pull towards no correlation.
    pull = 2.0 + 0.25 * p * max(0.0, 1.0 - n / (4.0 * p))
    eye = torch.eye(p, dtype=z.dtype)
    covariance = _start(z, seen, pull)
    members = [torch.nonzero(pattern == k)[:, 0] for k in range(len(patterns))]
    for _ in range(ITERATIONS):
        moment = torch.zeros_like(covariance)
        for k, at in enumerate(members):
            there, gone = patterns[k], ~patterns[k]
            filled = z[at]
            if bool(gone.any()) and bool(there.any()):
                part = covariance[there][:, there]
                weights = torch.linalg.solve(part + 1e-9 * eye[there][:, there], covariance[there][:, gone])
                filled = filled.clone()
                filled[:, gone] = filled[:, there] @ weights
                rest = covariance[gone][:, gone] - covariance[gone][:, there] @ weights
                block = torch.zeros_like(covariance)
                block[gone.nonzero(), gone.nonzero()[:, 0]] = rest
                moment += len(at) * block
            elif bool(gone.all()):
                moment += len(at) * covariance
            moment += filled.T @ filled
        covariance = (moment + pull * eye) / (n + pull)
        covariance = (covariance + covariance.T) / 2
    precision = torch.zeros(len(patterns), p, p, dtype=z.dtype)
    for k, there in enumerate(patterns):
        at = torch.nonzero(there)[:, 0]
        if len(at):
            inverse = torch.linalg.inv(covariance[at][:, at] + 1e-8 * eye[at][:, at])
            precision[k][at[:, None], at] = inverse / (scale[at, None] * scale[at])
    return Whitening(pattern, precision, covariance * scale[:, None] * scale)


def _start(z: Tensor, seen: Tensor, pull: float) -> Tensor:
    """Pairwise covariance, made positive definite."""
    there = seen.to(z.dtype)
    pairs = there.T @ there
    covariance = (z.T @ z + pull * torch.eye(z.shape[1], dtype=z.dtype)) / (pairs + pull)
    values, vectors = torch.linalg.eigh(covariance)
    return (vectors * values.clamp(min=1e-3)) @ vectors.T
