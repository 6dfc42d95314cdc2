"""Turn the floats among the arguments of an equation into tensors, so that each equation is written once."""

import torch
from torch import Tensor

Number = float | Tensor
"""A scalar, or a tensor where it varies by flight or level or is differentiated by."""


def as_tensors(*values: Number) -> list[Tensor]:
    """Return every value as a floating tensor.

    Floats, scalar tensors and integer tensors take the precision of the first floating tensor among the values that has
    dimensions (else of the first one), floats also its device; when there is none they become float64, the precision
    in which altitudes in metres and pressures in pascals keep their digits.
    """
    like = None
    for value in values:
        if isinstance(value, Tensor) and value.is_floating_point():
            if value.dim() > 0:
                like = value
                break
            like = value if like is None else like
    dtype, device = (torch.float64, None) if like is None else (like.dtype, like.device)
    tensors = []
    for value in values:
        if not isinstance(value, Tensor):
            tensors.append(torch.full((), value, dtype=dtype, device=device))
        elif value.dtype is not dtype and (value.dim() == 0 or not value.is_floating_point()):
            # Without dimensions it is a scalar like any float: on its own it must not raise the precision of a batch.
            tensors.append(value.to(dtype))
        else:
            tensors.append(value)
    return tensors


def safe_sqrt(value: Tensor) -> Tensor:
    """Square root that is zero, with zero gradient, where the value is not positive (a standing aircraft)."""
    positive = value > 0
    return torch.where(positive, torch.where(positive, value, 1.0).sqrt(), 0.0)


def broadcast(*values: Tensor) -> list[Tensor]:
    """Return every tensor expanded to the common shape."""
    return list(torch.broadcast_tensors(*values))  # type: ignore[no-untyped-call]
