"""Whole aircraft: what their flights share counts once, and they stay together in folds."""

import torch
from torch import Tensor

FOLDS = 5
"""Of the cross-validation: whole aircraft, four fifths to fit and one to score."""


def by_aircraft(values: Tensor, airframe: Tensor) -> Tensor:
    """Sums over aircraft (c,) or (c, k).

    Example:
        >>> by_aircraft(torch.tensor([1.0, 2.0, 4.0]), torch.tensor([7, 7, 9]))
        tensor([3., 4.])
    """
    names, index = torch.unique(airframe, return_inverse=True)
    total = torch.zeros(len(names), *values.shape[1:], dtype=values.dtype)
    return total.index_add_(0, index, values)


def blind_folds(airframe: Tensor, seed: int) -> Tensor:
    """Fold (n,) of each flight: whole aircraft, whatever their side.

    Example:
        >>> fold = blind_folds(torch.arange(20) // 2, seed=0)
        >>> bool((fold[::2] == fold[1::2]).all()), torch.bincount(fold).tolist()
        (True, [4, 4, 4, 4, 4])
    """
    names, index = torch.unique(airframe, return_inverse=True)
    order = torch.randperm(len(names), generator=torch.Generator().manual_seed(seed))
    return (order % FOLDS)[index]


def folds_of(airframe: Tensor, real: Tensor, seed: int) -> Tensor:
    """Fold (n,) of each flight: whole aircraft, both sides spread evenly.

    Example:
        >>> fold = folds_of(torch.arange(20) // 2, torch.arange(20) >= 10, seed=0)
        >>> bool((fold[::2] == fold[1::2]).all()), sorted(set(fold.tolist()))
        (True, [0, 1, 2, 3, 4])
    """
    generator = torch.Generator().manual_seed(seed)
    fold = torch.zeros(len(airframe), dtype=torch.long)
    for side in (real, ~real):
        names, index = torch.unique(airframe[side], return_inverse=True)
        order = torch.randperm(len(names), generator=generator)
        fold[side] = (order % FOLDS)[index]
    return fold
