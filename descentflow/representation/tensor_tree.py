"""A checkpoint's content as named tensors and a JSON text, for files that hold nothing else."""

import json
import math
from typing import Any

from torch import Tensor

TENSOR, NUMBER, PAIRS = "__tensor__", "__number__", "__pairs__"
"""Keys of objects that stand for a tensor, for a number that JSON has not, and for other keys than texts."""


def to_tensors_and_text(content: dict[str, Any]) -> tuple[dict[str, Tensor], str]:
    """Split nested mappings and lists into their tensors, by a name made of the keys, and the rest as JSON.

    Example:
        >>> tensors, text = to_tensors_and_text({"a": {"w": torch.ones(2)}, "highest": float("inf")})
        >>> list(tensors), text
        (['a.w'], '{"a": {"w": {"__tensor__": "a.w"}}, "highest": {"__number__": "inf"}}')
    """
    tensors: dict[str, Tensor] = {}

    def told(value: Any, name: str) -> Any:
        if isinstance(value, Tensor):
            # Two names of one memory, or a part of it, cannot be written as they are.
            tensors[name] = value.detach().cpu().contiguous().clone()
            return {TENSOR: name}
        if isinstance(value, dict):
            inner = {key: told(one, f"{name}.{key}" if name else str(key)) for key, one in value.items()}
            return inner if all(isinstance(key, str) for key in inner) else {PAIRS: [list(p) for p in inner.items()]}
        if isinstance(value, list | tuple):
            return [told(one, f"{name}.{i}") for i, one in enumerate(value)]
        if isinstance(value, float) and not math.isfinite(value):
            return {NUMBER: str(value)}
        return value

    return tensors, json.dumps(told(content, ""), allow_nan=False)


def from_tensors_and_text(tensors: dict[str, Tensor], text: str) -> dict[str, Any]:
    """The content again, see :func:`to_tensors_and_text`; sequences are lists.

    Raises:
        KeyError: If a tensor is missing.
        ValueError: If the text is no JSON.

    Example:
        >>> content = {"a": {"w": torch.ones(2)}, "b": [1, None], 3: "x"}
        >>> again = from_tensors_and_text(*to_tensors_and_text(content))
        >>> again["a"]["w"], again["b"], again[3]
        (tensor([1., 1.]), [1, None], 'x')
    """

    def restored(value: Any) -> Any:
        if isinstance(value, list):
            return [restored(one) for one in value]
        if not isinstance(value, dict):
            return value
        if TENSOR in value:
            return tensors[value[TENSOR]]
        if NUMBER in value:
            return float(value[NUMBER])
        if PAIRS in value:
            return {key: restored(one) for key, one in value[PAIRS]}
        return {key: restored(one) for key, one in value.items()}

    found: dict[str, Any] = restored(json.loads(text))
    return found
