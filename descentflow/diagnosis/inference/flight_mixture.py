r"""Mixture of single flights: normal ones, odd ones, and those that have an effect in one of its windows.

.. math:: p(r_f) = \pi_0 N(0, S) + \sum_k \pi_k N(0, S + b_k^2 K_k)
   + \sum_e \pi_e \sum_w \rho_{ew} \int_0^\infty N(r_f + o;\; a\,s_{fw} + o_f,\; S)\, N_+(a; \bar a_e, \sigma_e^2)\, da.

Odd flights depart smoothly in a way of their own. An effect's law - its share, sizes and windows - is learnt by EM; the
integral over sizes is in closed form. Residuals are about a mean that contains what the effect's flights have, so the
mean of their shifts is put back as an offset o.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from scipy.special import log_ndtr

from descentflow.core.linear_gaussian import Array, Precisions
from descentflow.diagnosis.sides.assumptions import ASSUMED, Assumptions
from descentflow.effects.flight_law import DiffersByFlight, Learnt
from descentflow.effects.flight_state import FlightState
from descentflow.effects.windowed_effect import WindowedEffect

SHUT_WINDOW = -1e6
"""Log probability of a window that a flight could not show."""
FIRST_ODD, FIRST_SHARE = 0.05, 0.2
"""Shares of each kind of odd flights, and of the flights with an effect, from which EM starts."""
FACTOR_STEP = 0.01
"""Step of a factor, for derivatives."""


@dataclass(frozen=True)
class FlightWindows:
    """Windows of an effect in n flights of which m rates are seen.

    Attributes:
        effect: Whose they are.
        state: The flights.
        start: Law (k,) from which EM starts.
        shape: (n, m) shift of a size of one.
        offset: (n, m) shift of a size of zero.
        weights: (W, m) of the shape in each window.
        open: (n, W) whether the flight could show it: windows end within what is seen of it.

    Example:
        >>> from descentflow.effects import EFFECTS
        >>> from descentflow.effects._example_flights import example_flights
        >>> state = example_flights()
        >>> windows = flight_windows(EFFECTS["speed_brake"], state, np.arange(11), np.ones((6, 11), dtype=bool))
        >>> windows.shape.shape, windows.weights.shape[1], windows.open.shape == (6, len(windows.weights))
        ((6, 11), 11, True)
    """

    effect: DiffersByFlight
    state: FlightState
    start: torch.Tensor
    shape: Array
    offset: Array
    weights: Array
    open: np.ndarray


def flight_windows(
    effect: DiffersByFlight,
    state: FlightState,
    bands: np.ndarray,
    seen: np.ndarray,
    law: torch.Tensor | None = None,
) -> FlightWindows:
    """Take the windows of an effect in the rate by altitude over time.

    Args:
        effect: Of the catalogue.
        state: Flights (n).
        bands: (m,) of the rates.
        seen: (n, m).
        law: About whose mean size shifts are linear in it, and from which EM starts; a wide one if absent.
    """
    start = effect.law_start(state) if law is None else law
    windows = effect.sought_about(start).windows(state, start)
    slots = [windows.slots.index(("rate", int(band))) for band in bands]
    weights = windows.weights[:, slots].numpy()
    whole = np.ptp(weights, axis=1) == 0.0
    top = np.where(seen, np.arange(len(bands)), -1).max(1)
    # A window that is open to the top of a flight is how its descent begins, and one open to the bottom how it ends.
    beyond_top = (weights > 0)[None] & (np.arange(len(bands)) >= top[:, None])[:, None]
    within = ~beyond_top.any(2)
    return FlightWindows(
        effect,
        state,
        start,
        np.where(seen, windows.shape[:, slots].numpy(), 0.0),
        np.where(seen, windows.offset[:, slots].numpy(), 0.0),
        weights,
        within | whole,
    )


@dataclass(frozen=True)
class LearntLaw:
    """Law by which flights have an effect, as the mixture learnt it.

    Attributes:
        effect: Whose law it is, with the windows among which it was sought.
        state: The flights.
        theta: Its parameters (k,).
        learnt: Sums over the flights by window.

    Example:
        >>> from descentflow.effects import EFFECTS
        >>> from descentflow.effects._example_flights import example_flights
        >>> sums = Learnt(torch.ones(1), torch.tensor([0.1]), torch.tensor([0.01]), flights=2)
        >>> law = LearntLaw(EFFECTS["geometric_path"], example_flights(), torch.zeros(3).double(), sums)
        >>> law.at(2.0)[1]  # twice as much shallower in the mean
        tensor(0.2000, dtype=torch.float64)
    """

    effect: DiffersByFlight
    state: FlightState
    theta: torch.Tensor
    learnt: Learnt

    def at(self, factor: float) -> torch.Tensor:
        """Parameters (k,) with the mean size times a factor, and flights as far apart as they are."""
        sums = self.learnt
        more = (factor - 1.0) * sums.mean_and_spread()[0]
        squared = sums.squared + more * (2.0 * sums.size + more * sums.taken)
        moved = Learnt(sums.taken, sums.size + more * sums.taken, squared, sums.flights)
        return self.effect.learn(self.state, self.theta, moved)

    def factor_sd(self, assumed: Assumptions) -> float:
        """Prior standard deviation of a factor of the sizes; one that holds over the whole flight looks like its mass.

        Args:
            assumed: Constants.
        """
        if isinstance(self.effect, WindowedEffect):
            return assumed.flight_size_error
        parameter = next(p for p in self.effect.parameters if not p.is_spread and p.shown_as != "flights")
        return assumed.prior_scales * parameter.scale / self.effect.size(self.theta)[1]

    def errors(self, factor_error: float) -> torch.Tensor:
        """Standard errors (k,): of the mean size by that of the factor, of a window's ends by their spread.

        A share is known as a count of flights, and what the grid of windows leaves open is uniform.
        """
        number = max(float(self.learnt.taken.sum()), 1.0)
        sized = (self.at(1.0 + FACTOR_STEP) - self.at(1.0 - FACTOR_STEP)) / (2.0 * FACTOR_STEP)
        errors = sized.abs() * factor_error
        for place, parameter in enumerate(self.effect.parameters):
            if parameter.is_spread or parameter.from_heterogeneity or parameter.shown_as == "flights":
                errors[place] = 0.0
        if isinstance(self.effect, WindowedEffect):
            wide = [
                float(v)
                for v, p in zip(self.theta, self.effect.parameters, strict=True)
                if p.is_spread and p.unit == "FL"
            ]
            own = sum(one**2 for one in wide) / number
            errors[list(self.effect.ends)] = math.sqrt(own + self.effect.grid_fl**2 / 12.0)
        return errors


@dataclass(frozen=True)
class MixtureFit:
    """The mixture at its likeliest.

    Attributes:
        log_likelihood: Of all flights.
        laws: By effect.
        shares: By effect: of the flights that could show it.
        taken: By effect: (n, W) probability that a flight has it in each window.
        sizes: By effect: (n, W) expected size in each window.
        normal: (n,) probability that a flight has no effect.
        offset: (m,) mean shift of the effects, which the mean contains.

    Example:
        >>> MixtureFit(0.0, {}, {}, {}, {}, np.ones(3), np.zeros(2)).normal.sum()
        np.float64(3.0)
    """

    log_likelihood: float
    laws: Mapping[str, LearntLaw]
    shares: Mapping[str, float]
    taken: Mapping[str, Array]
    sizes: Mapping[str, Array]
    normal: Array
    offset: Array


def fit_mixture(
    values: Array,
    seen: np.ndarray,
    spread: Array,
    odd: Sequence[Array],
    effects: Sequence[FlightWindows],
    rounds: int,
    law_flights: float = ASSUMED.law_flights,
    *,
    first_offset: Array | float = 0.0,
) -> MixtureFit:
    """Fit the shares, laws and offsets by EM.

    Args:
        values: (n, m) ln rate about the mean, zero where not seen.
        seen: (n, m).
        spread: (m, m) covariance of normal flights.
        odd: (m, m) further covariance of each kind of odd flights.
        effects: That some may have.
        rounds: Of EM.
        law_flights: Flights' worth of the law from which EM starts.
        first_offset: (m,) mean shift from which EM starts: a law of most flights is far from their mean.

    Example:
        >>> rng = np.random.default_rng(0)
        >>> values = 0.02 * rng.normal(size=(200, 3))
        >>> fit_mixture(values, np.full((200, 3), True), 4e-4 * np.eye(3), [0.01 * np.eye(3)], [], 10).normal.min()
        np.float64(1.0)
    """
    plain = Precisions(spread, seen)
    others = [Precisions(spread + more, seen) for more in odd]
    models = [_EffectWindows(effect, plain, law_flights) for effect in effects]
    share = np.array([1.0 - FIRST_ODD * len(odd) - FIRST_SHARE * len(models), *[FIRST_ODD] * len(odd)])
    share = np.concatenate([share, np.full(len(models), FIRST_SHARE)])
    whole, none = np.zeros(len(values)), np.zeros(values.shape[1])
    offset = none + first_offset if models else none
    for _ in range(rounds):
        x = values + offset * seen
        log = [plain.log_density(x), *(other.log_density(x) for other in others)]
        log += [log[0] + model.expect(x) for model in models]
        joint = np.stack(log, 1) + np.log(share)
        whole = np.logaddexp.reduce(joint, axis=1)
        posterior = np.exp(joint - whole[:, None])
        share = (posterior.sum(0) + 0.5) / (len(values) + 0.5 * len(share))
        for model, mine in zip(models, posterior[:, 1 + len(odd) :].T, strict=True):
            model.maximise(mine, seen)
        offset = sum((model.offset_of_mean for model in models), none)
    return MixtureFit(
        float(whole.sum()),
        {model.name: LearntLaw(model.coarse, model.windows.state, model.law, model.learnt) for model in models},
        {model.name: model.share for model in models},
        {model.name: model.taken for model in models},
        {model.name: model.size for model in models},
        1.0 - sum((model.taken.sum(1) for model in models), np.zeros(len(values))),
        offset,
    )


class _EffectWindows:
    """One effect of the mixture: its E-step over windows and sizes, and its M-step."""

    def __init__(self, windows: FlightWindows, plain: Precisions, law_flights: float) -> None:
        self.windows, self.plain, self.law, self.name = windows, plain, windows.start, windows.effect.name
        self._law_flights = law_flights
        self.coarse = windows.effect.sought_about(windows.start)
        carried, weights = plain.times(windows.offset), windows.weights.T
        squares = plain.precision * (windows.shape[:, :, None] * windows.shape[:, None])
        self._square = ((squares @ weights) * weights).sum(1)
        self._with_offset = (carried * windows.shape) @ weights
        self._offset_square = (carried * windows.offset).sum(1)
        self.taken = self.size = self._variance = np.zeros(windows.open.shape)
        self.share, self.offset_of_mean = 0.0, np.zeros(windows.weights.shape[1])

    def expect(self, x: Array) -> Array:
        """Log ratio (n,) of the density with the effect to that without, summed over windows."""
        _, mean, sd = self.coarse.size(self.law)
        carried = self.plain.times(x)
        precision = self._square + sd**-2.0
        towards = (carried * self.windows.shape) @ self.windows.weights.T - self._with_offset + mean / sd**2
        log = (
            (carried * self.windows.offset).sum(1)[:, None]
            - 0.5 * self._offset_square[:, None]
            + towards**2 / (2.0 * precision)
            - mean**2 / (2.0 * sd**2)
            - 0.5 * np.log(sd**2 * precision)
            + np.where(self.windows.open, 0.0, SHUT_WINDOW)
            + self.coarse.log_prior(self.windows.state, self.law).numpy()
        )
        # Sizes are positive: the law is cut off at zero, before and after the flight is seen.
        root = np.sqrt(precision)
        standing = towards / root
        log += log_ndtr(standing) - log_ndtr(mean / sd)
        whole: Array = np.logaddexp.reduce(log, axis=1)
        above = np.exp(-0.5 * standing**2 - log_ndtr(standing)) / math.sqrt(2.0 * math.pi)
        self.taken, self.size = np.exp(log - whole[:, None]), (standing + above) / root
        self._variance = np.maximum(1.0 - standing * above - above**2, 0.0) / precision
        return whole

    def maximise(self, mine: Array, seen: np.ndarray) -> None:
        """Learn the law from flights that have the effect with probabilities (n,)."""
        self.taken = self.taken * mine[:, None]
        often = np.exp(self.coarse.log_prior(self.windows.state, self.law).numpy())
        could = self.windows.open @ (often / often.sum())
        _, mean, sd = self.coarse.size(self.windows.start)
        before = self._law_flights * often / often.sum()
        self.learnt = Learnt(
            torch.from_numpy(self.taken.sum(0) + before),
            torch.from_numpy((self.taken * self.size).sum(0) + before * mean),
            torch.from_numpy((self.taken * (self.size**2 + self._variance)).sum(0) + before * (mean**2 + sd**2)),
            max(round(float(could.sum() + self._law_flights)), 1),
        )
        self.law = self.coarse.learn(self.windows.state, self.law, self.learnt)
        self.share = float(self.taken.sum() / max(could.sum(), 1.0))
        shown = ((self.taken * self.size) @ self.windows.weights) * self.windows.shape
        shown = shown + self.taken.sum(1)[:, None] * self.windows.offset
        self.offset_of_mean = shown.sum(0) / np.maximum(could @ seen, 1.0)
