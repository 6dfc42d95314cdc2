"""Flights grouped by the levels that they show, so that what depends on these alone is worked out once."""

from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor


@dataclass(frozen=True)
class MaskGroups:
    """Flights grouped by their mask of observed levels: gaps are contiguous, so few masks are distinct.

    Example:
        >>> groups = group_masks(torch.tensor([[True, False], [True, True], [True, False]]))
        >>> groups.masks[groups.group]  # the mask of each flight again
        tensor([[1., 0.],
                [1., 1.],
                [1., 0.]], dtype=torch.float64)
    """

    masks: Tensor
    """(U, L) distinct masks as numbers."""
    group: Tensor
    """(n,) index of each flight's mask."""


def group_masks(mask: Tensor) -> MaskGroups:
    """Group flights (n, L) that observe the same levels.

    Example:
        >>> group_masks(torch.tensor([[True, False], [True, True], [True, False]])).group
        tensor([0, 1, 0])
    """
    # Sorted as bytes, eight levels each, they are in the order of their levels, and some ten times as soon.
    packed = np.ascontiguousarray(np.packbits(mask.cpu().numpy(), axis=1))
    rows = packed.view(np.dtype((np.void, packed.shape[1]))).ravel()
    _, first, group = np.unique(rows, return_index=True, return_inverse=True)
    return MaskGroups(
        mask[torch.from_numpy(first).to(mask.device)].to(torch.float64), torch.from_numpy(group).to(mask.device)
    )
