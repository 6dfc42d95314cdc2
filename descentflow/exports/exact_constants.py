"""Keep constants in float64 through the conversion to ONNX, which rounds numbers in expressions to float32."""

from collections.abc import Callable, Iterable, Mapping
from typing import Any

import torch
from torch.overrides import TorchFunctionMode


class ExactConstants(TorchFunctionMode):
    """Inside the block, a Python number that float32 would round takes part in torch's functions as a tensor.

    Example:
        >>> with ExactConstants():
        ...     scaled = torch.ones(2, dtype=torch.float64) * 0.1
        >>> scaled
        tensor([0.1000, 0.1000], dtype=torch.float64)
    """

    def __torch_function__(
        self,
        func: Callable[..., Any],
        types: Iterable[type],
        args: tuple[Any, ...] = (),
        kwargs: Mapping[str, Any] | None = None,
    ) -> Any:
        """Call the function with such numbers among its positional arguments replaced."""
        if any(isinstance(arg, torch.Tensor) for arg in args):
            args = tuple(_tensor(arg) if _is_rounded(arg) else arg for arg in args)
        return func(*args, **(kwargs or {}))


def _is_rounded(value: object) -> bool:
    return isinstance(value, float) and value == value and float(torch.tensor(value, dtype=torch.float32)) != value


def _tensor(value: float) -> torch.Tensor:
    return torch.tensor(value, dtype=torch.float64)
