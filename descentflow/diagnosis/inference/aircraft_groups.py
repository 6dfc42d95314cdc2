"""Whole aircraft: what their flights share counts once, and they stay together in folds."""

import torch
from torch import Tensor

FOLDS = 5
"""Of the cross-validation: whole aircraft, four fifths to fit and one to score."""


def by_aircraft(values: Tensor, cluster: Tensor) -> Tensor:
    """Sums over aircraft (c,) or (c, k)."""
    names, index = torch.unique(cluster, return_inverse=True)
    total = torch.zeros(len(names), *values.shape[1:], dtype=values.dtype)
    return total.index_add_(0, index, values)


def folds_of(cluster: Tensor, real: Tensor, seed: int) -> Tensor:
    """Fold (n,) of each flight: whole aircraft, both sides spread evenly."""
    generator = torch.Generator().manual_seed(seed)
    fold = torch.zeros(len(cluster), dtype=torch.long)
    for side in (real, ~real):
        names, index = torch.unique(cluster[side], return_inverse=True)
        order = torch.randperm(len(names), generator=generator)
        fold[side] = (order % FOLDS)[index]
    return fold
