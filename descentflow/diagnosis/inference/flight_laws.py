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
are differences of rows of one table, so :math:`\alpha` and :math:`\gamma` of thousands of ways are sums and differences
of numbers that belong to the rows.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

from descentflow.diagnosis.inference.two_sides import Entry
from descentflow.diagnosis.inference.whitening import Whitening
from descentflow.effects.flight_law import Learnt, Ways

MAX_Z = 30.0
"""Standard deviations above zero from which a law that is cut off there is the normal law itself."""
MIN_SHARE = 1e-12
"""Of flights, for the logarithm of a share that is zero."""
CHUNK = 200
"""Flights whose tables are held at once."""


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

    def under(self, mean: float, spread: float) -> "Likely":
        """How much more likely each way is than none under a law of the size, and the size in it."""
        wider = 1 + spread**2 * self.curvature
        gain = mean * self.slope + 0.5 * spread**2 * self.slope**2 - 0.5 * mean**2 * self.curvature
        ratio = self.by_offset[:, None] + gain / wider - 0.5 * wider.log()
        size, variance = (mean + spread**2 * self.slope) / wider, spread**2 / wider
        if spread == 0.0:
            return Likely(ratio, size, variance)
        sd = variance.sqrt()
        z = (size / sd).clamp(max=MAX_Z)
        # The scaled complementary error function neither underflows nor cancels, however far below zero the size is.
        scaled = torch.special.erfcx(-z / 2**0.5)
        hazard = (2 / torch.pi) ** 0.5 / scaled
        above = (0.5 * scaled).log() - 0.5 * z**2
        ratio = ratio + above - torch.special.log_ndtr(torch.tensor(mean / spread, dtype=z.dtype))
        return Likely(ratio, size + sd * hazard, variance * (1 - hazard * (hazard + z)).clamp(min=0.0))


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
        self.lower, self.upper = ways.lower, ways.upper
        self.rows = whitening.precision[:, self.at][whitening.pattern]
        self.shape, self.offset, self.table = ways.shape[:, kept], ways.offset[:, kept], ways.table[:, kept]
        self.n_entries = len(entries)
        self.pushed = torch.einsum("nst,nt->ns", self.rows[:, :, self.at], self.offset)
        self.curvature = torch.cat(
            [self._curvature(part) for part in torch.split(torch.arange(len(self.shape)), CHUNK)]
        )

    def explained(self, rest: Tensor) -> Explained:
        """What the ways explain of what is left of flights (n, p), zero where nothing was seen."""
        weighted = torch.bmm(self.rows, rest[:, :, None])[:, :, 0]
        by_offset = (self.offset * (weighted - 0.5 * self.pushed)).sum(1)
        at_row = (self.shape * (weighted - self.pushed)) @ self.table.T
        return Explained(at_row[:, self.upper] - at_row[:, self.lower], self.curvature, by_offset)

    def expected(self, taken: Tensor, size: Tensor) -> Tensor:
        """Shift (n, p) expected of ways that are as likely (n, W) as said, of sizes (n, W)."""
        at_row = torch.zeros(len(taken), len(self.table), dtype=taken.dtype)
        at_row.index_add_(1, self.upper, taken * size)
        at_row.index_add_(1, self.lower, -taken * size)
        return self._placed(self.shape * (at_row @ self.table) + taken.sum(1, keepdim=True) * self.offset)

    def _curvature(self, part: Tensor) -> Tensor:
        """Curvatures (m, W) of some flights: each has a table of all pairs of rows."""
        block = self.rows[part][:, :, self.at]
        sized = self.shape[part][:, :, None] * block * self.shape[part][:, None, :]
        pairs = self.table @ sized @ self.table.T
        own = pairs.diagonal(dim1=1, dim2=2)
        found = own[:, self.upper] + own[:, self.lower] - 2 * pairs[:, self.lower, self.upper]
        return found.clamp(min=0.0)

    def _placed(self, slots: Tensor) -> Tensor:
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


@dataclass(frozen=True)
class Taken:
    """Which flights have which effect in which way.

    ``probability`` (n, W) by effect; ``likely`` with the size in each way; ``log_ratio`` (n,) of the mixture's density
    over that without the effects.
    """

    probability: dict[str, Tensor]
    likely: dict[str, Likely]
    log_ratio: Tensor

    def learnt(self, name: str, chosen: Tensor | None = None) -> Learnt:
        """Sums over flights, or over those chosen (n,)."""
        r, size, variance = self.probability[name], self.likely[name].size, self.likely[name].variance
        if chosen is not None:
            r, size, variance = r[chosen], size[chosen], variance[chosen]
        sized = r * size
        return Learnt(r.sum(0), sized.sum(0), (sized * size + r * variance).sum(0), len(r))


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
    none = 1.0 - sum(law.share for law in laws.values())
    n = len(next(iter(explained.values())).by_offset)
    likely = {name: explained[name].under(law.mean, law.spread) for name, law in laws.items()}
    parts = [torch.full((n, 1), math.log(max(none, MIN_SHARE)), dtype=torch.float64)]
    for name, law in laws.items():
        parts.append(likely[name].log_ratio + (law.log_prior + math.log(max(law.share, MIN_SHARE))))
    joint = torch.cat(parts, 1)
    total = joint.logsumexp(1)
    split = torch.split((joint - total[:, None]).exp()[:, 1:], [len(law.log_prior) for law in laws.values()], 1)
    return Taken(dict(zip(laws, split, strict=True)), likely, total)
