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
from dataclasses import dataclass

import torch
from torch import Tensor

FAR_BELOW = -5.0
"""Standard deviations from zero below which a law that is cut off there needs the scaled complementary error function,
which neither underflows nor cancels but takes five times as long as the normal law itself."""


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

    def of_ways(self, at: Tensor, flight: Tensor) -> "Explained":
        """Of some ways (K,) of flights (K,), one a row: (K, 1)."""
        return Explained(self.slope.view(-1)[at, None], self.curvature.view(-1)[at, None], self.by_offset[flight])

    def bound(self, mean: float, spread: float) -> Tensor:
        r"""What :meth:`log_ratio` cannot exceed (n, W), in a fraction of its time.

        Its logarithms are left out: :math:`\Phi(z) \le 1`, and half of :math:`e^{-z^2 / 2}` below zero, where with
        it nothing is left of the gain but what the law's mean costs. So the bound is too high by
        :math:`\tfrac12 \ln(1 + \sigma^2 \gamma)` and, near zero and below, by a few nats more.
        """
        if spread == 0.0:
            return self._of_law(mean, spread)[0]
        variance = spread**2
        gain = (variance * self.slope).add_(mean).clamp_(min=0.0).square_()
        gain.div_((2 * variance**2 * self.curvature).add_(2 * variance))
        return gain.add_((self.by_offset - (_log_above(mean, spread) + 0.5 * mean**2 / variance))[:, None])

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
        gain -= _log_above(mean, spread)
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
        return gain.sub_(_log_above(mean, spread))

    def _of_law(self, mean: float, spread: float) -> tuple[Tensor, Tensor, Tensor]:
        """Gain and size if it could be negative too, and by how much the law's variance is wider than what is left."""
        variance = spread**2
        wider = 1 + variance * self.curvature
        gain = (0.5 * variance * self.slope + mean).mul_(self.slope).sub_(0.5 * mean**2 * self.curvature).div_(wider)
        gain += self.by_offset[:, None]
        return gain, (variance * self.slope + mean).div_(wider), wider


def _log_above(mean: float, spread: float) -> float:
    """Logarithm of what is above zero of the law of sizes."""
    return float(torch.special.log_ndtr(torch.tensor(mean / spread, dtype=torch.float64)))


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
