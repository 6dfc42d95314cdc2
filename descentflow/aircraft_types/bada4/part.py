"""Parts of an aircraft of BADA 4: their coefficients, where its file has them, and the check of their values."""

from collections.abc import Mapping, Sequence
from dataclasses import MISSING, Field, dataclass, fields
from math import isfinite
from typing import Any, ClassVar, Self

import torch
from torch import Tensor

from descentflow.core.errors import AircraftError
from descentflow.core.tensors import Number

Numbers = tuple[Number, ...]
Places = Mapping[str, tuple[tuple[str, int], ...]]
"""Fields, and where an aircraft's file has their numbers: paths of elements and how many of each."""


@dataclass(frozen=True)
class Part:
    """Coefficients of one model of BADA 4; a subclass names them as fields.

    Numbers may be replaced by tensors that broadcast against the batch, to differentiate by them.

    Example:
        >>> from descentflow.aircraft_types.bada4.wing import Wing
        >>> Wing.PLACES["area_m2"]
        (('AFCM/S', 1),)
    """

    PLACES: ClassVar[Places] = {}
    LENGTHS: ClassVar[Mapping[str, tuple[int, ...]]] = {}
    """Of fields without a place, how many numbers they may have."""
    POSITIVE: ClassVar[frozenset[str]] = frozenset()
    """Fields that are above zero."""

    @classmethod
    def of(cls, values: Mapping[str, Any]) -> Self:
        """Build from plain values, and parts that are built already.

        Raises:
            AircraftError: If a value is missing, is not known, or is none of this part.
        """
        known = {one.name: one for one in fields(cls)}
        needed = {name for name, one in known.items() if one.default is MISSING}
        wrong = (needed - set(values)) | (set(values) - set(known))
        if wrong:
            raise _refused(f"coefficients that differ by {sorted(wrong)}", "exactly those of BADA 4")
        for name, value in values.items():
            cls._check(known[name], value)
        return cls(**values)

    @classmethod
    def _check(cls, one: "Field[Any]", value: Any) -> None:
        if one.type in (Number, int):
            whole = one.type is int
            right = isinstance(value, int) and not isinstance(value, bool) if whole else _is_number(value)
            wanted = "a whole number" if whole else "a finite number"
            if one.name in cls.POSITIVE:
                right, wanted = right and value > 0, f"{wanted} above zero"
        elif one.type == Numbers:
            lengths = cls.LENGTHS.get(one.name) or (sum(n for _, n in cls.PLACES[one.name]),)
            lengths = (0, *lengths) if one.default == () else lengths
            right = isinstance(value, tuple) and len(value) in lengths and all(map(_is_number, value))
            wanted = f"{' or '.join(map(str, lengths))} finite numbers"
        else:
            kind = one.type if isinstance(one.type, type) else str
            right, wanted = isinstance(value, kind), "text" if kind is str else f"a {kind.__name__}"
        if not right:
            raise _refused(f"coefficient {one.name} = {str(value)[:60]!r}", wanted)

    def plain(self) -> dict[str, Any]:
        """The fields as primitives, parts as dictionaries."""
        return {one.name: _plain(getattr(self, one.name)) for one in fields(self)}


def _is_number(value: Any) -> bool:
    return isinstance(value, float) and isfinite(value)


def _plain(value: Any) -> Any:
    if isinstance(value, tuple):
        return tuple(map(_plain, value))
    if isinstance(value, Part):
        return value.plain()
    return value.item() if isinstance(value, Tensor) else value


def _refused(got: str, expected: str) -> AircraftError:
    return AircraftError(got, expected=expected, mend="take the file as it was written")


def polynomial(coefficients: Sequence[Any], x: Tensor) -> Tensor:
    """Sum of coefficients by powers of x, which begin with 0.

    Example:
        >>> polynomial([1.0, 0.0, 3.0], torch.tensor(2.0))
        tensor(13.)
    """
    total = torch.zeros_like(x)
    for one in reversed(coefficients):
        total = total * x + one
    return total


def surface(coefficients: Numbers, of_x: int, x: Tensor, y: Tensor) -> Tensor:
    """Polynomial in y whose coefficients are polynomials of ``of_x`` terms in x, in the order of the files."""
    rows = range(0, len(coefficients), of_x)
    return polynomial([polynomial(coefficients[at : at + of_x], x) for at in rows], y)
