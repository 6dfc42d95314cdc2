"""Flights of both sides as vectors: the entries that are compared, and their values."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Self

import torch
from torch import Tensor

from descentflow.core.units import FL_M
from descentflow.diagnosis.sides.assumptions import ASSUMED, Assumptions
from descentflow.measurements.quantity_registry import QUANTITIES


@dataclass(frozen=True)
class Entry:
    """One number of the vector: a quantity, and its band (-1 for a quantity of the whole flight).

    Example:
        >>> Entry("rate", 3) == Entry("rate", 3)
        True
    """

    quantity: str
    band: int


@dataclass(frozen=True)
class Vectors:
    """Flights of both sides as vectors.

    Shapes: ``y`` (n, p) with NaN where not seen, simulator's flights first; ``real`` (n,) bool; ``scale`` (p,) spread
    between flights; ``airframe`` (n,); ``altitude_m`` (K,) of the middle of each band.

    Example:
        >>> y, one = torch.tensor([[0.0], [0.1]]), torch.arange(2)
        >>> two = Vectors((Entry("rate", 0),), y, one > 0, y[1], one, one, torch.tensor([5000.0]), 15.0)
        >>> two.quantities(), round(float(two.difference(y)), 2)
        (('rate',), 0.1)
    """

    entries: tuple[Entry, ...]
    y: Tensor
    real: Tensor
    scale: Tensor
    airframe: Tensor
    day: Tensor
    """(n,) number of the day on which each began; its own for each aircraft where days are not known."""
    altitude_m: Tensor
    band_fl: float
    names: tuple[str, ...] = field(default=(), kw_only=True)
    """Identifiers of the real flights, in their order; empty where they are not known."""
    assumed: Assumptions = field(default=ASSUMED, kw_only=True)
    """Constants of the diagnosis."""

    @property
    def has_simulated(self) -> bool:
        """True if the simulator has flights of its own; else physics claims what is normal."""
        return not bool(self.real.all())

    def counts(self) -> Tensor:
        """Entries (p,) that are counts and lost times, zero for most flights."""
        return torch.tensor([QUANTITIES[e.quantity].is_count for e in self.entries])

    def negligible(self) -> Tensor:
        """Negligible shift (p,) of each entry."""
        return torch.tensor([self.assumed.negligible_shift(e.quantity) for e in self.entries], dtype=torch.float64)

    def of_flight(self) -> Tensor:
        """Entries (p,) that are one number of a whole flight: noise, and gaps."""
        return torch.tensor([e.band < 0 for e in self.entries])

    def of(self, quantity: str) -> Tensor:
        """Entries (p,) of a quantity."""
        return torch.tensor([e.quantity == quantity for e in self.entries])

    def columns(self, quantity: str) -> Tensor:
        """Positions (k,) of a quantity's entries."""
        return torch.nonzero(self.of(quantity))[:, 0]

    def only(self, entries: Tensor) -> Self:
        """The same flights with some entries (k,) alone."""
        kept = tuple(self.entries[i] for i in entries.tolist())
        return replace(self, entries=kept, y=self.y[:, entries], scale=self.scale[entries])

    def table(self, quantity: str, y: Tensor) -> Tensor:
        """Entries (n, K) of a quantity of bands, from vectors (n, p); NaN in bands that are not compared."""
        entries = torch.full((len(y), len(self.altitude_m)), torch.nan, dtype=torch.float64)
        at = self.columns(quantity)
        entries[:, [self.entries[i].band for i in at.tolist()]] = y[:, at]
        return entries

    def difference(self, y: Tensor) -> Tensor:
        """Mean (p,) of the real flights minus that of the simulator's, or minus zero where physics claims so."""
        mean = y[self.real].nanmean(0)
        return mean - y[~self.real].nanmean(0).nan_to_num(0.0) if self.has_simulated else mean

    def quantities(self) -> tuple[str, ...]:
        """Quantities that are compared, each once, in order."""
        return tuple(dict.fromkeys(e.quantity for e in self.entries))

    def vector(self, shift: Mapping[str, Tensor]) -> Tensor:
        """A shift of quantities, (n, K) or (n,), as vectors (n, p); zero where it has none."""
        found = torch.zeros(len(next(iter(shift.values()))), len(self.entries), dtype=torch.float64)
        for quantity, change in shift.items():
            at = self.columns(quantity)
            bands = [self.entries[i].band for i in at.tolist()]
            found[:, at] = change[:, bands] if change.dim() == 2 else change[:, None]
        return found

    def middles_fl(self) -> list[float]:
        """Flight levels in the middle of each band."""
        return [float(x) / FL_M for x in self.altitude_m]

    def level_range(self, e: Entry) -> tuple[float, float]:
        """Flight levels that an entry covers."""
        levels, (first, last) = self.altitude_m / FL_M, (0, -1) if e.band < 0 else (e.band, e.band)
        return float(levels[first] - self.band_fl / 2), float(levels[last] + self.band_fl / 2)

    def levels(self) -> tuple[float, float]:
        """Lowest and highest flight level that are compared."""
        ranges = [self.level_range(entry) for entry in self.entries]
        return min(low for low, _ in ranges), max(high for _, high in ranges)
