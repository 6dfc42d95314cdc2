"""Maps of many rows, a part of them after the other: what lies between a flow's networks stays in the cache."""

from collections.abc import Callable

import torch
from torch import Tensor

ROWS = 4096
"""Rows at once on a CPU: splines of 15 weights take 1.3 s for 131,072 rows in place of 3.5, masked affine flows the
same as all at once."""

Map = Callable[[Tensor, Tensor | None], tuple[Tensor, Tensor]]


def in_parts(compute: Map, rows: Tensor, context: Tensor | None = None) -> tuple[Tensor, Tensor]:
    """Apply ``compute`` to rows part by part; each row is computed by itself.

    On an accelerator, and where gradients keep everything that lies between, at once.

    Args:
        compute: Rows (n, d), and context (n, c) or None -> two tensors of n rows.
        rows: (n, d).
        context: (n, c), if there is one.

    Example:
        >>> with torch.no_grad():
        ...     twice, total = in_parts(lambda x, _: (2 * x, x.sum(1)), torch.ones(10_000, 2))
        >>> twice.shape, total.shape
        (torch.Size([10000, 2]), torch.Size([10000]))
    """
    if torch.is_grad_enabled() or rows.device.type != "cpu" or len(rows) <= ROWS:
        return compute(rows, context)
    parts = torch.split(rows, ROWS)
    given = [None] * len(parts) if context is None else torch.split(context, ROWS)
    first, second = zip(*map(compute, parts, given), strict=True)
    return torch.cat(first), torch.cat(second)
