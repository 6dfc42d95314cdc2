r"""A time or a distance at a level: not linear in the latent numbers, so met along a line and weighted.

Time is a sum of reciprocals of rates, so that its own reciprocal, a mean rate, is nearly linear in drag in newtons, and
minus its logarithm in drag on its logarithmic scale: that, T, is what is met.
With the slope g of T at a Gaussian's mean and the covariance $\Sigma$ that is left by the rows of
:mod:`~descentflow.generation.conditional.speed_conditions`, the direction $v = \Sigma g$ leaves the rows as they are,
and the coordinate s along it is independent of the rest, with variance $1 / g^T v$. A draw keeps its rest; its s is
solved for the value t that is asked. The density of such draws given that the quantity T is t is that of the rest times
$\phi(s) / \lvert\partial T / \partial s\rvert$, which becomes their weight. Of a band, t is first drawn from the
normal that the slope implies, cut to the band; of a band of levels, the level is drawn evenly, and the weight has the
change of T by level.
"""

from dataclasses import dataclass
from math import log, pi

import numpy as np

from descentflow.generation.conditional.constraints import PointAsked
from descentflow.generation.conditional.flown_profiles import Array, FlownProfiles
from descentflow.generation.conditional.latent_parts import LatentParts
from descentflow.generation.conditional.latent_profiles import Curves
from descentflow.generation.conditional.point_measure import Measure
from descentflow.generation.conditional.speed_conditions import Conditions, cut_normal, log_between, log_total

STEP_N, STEP_MPS = 50.0, 0.1
"""Steps of drag and CAS over which slopes are taken; they steer proposals alone."""
STEP_SD = 0.05
"""Step along the line, in standard deviations, over which the slope of the weight is taken."""
TOLERANCE = {"time_s": 1e-3, "distance_nm": 1.0}
"""Largest distance (s, m) of a draw from the value asked: less than anyone measures, more than the last step leaves."""
LEVELS_OF_A_BAND = 9
"""Levels of a band at which the shares of the Gaussians are found."""
LEAST_SPREAD = 1e-6
"""Standard deviation, as a share of the value, that keeps the arithmetic finite where speeds leave nothing open."""


@dataclass(frozen=True)
class Flown:
    """n descents in the W columns of the grid, and their time at its L levels.

    Attributes:
        drag: (n, W) N.
        cas: (n, W) m/s.
        mach: (n, W).
        tas: (n, W) m/s.
        rate: (n, W) m/s, negative in descent.
        seconds: (n, L) of :meth:`FlownProfiles.seconds`: zero at the lowest level.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> decoder = load_model("best.ckpt").representation.decoder
        >>> grid, mean = FlownProfiles(decoder), torch.zeros(1, decoder.dimension).double()
        >>> flown = Flown.of(grid, Curves(*(grid.columns(values.numpy()) for values in decoder.profiles(mean))))
        >>> np.allclose(flown.mach[:, : grid.n_levels], decoder(mean).mach.numpy(), rtol=1e-12)
        True
    """

    drag: Array
    cas: Array
    mach: Array
    tas: Array
    rate: Array
    seconds: Array

    @classmethod
    def of(cls, grid: FlownProfiles, curves: Curves) -> "Flown":
        """Fly profiles (n, W)."""
        drag = grid.drag_n(curves.drag, curves.cas)
        mach, tas, rate, slowness = grid.fly(drag, curves.cas)
        return cls(drag, curves.cas, mach, tas, rate, grid.seconds(slowness))


class PointCondition:
    """A time or a distance at a level, for C Gaussians whose descents start at one level.

    ``log_probs`` (C,) are the shares of the Gaussians given the rows and, as far as the slope implies, the point;
    ``tail`` is how probable what is asked is then.

    Args:
        asked: The time or the distance.
        parts: The C Gaussians.
        grid: Of the decoder.
        entry: Index of the level where the descents start.
        speeds: What else is asked.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> from descentflow.generation.conditional.latent_parts import parts_of
        >>> from descentflow.generation.conditional.speed_conditions import Rows, conditions
        >>> model = load_model("best.ckpt")
        >>> grid = FlownProfiles(model.representation.decoder)
        >>> parts, entry, level = parts_of(model, grid, None), grid.nearest(330), grid.nearest(100)
        >>> u = np.zeros_like(parts.means)
        >>> free = conditions(parts.log_probs, parts.means, parts.roots, Rows(u[:, None][:, :0], *[u[:, :0]] * 3))
        >>> point = PointCondition(PointAsked("time_s", 600.0, 600.0, (100.0, 100.0)), parts, grid, entry, free)
        >>> _, flown, log_weight = point.meet(np.array([0]), u[:1], np.array([0.5]))
        >>> round(float(flown.seconds[0, level] - flown.seconds[0, entry]), 2), bool(np.isfinite(log_weight[0]))  # s
        (600.0, True)
    """

    def __init__(
        self, asked: PointAsked, parts: LatentParts, grid: FlownProfiles, entry: int, speeds: Conditions
    ) -> None:
        """Take slopes at the Gaussians' means given the speeds."""
        self.asked, self.parts, self.grid, self.entry, self.speeds = asked, parts, grid, entry, speeds
        self.measure = Measure(logarithm=grid.drag_scale.logarithm)
        self.low = float(self.measure.of(np.array(asked.high * asked.unit)))
        self.high = float(self.measure.of(np.array(asked.low * asked.unit))) if asked.low > 0 else np.inf
        self.levels = np.interp(asked.levels, grid.levels_fl, np.arange(grid.n_levels))
        n_cells = len(parts.means)
        middle, _ = speeds.values(np.arange(n_cells), np.full((n_cells, speeds.rows.n_rows), 0.5))
        self.moved = (speeds.gain * (middle - speeds.rows.centre)[:, None]).sum(2)
        mean = parts.means + self.moved
        curves = parts.profiles.of(mean)
        self.profile = self._since_entry(Flown.of(grid, curves))
        self.slope = self._slope(curves)
        spread = parts.roots @ (parts.roots.mT @ self.slope[:, :, None])
        direction = (spread - speeds.gain @ (speeds.rows.matrix @ spread))[:, :, 0]
        middle_level = np.full(n_cells, self.levels.mean())
        least = LEAST_SPREAD * self.measure.share(self._measured(self.profile, middle_level))
        self.variance = np.maximum((self.slope * direction).sum(1), least**2)
        self.direction = direction
        self.by_s = parts.profiles.change(direction)
        levels = (
            np.linspace(self.levels[0], self.levels[1], LEVELS_OF_A_BAND) if self.is_level_band else self.levels[:1]
        )
        self.own = log_total(np.stack([self._log_share(level) for level in levels])) - log(len(levels))
        total = speeds.log_probs + self.own
        self.log_probs = total - log_total(total) if np.isfinite(total).any() else speeds.log_probs
        self.tail = self._tail(levels)

    @property
    def is_level_band(self) -> bool:
        """True where a value is asked within a band of levels."""
        return bool(self.levels[0] < self.levels[1])

    def meet(self, cell: np.ndarray, u: Array, uniform: Array) -> tuple[Array, Flown, Array]:
        """Draws (n, D) of the Gaussians minus their means that meet the speeds, moved to meet the point as well.

        Args:
            cell: (n,) which Gaussian.
            u: (n, D).
            uniform: (n,) in (0, 1).

        Returns:
            The draws, what they fly, and their log weights (n,): minus infinity where the line does not meet the point.
        """
        parts, variance = self.parts, self.variance[cell]
        seen = (self.speeds.rows.matrix[cell] * u[:, None]).sum(2)
        given = (self.speeds.gain[cell] * seen[:, None]).sum(2)
        slope, direction = self.slope[cell], self.direction[cell]
        u = u - direction * ((slope * (u - given)).sum(1) / variance)[:, None]
        level = self.levels[0] + (self.levels[1] - self.levels[0]) * uniform
        expected = self._measured(self.profile[cell], level) + (slope * (given - self.moved[cell])).sum(1)
        target, log_weight = self._target(expected, np.sqrt(variance), uniform)
        whole = parts.means[cell] + u
        line = parts.profiles.of(whole), self.by_s.rows(cell)
        s, flown, slope_s, off = self._solve(*line, (target - expected) / variance, target, level, variance)
        with np.errstate(divide="ignore", invalid="ignore"):
            log_weight += 0.5 * np.log(variance / (2 * pi)) - 0.5 * variance * s**2 - np.log(slope_s) - self.own[cell]
            if self.is_level_band:
                log_weight += np.log(np.abs(_by_level(self._since_entry(flown), level)) * self.measure.slope(target))
        met = np.isfinite(log_weight) & (np.abs(off) <= TOLERANCE[self.asked.name])
        return u + s[:, None] * direction, flown, np.where(met, log_weight, -np.inf)

    def _target(self, expected: Array, sd: Array, uniform: Array) -> tuple[Array, Array]:
        """The value that each draw shall have, and minus the log density of having drawn it."""
        if self.low == self.high:
            return np.full_like(expected, self.low), np.zeros_like(expected)
        low, high = (self.low - expected) / sd, (self.high - expected) / sd
        white = cut_normal(low, high, uniform)
        return expected + sd * white, 0.5 * white**2 + 0.5 * np.log(2 * pi * sd**2) + log_between(low, high)

    def _solve(
        self, curves: Curves, by_s: Curves, s: Array, target: Array, level: Array, variance: Array
    ) -> tuple[Array, Flown, Array, Array]:
        """A step by the slope at the mean, and one of Newton; the slope there, and how far off the result is."""

        def at(s: Array) -> tuple[Flown, Array]:
            flown = Flown.of(self.grid, curves.moved(s[:, None], by_s))
            return flown, self._measured(self._since_entry(flown), level)

        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            found, ahead = s + (target - at(s)[1]) / variance, STEP_SD / np.sqrt(variance)
            value = at(found)[1]
            slope = (at(found + ahead)[1] - value) / ahead
            found = found + (target - value) / slope
            flown, value = at(found)
            return found, flown, slope, self.measure.back(value) - self.measure.back(target)

    def _since_entry(self, flown: Flown) -> Array:
        """Seconds or metres (n, L) since entry, growing downwards."""
        since = flown.seconds
        if self.asked.name == "distance_nm":
            since = self.grid.metres(flown.tas, flown.rate, flown.seconds)
        return since - since[:, self.entry : self.entry + 1]

    def _slope(self, curves: Curves) -> Array:
        """Slopes (C, D) of T at the middle of the levels, from those of its integrand column by column."""
        middle = round(float(self.levels.mean()))
        columns = self.grid.seconds(np.eye(self.grid.width))
        weights = columns[:, middle] - columns[:, self.entry]
        drag, more = self.grid.drag_n(curves.drag, curves.cas), curves.cas + STEP_MPS
        here, heavier, faster = (
            self._integrand(*profiles)
            for profiles in (
                (drag, curves.cas),
                (drag + STEP_N, curves.cas),
                (self.grid.drag_n(curves.drag, more), more),
            )
        )
        by_newton = weights * (heavier - here) / STEP_N
        by_drag = by_newton * self.grid.drag_slope(curves.drag, curves.cas) @ self.parts.profiles.drag.loadings.T
        by_cas = weights * (faster - here) / STEP_MPS @ self.parts.profiles.cas.loadings.T
        value = self._measured(self.profile, np.full(len(here), self.levels.mean()))
        found: Array = -(by_drag + by_cas) * self.measure.slope(value)[:, None]
        return found

    def _measured(self, values: Array, level: Array) -> Array:
        """T of times or distances (n, L) at levels (n,) that are indices with fractions."""
        return self.measure.of(_at_level(values, level))

    def _integrand(self, drag: Array, cas: Array) -> Array:
        _, tas, _, slowness = self.grid.fly(drag, cas)
        return slowness * tas * self.grid.airspeed_ratio if self.asked.name == "distance_nm" else slowness

    def _log_share(self, level: float) -> Array:
        """Log probability (C,) of what is asked at a level (an index), by the slopes."""
        sd = np.sqrt(self.variance)
        expected = self._measured(self.profile, np.full(len(sd), level))
        low, high = (self.low - expected) / sd, (self.high - expected) / sd
        return log_between(low, high) if self.low < self.high else -0.5 * low**2 - np.log(sd) - 0.5 * log(2 * pi)

    def _tail(self, levels: Array) -> float:
        """Probability of the band, or of what is at least as far out as the value, on its side; at the best level."""
        shares, sd = np.exp(self.speeds.log_probs), np.sqrt(self.variance)
        found = []
        for level in levels:
            expected = self._measured(self.profile, np.full(len(sd), level))
            low, high = (self.low - expected) / sd, (self.high - expected) / sd
            if self.low < self.high:
                found.append(float(shares @ np.exp(log_between(low, high))))
            else:
                infinite = np.full_like(low, np.inf)
                sides = log_between(-infinite, low), log_between(low, infinite)
                found.append(2 * min(float(shares @ np.exp(side)) for side in sides))
        return max(found)


def _at_level(values: Array, level: Array) -> Array:
    """Values (n, L) at levels (n,) that are indices with fractions."""
    rows, below = np.arange(len(values)), np.minimum(level.astype(int), values.shape[1] - 2)
    found: Array = values[rows, below] + (level - below) * (values[rows, below + 1] - values[rows, below])
    return found


def _by_level(values: Array, level: Array) -> Array:
    """Change of values (n, L) from a level to the next, at levels (n,)."""
    rows, below = np.arange(len(values)), np.minimum(level.astype(int), values.shape[1] - 2)
    found: Array = values[rows, below + 1] - values[rows, below]
    return found
