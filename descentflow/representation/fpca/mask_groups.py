"""Flights grouped by the levels that they show, so that what depends on these alone is computed once."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import torch
from torch import Tensor

FLIGHTS_EACH = 8
"""Flights a mask, on average, above which masks are taken one after the other: below, the calls would cost more."""
MATRICES_HELD = 4096
"""Flights whose matrices are held at once where masks are not taken one after the other."""


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

    @cached_property
    def counts(self) -> Tensor:
        """Flights (U,) of each mask, float64."""
        return torch.bincount(self.group, minlength=len(self.masks)).to(torch.float64)

    def times(self, rows: Tensor, matrices: Tensor) -> Tensor:
        """Each flight's row (n, k) times the matrix of its mask (U, k, m): (n, m).

        Example:
            >>> groups = group_masks(torch.tensor([[True, False], [True, True], [True, False]]))
            >>> groups.times(torch.ones(3, 1), torch.tensor([[[5.0]], [[7.0]]]))
            tensor([[5.],
                    [7.],
                    [5.]])
        """
        if not self._few:
            parts = zip(torch.split(self.group, MATRICES_HELD), torch.split(rows, MATRICES_HELD), strict=True)
            return torch.cat([(part[:, None] @ matrices[index])[:, 0] for index, part in parts])
        products = rows.new_empty(len(rows), matrices.shape[2])
        moved = torch.cat([part @ matrices[one] for one, part in self._one_by_one(rows)])
        products[self._order] = moved
        return products

    def moments(self, rows: Tensor) -> Tensor:
        """Products of each two columns of rows (n, k), summed over the flights of each mask: (U, k, k).

        Example:
            >>> groups = group_masks(torch.tensor([[True, False], [True, True], [True, False]]))
            >>> groups.moments(torch.tensor([[1.0], [2.0], [3.0]])).flatten()
            tensor([10.,  4.])
        """
        k = rows.shape[1]
        moments = rows.new_zeros(len(self.masks), k, k)
        if self._few:
            for one, part in self._one_by_one(rows):
                torch.mm(part.T, part, out=moments[one])
            return moments
        for index, part in zip(torch.split(self.group, MATRICES_HELD), torch.split(rows, MATRICES_HELD), strict=True):
            moments.index_add_(0, index, part[:, :, None] * part[:, None])
        return moments

    @cached_property
    def _few(self) -> bool:
        return len(self.group) >= FLIGHTS_EACH * len(self.masks)

    @cached_property
    def _order(self) -> Tensor:
        """Flights (n,) by their mask."""
        return self.group.argsort(stable=True)

    @cached_property
    def _ends(self) -> list[int]:
        return [0, *self.counts.cumsum(0).long().tolist()]

    def _one_by_one(self, rows: Tensor) -> Iterator[tuple[int, Tensor]]:
        """Rows (n, k) of the flights of each mask."""
        rows = rows[self._order]
        for one, (start, end) in enumerate(zip(self._ends[:-1], self._ends[1:], strict=True)):
            yield one, rows[start:end]


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
