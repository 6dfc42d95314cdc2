"""Coefficients of a performance model as fields: where a file has them, their primitives and the check of these."""

from collections.abc import Mapping
from dataclasses import MISSING, Field, dataclass, fields
from math import inf, isfinite
from typing import Any, ClassVar, Self, get_args

from torch import Tensor

from descentflow.core.errors import AircraftError
from descentflow.core.tensors import Number

Numbers = tuple[Number, ...]
Places = Mapping[str, tuple[tuple[str, int], ...]]
"""Fields, and where an aircraft's file has their numbers: paths of elements and how many of each."""


@dataclass(frozen=True)
class CoefficientGroup:
    """Coefficients of a model, or of a part of one; a subclass names them as fields.

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
    RANGES: ClassVar[Mapping[str, tuple[float, float]]] = {}
    """Least and greatest value of fields."""
    WHOLE: ClassVar[bool] = False
    """True if fields with a default are needed, too."""

    @classmethod
    def of(cls, values: Any) -> Self:
        """Build from a dictionary of plain values, and of parts, built or plain.

        Raises:
            AircraftError: If a value is missing, is not known, or is none of this part.
        """
        known = {field.name: field for field in fields(cls)}
        needed = {name for name, one in known.items() if cls.WHOLE or one.default is MISSING}
        if not isinstance(values, Mapping):
            raise _refused(f"coefficients {str(values)[:60]!r}", "a dictionary")
        wrong = (needed - set(values)) | (set(values) - set(known))
        if wrong:
            raise _refused(f"coefficients that differ by {sorted(wrong)}", "exactly those of the performance model")
        made = {name: _part(known[name].type, value) for name, value in values.items()}
        for name, value in made.items():
            cls._check(known[name], value)
        return cls(**made)

    @classmethod
    def _check(cls, one: "Field[Any]", value: Any) -> None:
        if one.type in (Number, int):
            whole = one.type is int
            right = isinstance(value, int) and not isinstance(value, bool) if whole else _is_number(value)
            wanted = "a whole number" if whole else "a finite number"
            low, high = cls.RANGES.get(one.name, (-inf, inf))
            if right and not low <= value <= high:
                right, wanted = False, f"a number from {low:g} to {high:g}"
            if one.name in cls.POSITIVE:
                right, wanted = right and value > 0, f"{wanted} above zero"
        elif one.type == Numbers:
            lengths = cls.LENGTHS.get(one.name) or (sum(n for _, n in cls.PLACES[one.name]),)
            lengths = (0, *lengths) if one.default == () else lengths
            right = isinstance(value, tuple) and len(value) in lengths and all(map(_is_number, value))
            wanted = f"{' or '.join(map(str, lengths))} finite numbers"
        else:
            kind, words = one.type if isinstance(one.type, type) else str, get_args(one.type)
            right = isinstance(value, kind) and (not words or value in words)
            wanted = f"one of {', '.join(words)}" if words else "text" if kind is str else f"a {kind.__name__}"
        if not right:
            raise _refused(f"coefficient {one.name} = {str(value)[:60]!r}", wanted)

    def plain(self) -> dict[str, Any]:
        """The fields as primitives, parts as dictionaries."""
        return {field.name: _plain(getattr(self, field.name)) for field in fields(self)}


def _part(kind: Any, value: Any) -> Any:
    """A value, built if it is that of a part."""
    is_part = isinstance(kind, type) and issubclass(kind, CoefficientGroup)
    return kind.of(value) if is_part and not isinstance(value, CoefficientGroup) else value


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and isfinite(value)


def _plain(value: Any) -> Any:
    if isinstance(value, tuple):
        return tuple(map(_plain, value))
    if isinstance(value, CoefficientGroup):
        return value.plain()
    return value.item() if isinstance(value, Tensor) else value


def _refused(got: str, expected: str) -> AircraftError:
    return AircraftError(got, expected=expected, mend="take the file as it was written")
