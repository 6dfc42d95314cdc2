r"""Which flights have an effect, each in its own way: likelihood ratios and expectations in closed form.

Given the rest :math:`r_i` of a flight's measurements and its precision :math:`P_i`, a way w of having an effect with
the shift :math:`o_i + a\,s_{iw}`, :math:`a \sim N(\bar a, \sigma^2)` with :math:`a > 0`, is more likely than its
absence by

.. math::

   \ln L_{iw} = o_i^\top P_i r_i - \tfrac12 o_i^\top P_i o_i
   + \tfrac12 \frac{(\bar a + \sigma^2 \alpha)^2}{\sigma^2 (1 + \sigma^2 \gamma)} - \frac{\bar a^2}{2 \sigma^2}
   - \tfrac12 \ln(1 + \sigma^2 \gamma) + \ln\frac{\Phi(m_{iw} / v_{iw})}{\Phi(\bar a / \sigma)},

with :math:`\alpha = s_{iw}^\top P_i (r_i - o_i)` and :math:`\gamma = s_{iw}^\top P_i s_{iw}`; its size is then normal
with the mean :math:`m_{iw} = (\bar a + \sigma^2 \alpha) / (1 + \sigma^2 \gamma)` and variance
:math:`v_{iw}^2 = \sigma^2 / (1 + \sigma^2 \gamma)`, cut off at zero: brakes that are out do not push. Shapes of ways
are one shape of the flight with weights that all flights have in common, so :math:`\alpha` and :math:`\gamma` of
thousands of ways are products of two matrices.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

from descentflow.diagnosis.inference.two_sides import Entry
from descentflow.diagnosis.inference.whitening import Whitening
from descentflow.effects.flight_law import Learnt, Ways

FAR_BELOW = -5.0
"""Standard deviations from zero below which a law that is cut off there needs the scaled complementary error function,
which neither underflows nor cancels but takes five times as long as the normal law itself."""
AT_ONCE = 1 << 15
"""Ways of flights that are worked out at a time: what is in between stays near the processor, 256 kB an array."""
MIN_SHARE = 1e-12
"""Of flights, for the logarithm of a share that is zero."""


@dataclass(frozen=True)
class Explained:
    """What ways (W) explain of n flights: slope and curvature of the log-likelihood in the size, and the offset's part.

    Example:
        >>> zero = torch.zeros(1, 1).double()
        >>> Explained(slope=zero, curvature=zero + 4.0, by_offset=zero[:, 0]).under(1.0, 0.0).log_ratio
        tensor([[-2.]], dtype=torch.float64)
    """

    slope: Tensor
    curvature: Tensor
    by_offset: Tensor

    def of(self, at: slice) -> "Explained":
        """Of some flights."""
        return Explained(self.slope[at], self.curvature[at], self.by_offset[at])

    def under(self, mean: float, spread: float) -> "Likely":
        """How much more likely each way is than none under a law of the size, and the size in it."""
        gain, size, wider = self._of_law(mean, spread)
        if spread == 0.0:
            return Likely(gain, size, spread**2 / wider)
        root = wider.sqrt()
        z = size * (root / spread)
        above, far, scaled = _above(z, gain)
        # The law's density at zero over what is above it.
        hazard = (-0.5 * z.square()).exp_().mul_((2 * math.pi) ** -0.5).div_(above)
        hazard.view(-1)[far] = (2 / math.pi) ** 0.5 / scaled
        gain += above.div_(root).log_()
        gain -= torch.special.log_ndtr(torch.tensor(mean / spread, dtype=z.dtype))
        size += hazard * (spread / root)
        rest = (1 - z.add_(hazard).mul_(hazard)).clamp_(min=0.0)
        return Likely(gain, size, rest.mul_(spread**2).div_(wider))

    def log_ratio(self, mean: float, spread: float) -> Tensor:
        """The first of :meth:`under` alone, in half the time."""
        gain, size, wider = self._of_law(mean, spread)
        if spread == 0.0:
            return gain
        root = wider.sqrt_()
        above, _, _ = _above(size.mul_(root).div_(spread), gain)
        gain += above.div_(root).log_()
        return gain.sub_(torch.special.log_ndtr(torch.tensor(mean / spread, dtype=gain.dtype)))

    def _of_law(self, mean: float, spread: float) -> tuple[Tensor, Tensor, Tensor]:
        """Gain and size if it could be negative too, and by how much the law's variance is wider than what is left."""
        variance = spread**2
        wider = 1 + variance * self.curvature
        gain = (0.5 * variance * self.slope + mean).mul_(self.slope).sub_(0.5 * mean**2 * self.curvature).div_(wider)
        gain += self.by_offset[:, None]
        return gain, (variance * self.slope + mean).div_(wider), wider


def _above(z: Tensor, gain: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """What is above zero of normal laws whose means are z spreads from it; far below, but for exp(-z z / 2).

    That factor goes off the gain, in place; with it come the places of these, and their scaled error function.
    """
    above = torch.special.erfc(z / -(2**0.5)).mul_(0.5)
    far = torch.nonzero(z.flatten() < FAR_BELOW)[:, 0]
    below = z.flatten()[far]
    scaled = torch.special.erfcx(below / -(2**0.5))
    above.view(-1)[far] = 0.5 * scaled
    gain.view(-1)[far] -= 0.5 * below.square()
    return above, far, scaled


@dataclass(frozen=True)
class Likely:
    """Logarithm (n, W) of how much more likely each way is than none; mean and variance (n, W) of the size in it.

    Example:
        >>> from scipy.stats import truncnorm
        >>> seen = Explained(torch.tensor([[-1.0]]).double(), torch.tensor([[4.0]]).double(), torch.zeros(1).double())
        >>> found = seen.under(0.5, 1.0)  # the size is normal about -0.1 with variance 0.2, and cannot be negative
        >>> round(float(found.size), 6) == round(float(truncnorm(0.1 / 0.2**0.5, 99, -0.1, 0.2**0.5).mean()), 6)
        True
    """

    log_ratio: Tensor
    size: Tensor
    variance: Tensor


class WaysOfFlights:
    """Ways of an effect beside the flights that may have it, with all that does not depend on what is left of them.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_sides
        >>> from descentflow.diagnosis.inference.whitening import whiten
        >>> from descentflow.effects import EFFECTS
        >>> theta = torch.tensor([0.4, 200.0, 240.0, 1.0, 0.0, 20.0, 10.0, 0.1]).double()
        >>> brakes, sides = EFFECTS["speed_brake"], example_sides(EFFECTS["speed_brake"], theta.tolist())
        >>> weights = whiten(sides.y, sides.real, sides.airframe, sides.nugget(), sides.of_flight())
        >>> ways = WaysOfFlights(brakes.ways(sides.state, theta, torch.zeros(1)), sides.entries, weights)
        >>> found = ways.explained(sides.y).under(0.4, 0.1).log_ratio.amax(1)
        >>> found[sides.real].mean() > found[~sides.real].mean()  # the real flights have brakes out
        tensor(True)
    """

    def __init__(self, ways: Ways, entries: Sequence[Entry], whitening: Whitening) -> None:
        """Find the slots among the entries, and work out the curvatures.

        Args:
            ways: Of the flights.
            entries: What is compared; slots that are not are left out.
            whitening: Precision of the flights.
        """
        number = {(entry.quantity, entry.band): i for i, entry in enumerate(entries)}
        kept = [k for k, slot in enumerate(ways.slots) if slot in number]
        self.at = torch.tensor([number[ways.slots[k]] for k in kept], dtype=torch.long)
        self.whitening, self.n_entries = whitening, len(entries)
        self.shape, self.offset = ways.shape[:, kept], ways.offset[:, kept]
        self.weights = (ways.table[ways.upper] - ways.table[ways.lower])[:, kept]
        self.rows = whitening.of_entries(self.at)
        self.pushed = self.weighted(self.placed(self.offset)) if bool(self.offset.any()) else self.offset
        self.curvature = self._curvature()

    def weighted(self, rest: Tensor) -> Tensor:
        """Precision times what is left of flights (n, p), zero where nothing was seen, at the slots: (n, S)."""
        return self.whitening.apply(rest)[:, self.at]

    def weighted_alike(self, rest: Tensor) -> Tensor:
        """The same of what is left of every flight alike (p,)."""
        return (self.rows @ rest)[self.whitening.pattern]

    def explained(self, rest: Tensor) -> Explained:
        """What the ways explain of what is left of flights (n, p), zero where nothing was seen."""
        return self.explained_of(self.weighted(rest))

    def explained_of(self, weighted: Tensor) -> Explained:
        """The same, given :meth:`weighted` (n, S)."""
        by_offset = (self.offset * (weighted - 0.5 * self.pushed)).sum(1)
        return Explained((self.shape * (weighted - self.pushed)) @ self.weights.T, self.curvature, by_offset)

    def at_slots(self, taken: Tensor, sized: Tensor) -> Tensor:
        """Shift (n, S) at the slots that is expected of ways which are as likely (n, W) as said, times their sizes."""
        return self.shape * (sized @ self.weights) + taken.sum(1, keepdim=True) * self.offset

    def expected(self, taken: Tensor, size: Tensor) -> Tensor:
        """Shift (n, p) expected of ways that are as likely (n, W) as said, of sizes (n, W)."""
        return self.placed(self.at_slots(taken, taken * size))

    def summed(self, slots: Tensor) -> Tensor:
        """Sum (p,) over flights of the precision times a shift (n, S) at the slots."""
        by_pattern = torch.zeros(len(self.rows), slots.shape[1], dtype=slots.dtype)
        by_pattern.index_add_(0, self.whitening.pattern, slots)
        return by_pattern.flatten() @ self.rows.flatten(0, 1)

    def _curvature(self) -> Tensor:
        """Curvatures (n, W): products of slots, which all ways have in common, weighed by each."""
        first, second = torch.triu_indices(len(self.at), len(self.at))
        block = self.rows[:, first, self.at[second]][self.whitening.pattern]
        by_slot = self.weights.T.contiguous()
        pairs = by_slot[first] * by_slot[second] * torch.where(first == second, 1.0, 2.0)[:, None]
        return (block * self.shape[:, first] * self.shape[:, second] @ pairs).clamp_(min=0.0)

    def placed(self, slots: Tensor) -> Tensor:
        """Values (n, S) of slots at their entries (n, p)."""
        placed = torch.zeros(len(slots), self.n_entries, dtype=slots.dtype)
        placed[:, self.at] = slots
        return placed


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
class Taken:
    """Which flights have which effect in which way.

    By effect (n, W): ``probability``, the ``size`` in each way, ``sized`` that it has in it times its probability, and
    ``squared`` of what is expected of its square; ``log_ratio`` (n,) of the mixture's density over that without the
    effects.
    """

    probability: dict[str, Tensor]
    size: dict[str, Tensor]
    sized: dict[str, Tensor]
    squared: dict[str, Tensor]
    log_ratio: Tensor

    def of(self, at: slice) -> "Taken":
        """Of some flights; what is written there is written here."""
        parts = [{n: one[at] for n, one in p.items()} for p in (self.probability, self.size, self.sized, self.squared)]
        return Taken(parts[0], parts[1], parts[2], parts[3], self.log_ratio[at])

    def learnt(self, name: str, chosen: Tensor | None = None) -> Learnt:
        """Sums over flights, or over those chosen (n,)."""
        r, sized, squared = self.probability[name], self.sized[name], self.squared[name]
        one = torch.ones(len(r), dtype=r.dtype) if chosen is None else chosen.to(r.dtype)
        return Learnt(one @ r, one @ sized, one @ squared, int(one.sum()))


def taken(explained: Mapping[str, Explained], laws: Mapping[str, Law]) -> Taken:
    """The expectation step: which flights have which effect; a flight has one of them or none.

    A path or a rate that is held leaves nothing for brakes to show in, so effects of this kind exclude each other.

    Example:
        >>> zero = torch.zeros(2, 1).double()
        >>> seen = Explained(slope=torch.tensor([[8.0], [0.0]]).double(), curvature=zero + 4.0, by_offset=zero[:, 0])
        >>> found = taken({"path": seen}, {"path": Law(torch.zeros(1).double(), 0.5, 1.0, 0.0)})
        >>> found.probability["path"][:, 0]  # odds of e^6 and e^-2
        tensor([0.9975, 0.1192], dtype=torch.float64)
    """
    first = next(iter(explained.values()))
    blank = [{name: torch.empty_like(explained[name].slope) for name in laws} for _ in range(4)]
    found = Taken(blank[0], blank[1], blank[2], blank[3], torch.empty_like(first.by_offset))
    for at in _some_flights(explained):
        _take({name: one.of(at) for name, one in explained.items()}, laws, found.of(at))
    return found


def _take(explained: Mapping[str, Explained], laws: Mapping[str, Law], found: Taken) -> None:
    """Fill in what is found of some flights."""
    none = _log_none(laws)
    likely = {name: explained[name].under(law.mean, law.spread) for name, law in laws.items()}
    joint = {n: likely[n].log_ratio.add_(law.log_joint) for n, law in laws.items()}
    top = torch.stack([one.amax(1) for one in joint.values()]).amax(0).clamp_(min=none)
    weight = {name: one.sub_(top[:, None]).exp_() for name, one in joint.items()}
    total = (none - top).exp() + torch.stack([one.sum(1) for one in weight.values()]).sum(0)
    for name, one in weight.items():
        size, variance = found.size[name].copy_(likely[name].size), likely[name].variance
        probability = torch.div(one, total[:, None], out=found.probability[name])
        sized = torch.mul(probability, size, out=found.sized[name])
        found.squared[name].copy_((sized * size).addcmul_(probability, variance))
    found.log_ratio.copy_(top + total.log())


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
    none, found = torch.tensor(_log_none(laws), dtype=torch.float64), []
    for at in _some_flights(explained):
        of_some = {name: one.of(at) for name, one in explained.items()}
        joint = [of_some[name].log_ratio(law.mean, law.spread).add_(law.log_joint) for name, law in laws.items()]
        found.append(torch.cat([none.expand(len(joint[0]), 1), *joint], 1).logsumexp(1))
    return torch.cat(found)


def _log_none(laws: Mapping[str, Law]) -> float:
    """Logarithm of the share of flights that have none of the effects."""
    return math.log(max(1.0 - sum(law.share for law in laws.values()), MIN_SHARE))
