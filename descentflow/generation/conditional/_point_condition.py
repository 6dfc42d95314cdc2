r"""A time or a distance at a level: not linear in the latent numbers, so met along a line and weighted.

Minus its logarithm, T, is nearly linear in drag on its scale: so T is met. With the slope g of T at the mean of
a Gaussian and the covariance $\Sigma$ that is left by the rows of
``_speed_conditions``, the direction $v = \Sigma g$ leaves the rows as they are,
and the coordinate s along it is independent of the rest, with variance $1 / g^T v$. A draw keeps its rest; its s is
solved for the value t that is asked. The density of such draws given that the quantity T is t is that of the rest times
$\phi(s) / \lvert\partial T / \partial s\rvert$, which becomes their weight. Of a band, t is first drawn from the
normal that the slope implies, cut to the band; of a band of levels, the level is drawn evenly, and the weight has the
change of T by level.
"""

from math import log, pi

import numpy as np
import torch
from torch import Tensor

from descentflow.generation._given_temperature import in_given_air
from descentflow.generation.conditional._latent_density import Array, LatentDensity
from descentflow.generation.conditional._speed_conditions import Conditions, cut_normal, log_between, log_total
from descentflow.generation.conditional.constraints import DescentRequest
from descentflow.representation.decoder.descent_decoder import DescentDecoder
from descentflow.representation.decoder.trajectories import Trajectories, through_air_m

STEP_SD = 0.05
"""Step along the line, in standard deviations, over which the slope of the weight is taken."""
TOLERANCE = {"time_s": 1e-3, "distance_nm": 1.0}
"""Largest distance (s, m) of a draw from the value asked: less than anyone measures, more than the last step leaves."""
LEVELS_OF_A_BAND = 9
"""Levels of a band at which the shares of the Gaussians are found."""
LEAST_SPREAD = 1e-6
"""Standard deviation, as a share of the value, that keeps the arithmetic finite where speeds leave nothing open."""


def since_entry(flown: Trajectories, name: str, deviation_k: float = 0.0) -> Tensor:
    """Seconds (``time_s``) or metres through the air (``distance_nm``) since entry, (n, L), growing downwards.

    Air of another temperature changes distances alone: the same Mach number sets the rate.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> model = load_model("best.ckpt")
        >>> flown = model.representation.decoder(model.sample(3, seed=0))
        >>> bool((since_entry(flown, "distance_nm")[:, 0] > 100 * since_entry(flown, "time_s")[:, 0]).all())  # m/s
        True
    """
    if name == "time_s":
        return flown.time_s
    if deviation_k:
        flown = in_given_air(flown, torch.full((len(flown),), deviation_k))
    return through_air_m(flown)


class PointCondition:
    """A time or a distance at a level, for C Gaussians whose descents start at one level.

    ``log_probs`` (C,) are the shares of the Gaussians given the rows and, as far as the slope implies, the point;
    ``tail`` is the probability of the point then.

    Args:
        latent: The C Gaussians.
        decoder: Flies them.
        request: The request, with the level where descents start.
        speeds: The speeds among it.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> from descentflow.generation.conditional.constraints import PointAsked
        >>> from descentflow.generation.conditional._latent_density import LatentDensities
        >>> from descentflow.generation.conditional._speed_conditions import Rows, conditions
        >>> model = load_model("best.ckpt")
        >>> decoder, latent = model.representation.decoder, LatentDensities(model).before()
        >>> u = np.zeros_like(latent.means)
        >>> free = conditions(latent.log_probs, latent.means, latent.roots, Rows(u[:, None][:, :0], *[u[:, :0]] * 3))
        >>> request = DescentRequest(180, points=(PointAsked("time_s", 400.0, 400.0, (160.0, 160.0)),))
        >>> point = PointCondition(latent, decoder, request, free)
        >>> met, log_weight = point.meet(np.array([0]), u[:1], np.array([0.5]))
        >>> flown = decoder.fly_scaled(latent.curves.scaled_profiles(met), torch.tensor([180]))
        >>> round(float(flown.time_s[0, 10]), 2), bool(np.isfinite(log_weight[0]))  # s
        (400.0, True)
    """

    def __init__(
        self, latent: LatentDensity, decoder: DescentDecoder, request: DescentRequest, speeds: Conditions
    ) -> None:
        """Take slopes at the Gaussians' means given the speeds."""
        (self.asked,) = request.points
        self.latent, self.decoder, self.request, self.speeds = latent, decoder, request, speeds
        self.low = -log(self.asked.high * self.asked.unit)
        self.high = -log(self.asked.low * self.asked.unit) if self.asked.low > 0 else np.inf
        levels_fl = decoder.levels_fl.numpy()
        self.levels = np.interp(self.asked.levels, levels_fl, np.arange(len(levels_fl)))
        n_cells = len(latent.means)
        middle, _ = speeds.values(np.arange(n_cells), np.full((n_cells, speeds.rows.n_rows), 0.5))
        self.moved = (speeds.gain @ (middle - speeds.rows.centre)[:, :, None])[:, :, 0]
        mean = torch.from_numpy(latent.means + self.moved).requires_grad_()
        middle_level = np.full(n_cells, self.levels.mean())
        flown = self._flown(mean)
        (slope,) = torch.autograd.grad(self._measured(flown, middle_level).sum(), mean)
        self.slope = slope.numpy()
        self.profile = self._since(flown).detach()
        spread = latent.roots @ (latent.roots.mT @ self.slope[:, :, None])
        self.direction = (spread - speeds.gain @ (speeds.rows.matrix @ spread))[:, :, 0]
        self.variance = np.maximum((self.slope * self.direction).sum(1), LEAST_SPREAD**2)
        levels = self.levels[:1]
        if self.is_level_band:
            levels = np.linspace(self.levels[0], self.levels[1], LEVELS_OF_A_BAND)
        self.own = log_total(np.stack([self._log_share(level) for level in levels])) - log(len(levels))
        total = speeds.log_probs + self.own
        self.log_probs = total - log_total(total) if np.isfinite(total).any() else speeds.log_probs
        self.tail = max(self._tail(level) for level in levels)

    @property
    def is_level_band(self) -> bool:
        """True where a value is asked within a band of levels."""
        return bool(self.levels[0] < self.levels[1])

    def meet(self, cell: np.ndarray, u: Array, uniform: Array) -> tuple[Tensor, Array]:
        """Draws (n, D) of the Gaussians minus their means that meet the speeds, moved to meet the point as well.

        Args:
            cell: (n,) which Gaussian.
            u: (n, D).
            uniform: (n,) in (0, 1).

        Returns:
            The draws with their means, and their log weights (n,): minus infinity where the line does not meet the
            point.
        """
        variance, slope, direction = self.variance[cell], self.slope[cell], self.direction[cell]
        seen = (self.speeds.rows.matrix[cell] @ u[:, :, None])[:, :, 0]
        given = (self.speeds.gain[cell] @ seen[:, :, None])[:, :, 0]
        u = u - direction * ((slope * (u - given)).sum(1) / variance)[:, None]
        level = self.levels[0] + (self.levels[1] - self.levels[0]) * uniform
        expected = -_at_level(self.profile[cell], level).log().numpy() + (slope * (given - self.moved[cell])).sum(1)
        target, log_weight = self._target(expected, np.sqrt(variance), uniform)
        start, line = torch.from_numpy(self.latent.means[cell] + u), torch.from_numpy(direction)

        def at(s: Array) -> tuple[Tensor, Trajectories, Array]:
            whole = start + torch.from_numpy(s)[:, None] * line
            flown = self._flown(whole)
            return whole, flown, self._measured(flown, level).numpy()

        with torch.no_grad(), np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            # A step by the slope at the mean, and one of Newton.
            s = (target - expected) / variance
            s = s + (target - at(s)[2]) / variance
            ahead, value = STEP_SD / np.sqrt(variance), at(s)[2]
            slope_s = (at(s + ahead)[2] - value) / ahead
            s = s + (target - value) / slope_s
            whole, flown, value = at(s)
            log_weight += 0.5 * np.log(variance / (2 * pi)) - 0.5 * variance * s**2 - np.log(slope_s) - self.own[cell]
            if self.is_level_band:
                by_level = _by_level(self._since(flown), level).abs().log().numpy()
                log_weight += by_level + target
            off = np.exp(-value) - np.exp(-target)
        met = np.isfinite(log_weight) & (np.abs(off) <= TOLERANCE[self.asked.name])
        return whole, np.where(met, log_weight, -np.inf)

    def _target(self, expected: Array, sd: Array, uniform: Array) -> tuple[Array, Array]:
        """The value that each draw shall have, and minus the log density of having drawn it."""
        if self.low == self.high:
            return np.full_like(expected, self.low), np.zeros_like(expected)
        low, high = (self.low - expected) / sd, (self.high - expected) / sd
        white = cut_normal(low, high, uniform)
        return expected + sd * white, 0.5 * white**2 + 0.5 * np.log(2 * pi * sd**2) + log_between(low, high)

    def _flown(self, u: Tensor) -> Trajectories:
        return self.decoder.fly_scaled(self.latent.curves.scaled_profiles(u), torch.full((len(u),), self.request.entry))

    def _since(self, flown: Trajectories) -> Tensor:
        return since_entry(flown, self.asked.name, self.request.deviation_k)

    def _measured(self, flown: Trajectories, level: Array) -> Tensor:
        """T (n,) at levels (n,) that are indices with fractions."""
        return -_at_level(self._since(flown), level).log()

    def _off(self, level: float) -> tuple[Array, Array, Array]:
        """Bounds (C,) of T at a level (an index) in standard deviations from its mean, by the slopes; these."""
        sd = np.sqrt(self.variance)
        expected = -_at_level(self.profile, np.full(len(sd), level)).log().numpy()
        return (self.low - expected) / sd, (self.high - expected) / sd, sd

    def _log_share(self, level: float) -> Array:
        """Log probability (C,) of the point at a level."""
        low, high, sd = self._off(level)
        return log_between(low, high) if self.low < self.high else -0.5 * low**2 - np.log(sd) - 0.5 * log(2 * pi)

    def _tail(self, level: float) -> float:
        """Probability of the band, or of values at least as far out as that asked, on its side; at a level."""
        low, high, _ = self._off(level)
        shares, infinite = np.exp(self.speeds.log_probs), np.full_like(low, np.inf)
        if self.low < self.high:
            return float(shares @ np.exp(log_between(low, high)))
        sides = log_between(-infinite, low), log_between(low, infinite)
        return 2 * min(float(shares @ np.exp(side)) for side in sides)


def _at_level(values: Tensor, level: Array) -> Tensor:
    """Values (n, L) at levels (n,) that are indices with fractions."""
    below = np.minimum(level.astype(int), values.shape[1] - 2)
    return values[torch.arange(len(values)), torch.from_numpy(below)] + torch.from_numpy(level - below) * _by_level(
        values, level
    )


def _by_level(values: Tensor, level: Array) -> Tensor:
    """Change of values (n, L) from a level to the next, at levels (n,)."""
    rows, below = torch.arange(len(values)), torch.from_numpy(np.minimum(level.astype(int), values.shape[1] - 2))
    return values[rows, below + 1] - values[rows, below]
