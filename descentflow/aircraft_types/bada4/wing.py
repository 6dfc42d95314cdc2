"""Aerodynamics of BADA 4 (model AFCM): the drag polars and the greatest lift of a wing."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import torch
from torch import Tensor

from descentflow.aircraft_types.coefficient_group import CoefficientGroup, Numbers, Places
from descentflow.core.tensors import Number, as_tensors
from descentflow.physics.performance_model import Configuration, by_configuration

RISE_MACH = 0.01
"""Beyond M_max drag rises from what it is so far below it."""
HIGHEST_MACH = 0.999
"""Of M_max: the polar of the clean wing ends at Mach 1."""
BUFFET_STEP, LEAST_MACH = 0.001, 0.1
"""Mach numbers between which the buffet's limit is looked for."""


@dataclass(frozen=True)
class Wing(CoefficientGroup):
    """Wing of a type, clean, for the approach and for the landing.

    Example:
        >>> plain = (0.02, *[0.0] * 4, 0.05, *[0.0] * 9)
        >>> wing = Wing(120.0, 0.8, plain, (1.4,), (0.06, 0.0, 0.05, 2.5), (0.1, 0.0, 0.05, 3.0))
        >>> round(wing.drag_coefficient(torch.tensor(0.5), torch.tensor(0.5)).item(), 4)
        0.0325
    """

    PLACES: ClassVar[Places] = {
        "area_m2": (("AFCM/S", 1),),
        "mach_max": (("AFCM/Configuration[@HLid='0']/LGUP/DPM_clean/M_max", 1),),
        "drag": (("AFCM/Configuration[@HLid='0']/LGUP/DPM_clean/CD_clean/d", 15),),
    }
    LENGTHS: ClassVar[Mapping[str, tuple[int, ...]]] = {"clean_lift": (1, 8), "approach": (0, 4), "landing": (0, 4)}
    POSITIVE: ClassVar[frozenset[str]] = frozenset({"area_m2", "mach_max"})

    area_m2: Number
    mach_max: Number
    """Mach number beyond which drag rises steeply."""
    drag: Numbers
    """Of the clean wing: five terms each of drag without lift, by the lift's square and by its sixth power."""
    clean_lift: Numbers
    """Greatest lift of the clean wing: alone, or by Mach number (least, greatest, at rest, five of a polynomial)."""
    approach: Numbers
    """Three drag coefficients by powers of the lift, and the greatest lift; none where the wing stays clean."""
    landing: Numbers

    def drag_coefficient(self, mach: Tensor, lift: Tensor, configuration: Configuration = "CR") -> Tensor:
        """Drag coefficient at a lift coefficient."""
        still, square, sixth = self.polar(mach)
        clean = still + (square + sixth * lift**4) * lift * lift
        if isinstance(configuration, str) and configuration == "CR":
            return clean
        flaps = [
            flaps[0] + (flaps[1] + flaps[2] * lift) * lift if flaps else clean
            for flaps in (self.approach, self.landing)
        ]
        return by_configuration(configuration, clean, *flaps)

    def polar(self, mach: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Clean drag coefficient without lift, by its square and by its sixth power, at Mach numbers.

        Beyond M_max each grows by the power 3/2 of the Mach number, as from 0.01 below it to M_max.
        """
        top = as_tensors(mach, self.mach_max)[1].clamp(max=HIGHEST_MACH)
        rise = ((mach - top + RISE_MACH) / RISE_MACH).clamp(min=0.0) ** 1.5
        parts = (self._polar(number) for number in (torch.minimum(mach, top), top - RISE_MACH, top))
        still, square, sixth = (
            torch.where(mach <= top, here, low + rise * (high - low)) for here, low, high in zip(*parts, strict=True)
        )
        return still, square, sixth

    def _polar(self, mach: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Polynomials in half powers of ``1 - M^2``, as they stand in the file."""
        whole = 1 / (1 - mach * mach)
        root = whole.sqrt()
        return (
            polynomial(self.drag[:5], root),
            polynomial(self.drag[5:10], whole * root),
            self.drag[10] + whole**7 * polynomial(self.drag[11:], root),
        )

    def buffet_mach(self, needed: Tensor, highest: Number) -> Tensor:
        """Lowest Mach number whose greatest lift times its square is the one needed; the highest where none is."""
        if len(self.clean_lift) == 1:
            return (needed / self.clean_lift[0]).sqrt()
        with torch.no_grad():
            mach, lift = self._lift_by_mach(needed, highest)
            place = torch.searchsorted(lift, needed.contiguous(), right=True)
            root = mach[place.clamp(max=len(lift) - 1)]
            for _ in range(3):
                root = self._nearer(root, needed)
        # One more step carries the gradients.
        return torch.where(place < len(lift), self._nearer(root, needed), highest)

    def most_lift(self, like: Tensor, highest: Number) -> Tensor:
        """Greatest lift times the square of the Mach number, of all Mach numbers up to the highest."""
        return self._lift_by_mach(like, highest)[1][-1]

    def _nearer(self, mach: Tensor, needed: Tensor) -> Tensor:
        """Newton's step to the Mach number whose greatest lift is the one needed."""
        lift, slope = self._clean_lift(mach)
        return mach - (lift * mach * mach - needed) / (slope * mach * mach + 2 * lift * mach)

    def _lift_by_mach(self, like: Tensor, highest: Number) -> tuple[Tensor, Tensor]:
        """Mach numbers (k,) up to the highest, and the greatest lift times their square up to each."""
        mach = torch.arange(LEAST_MACH, float(highest), BUFFET_STEP, dtype=like.dtype, device=like.device)
        return mach, (self._clean_lift(mach)[0] * mach * mach).cummax(0).values

    def _clean_lift(self, mach: Tensor) -> tuple[Tensor, Tensor]:
        """Greatest lift coefficient of the clean wing and its slope: a polynomial, and lines on either side."""
        if len(self.clean_lift) == 1:
            return self.clean_lift[0] + 0.0 * mach, 0.0 * mach
        low, high, at_rest, *terms = as_tensors(mach, *self.clean_lift)[1:]
        slopes = [power * term for power, term in enumerate(terms)][1:]
        inside = torch.minimum(torch.maximum(mach, low), high)
        lift, slope = polynomial(terms, inside), polynomial(slopes, inside)
        below = (lift - at_rest) / low
        return (
            torch.where(mach < low, at_rest + mach * below, lift + (mach - inside) * slope),
            torch.where(mach < low, below, slope),
        )


def polynomial(coefficients: Sequence[Any], x: Tensor) -> Tensor:
    """Sum of coefficients by powers of x, which begin with 0.

    Example:
        >>> polynomial([1.0, 0.0, 3.0], torch.tensor(2.0))
        tensor(13.)
    """
    total = torch.zeros_like(x)
    for factor in reversed(coefficients):
        total = total * x + factor
    return total
