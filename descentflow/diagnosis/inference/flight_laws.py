"""Which flights have which effect, each in its own way, under laws that all flights have in common."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import accumulate

import torch
from torch import Tensor

from descentflow.diagnosis.inference.size_in_ways import Explained
from descentflow.effects.flight_law import Learnt

AT_ONCE = 1 << 18
"""Ways of flights that are worked out at a time: 2 MB an array."""
NEGLIGIBLE = 25.0
"""Nats by which a way's bound may fall short of its flight's most likely way for it to count: what is left out is
e^-25 of a flight's probability for each, of a thousand 1e-8; of a report made with 40 too no number was off by more."""
MIN_SHARE = 1e-12
"""Of flights, for the logarithm of a share that is zero."""


@dataclass(frozen=True)
class Law:
    """One effect's law at hand: how likely its ways are (W,), and share, mean and spread of its size."""

    log_prior: Tensor
    share: float
    mean: float
    spread: float

    @property
    def log_joint(self) -> Tensor:
        """How likely a flight has it in each way (W,)."""
        return self.log_prior + math.log(max(self.share, MIN_SHARE))


@dataclass(frozen=True)
class WaysTaken:
    """Which flights (n) have an effect in which of its ways (W), where that is not impossible.

    Shapes (K,): ``flight`` and ``way``, the ``probability``, and mean ``size`` and its ``variance`` in that way.
    """

    shape: tuple[int, int]
    flight: Tensor
    way: Tensor
    probability: Tensor
    size: Tensor
    variance: Tensor

    @property
    def share(self) -> Tensor:
        """How likely each flight (n,) has it in some way."""
        return torch.zeros(self.shape[0], dtype=torch.float64).index_add_(0, self.flight, self.probability)

    def placed(self, values: Tensor) -> Tensor:
        """Values (K,) as a table (n, W), zero elsewhere."""
        table = torch.zeros(self.shape, dtype=torch.float64)
        table.view(-1)[self.flight * self.shape[1] + self.way] = values
        return table

    def learnt(self, chosen: Tensor | None = None) -> Learnt:
        """Sums over flights, or over those chosen (n,)."""
        weight = self.probability if chosen is None else self.probability * chosen[self.flight]
        flights = self.shape[0] if chosen is None else int(chosen.sum())
        sized = weight * self.size
        squared = (sized * self.size).addcmul_(weight, self.variance)
        return Learnt(self._of_ways(weight), self._of_ways(sized), self._of_ways(squared), flights)

    def _of_ways(self, values: Tensor) -> Tensor:
        """Sums (W,) of values (K,)."""
        return torch.zeros(self.shape[1], dtype=torch.float64).index_add_(0, self.way, values)


@dataclass(frozen=True)
class Taken:
    """Which flights have which effect in which way; ``log_ratio`` (n,) of the mixture's density over that of none."""

    ways: dict[str, WaysTaken]
    log_ratio: Tensor


def taken(explained: Mapping[str, Explained], laws: Mapping[str, Law]) -> Taken:
    """The expectation step: which flights have which effect; a flight has one of them or none.

    A path or a rate that is held leaves nothing for brakes to show in, so effects of this kind exclude each other.

    Example:
        >>> zero = torch.zeros(2, 1).double()
        >>> seen = Explained(slope=torch.tensor([[8.0], [0.0]]).double(), curvature=zero + 4.0, by_offset=zero[:, 0])
        >>> found = taken({"path": seen}, {"path": Law(torch.zeros(1).double(), 0.5, 1.0, 0.0)})
        >>> found.ways["path"].share  # odds of e^6 and e^-2
        tensor([0.9975, 0.1192], dtype=torch.float64)
    """
    parts = [_take({n: one.of(at) for n, one in explained.items()}, laws) for at in _some_flights(explained)]
    if len(parts) == 1:
        return parts[0]
    return Taken({n: _joined([part.ways[n] for part in parts]) for n in laws}, torch.cat([p.log_ratio for p in parts]))


def _take(explained: Mapping[str, Explained], laws: Mapping[str, Law]) -> Taken:
    """The same of some flights."""
    top, total, counted = _counted(explained, laws)
    likely = {name: one.explained.under(laws[name].mean, laws[name].spread) for name, one in counted.items()}
    weight = {name: one.weighed(likely[name].log_ratio, top, total) for name, one in counted.items()}
    found = {}
    for name, one in counted.items():
        shape, probability = tuple(explained[name].slope.shape), weight[name].div_(total[one.flight])
        size, variance = likely[name].size[:, 0], likely[name].variance[:, 0]
        found[name] = WaysTaken((shape[0], shape[1]), one.flight, one.way, probability, size, variance)
    return Taken(found, total.log_().add_(top))


def _joined(parts: Sequence[WaysTaken]) -> WaysTaken:
    """One after the other, of flights that follow each other."""
    first = list(accumulate((part.shape[0] for part in parts), initial=0))
    flight = torch.cat([part.flight + at for part, at in zip(parts, first, strict=False)])
    rest = (torch.cat([getattr(part, name) for part in parts]) for name in ("way", "probability", "size", "variance"))
    return WaysTaken((first[-1], parts[0].shape[1]), flight, *rest)


@dataclass(frozen=True)
class _Counted:
    """Ways of an effect in some flights that count there (K,): of which flight, and how likely before."""

    flight: Tensor
    way: Tensor
    log_joint: Tensor
    explained: Explained

    def weighed(self, log_ratio: Tensor, top: Tensor, total: Tensor) -> Tensor:
        """Weight of each over that of the most likely of its flight, added to the flight's total in place."""
        weight = (log_ratio[:, 0] + self.log_joint).sub_(top[self.flight]).exp_()
        total.index_add_(0, self.flight, weight)
        return weight


def _counted(explained: Mapping[str, Explained], laws: Mapping[str, Law]) -> tuple[Tensor, Tensor, dict[str, _Counted]]:
    """Bounds (n,) of what the most likely way of a flight gains, none's weight (n,) over it, and ways that count.

    Of a hundred ways four in five are too improbable to change any number: they are told by a bound that costs little.
    """
    none = _log_none(laws)
    bounds = {n: explained[n].bound(law.mean, law.spread).add_(law.log_joint) for n, law in laws.items()}
    top = torch.stack([one.amax(1) for one in bounds.values()]).amax(0).clamp_(min=none)
    counted = {}
    for name, bound in bounds.items():
        at = torch.nonzero((bound >= top[:, None] - NEGLIGIBLE).flatten())[:, 0]
        flight = at.div(bound.shape[1], rounding_mode="floor")
        way = at - flight * bound.shape[1]
        counted[name] = _Counted(flight, way, laws[name].log_joint[way], explained[name].of_ways(at, flight))
    return top, (none - top).exp_(), counted


def _some_flights(explained: Mapping[str, Explained]) -> list[slice]:
    """Flights that are worked out at a time."""
    one = next(iter(explained.values())).slope
    step = max(AT_ONCE // sum(part.slope.shape[1] for part in explained.values()), 1)
    return [slice(at, at + step) for at in range(0, len(one), step)]


def log_ratio(explained: Mapping[str, Explained], laws: Mapping[str, Law]) -> Tensor:
    """Logarithm (n,) of the mixture's density over that without the effects: what :func:`taken` finds, and no more.

    Example:
        >>> zero = torch.zeros(2, 1).double()
        >>> seen = Explained(slope=torch.tensor([[8.0], [0.0]]).double(), curvature=zero + 4.0, by_offset=zero[:, 0])
        >>> log_ratio({"path": seen}, {"path": Law(torch.zeros(1).double(), 0.5, 1.0, 0.0)})  # ln of (1 + e^6) / 2, ...
        tensor([ 5.3093, -0.5662], dtype=torch.float64)
    """
    found = []
    for at in _some_flights(explained):
        top, total, counted = _counted({name: one.of(at) for name, one in explained.items()}, laws)
        for name, one in counted.items():
            one.weighed(one.explained.log_ratio(laws[name].mean, laws[name].spread), top, total)
        found.append(total.log_().add_(top))
    return torch.cat(found)


def _log_none(laws: Mapping[str, Law]) -> float:
    """Logarithm of the share of flights that have none of the effects."""
    return math.log(max(1.0 - sum(law.share for law in laws.values()), MIN_SHARE))
