"""Drag added within a window of altitude: speed brakes, or a restriction that makes crews use them."""

import math
from copy import copy
from typing import NamedTuple

import torch
from torch import Tensor

from descentflow.core.units import FL_M
from descentflow.effects.effect import AT_BOUND, FlightChange, Parameter, Shift
from descentflow.effects.flight_law import MOST_SPREAD, DiffersByFlight, Learnt, Windows, positive_size, spread_of
from descentflow.effects.flight_state import FlightState, log_rate
from descentflow.effects.turn import AS_MEASURED
from descentflow.effects.windowed_effect import WindowedEffect
from descentflow.measurements.along_track import MOST_BANK_DEG

NARROWEST_FL = 25.0
"""Brakes that are out over less than 2,500 ft are no procedure, and look like the change from Mach to CAS."""
ANSWERS_FL = 1.25
"""An aircraft takes some three seconds to answer to brakes that run out or in, at 2,500 ft/min."""
MOST_DRAG = 2.0
"""Largest drag added, as a share of CD0."""
LEAST_SHARE = 0.05
"""Least share of the flights: fewer are a few odd ones."""
LEAST_DRAG = 0.1
"""Share of CD0 below which nothing is out: small drag over a wide band is something else, of no fixed altitude."""
RUN_OUT_M = 90.0
"""Height over which brakes run out and in: some 8 s of descent. Half of it at either end counts as without."""
FROM_TOP_FL = 5.0
"""A window that is open to the top is a matter of how descents begin."""

GRID_FL = 10.0
"""Step of the levels at which windows of single flights end."""
FINE_FL = 2.5
"""Step of these levels about a law whose spreads are below that, where a coarser step would be a bias."""
LEAST_SPREAD_FL = FINE_FL
"""Least spread of own windows: less is one window for all, and no step of the grid would be passed."""
LEAST_SPREAD_EXTRA = 0.02
"""Least spread of the drag added between flights."""
FIRST_LAW = (0.4, 0.3, 40.0, 20.0, 0.3)
"""Drag, share of the flights, spread of the middle and of the height of own windows, and spread of the drag, from which
laws start: wide enough for any procedure."""
PRIOR_FLIGHTS = 1.0
"""Pseudo-flights of the law before, in the spreads of the next: no spread falls to zero by chance."""
NODES = ((-2.857, -1.356, 0.0, 1.356, 2.857), (0.0112574, 0.2220759, 0.5333333, 0.2220759, 0.0112574))
"""Gauss and Hermite's nodes and weights for a normal law (Abramowitz and Stegun, table 25.10, scaled)."""


class BrakeLaw(NamedTuple):
    """Parameters by name, in their order in theta (8,)."""

    extra_cd0: Tensor
    low_fl: Tensor
    high_fl: Tensor
    share: Tensor
    ln_ratio_noise: Tensor
    spread_middle_fl: Tensor
    spread_height_fl: Tensor
    spread_extra: Tensor

    @property
    def extra_where_out(self) -> Tensor:
        """Drag that is added in the flights that have brakes out."""
        return self.extra_cd0 / self.share

    @property
    def middle_fl(self) -> Tensor:
        """Middle of the mean window."""
        return (self.high_fl + self.low_fl) / 2

    @property
    def height_fl(self) -> Tensor:
        """Height of the mean window."""
        return self.high_fl - self.low_fl

    @property
    def is_one_window(self) -> bool:
        """True where all flights have the same window."""
        return float(self.spread_middle_fl) == 0.0 and float(self.spread_height_fl) == 0.0


class SpeedBrake(WindowedEffect, DiffersByFlight):
    """CD0 higher between two altitudes on a share of the flights; ``extra_cd0`` is the mean over all flights.

    Example:
        >>> from descentflow.effects._example_flights import example_flights
        >>> shift = SpeedBrake().shift(example_flights(), torch.tensor([0.3, 200, 240, 1, 0, 0, 0, 0]))
        >>> (shift["rate"].mean(0) > 0.01).nonzero()[:, 0]  # bands of 2,000 ft from FL150
        tensor([2, 3, 4])
        >>> share, whole = SpeedBrake().mixture(torch.tensor([0.3, 200, 240, 0.6, 0, 0, 0, 0]))
        >>> round(share, 1), round(float(whole[0]), 1)  # six flights in ten, each with half as much drag again
        (0.6, 0.5)
    """

    name = "speed_brake"
    description = "speed brakes, or as much drag, within a band of altitude"
    inherited_from = 0.1
    ends = (1, 2)
    inset_fl = RUN_OUT_M / FL_M
    own_draws = 3
    grid_fl = GRID_FL
    _about: tuple[float, float] | None = None
    parameters = (
        Parameter(
            "extra_cd0",
            0.0,
            MOST_DRAG,
            "1",
            0.1,
            0.0,
            label="parasitic drag added, mean over all flights",
            shown_as="change",
            symbol="CD0",
        ),
        Parameter("low_fl", 0.0, 600.0, "FL", 10.0, inexact=ANSWERS_FL, label="lower end"),
        Parameter("high_fl", 0.0, 600.0, "FL", 10.0, inexact=ANSWERS_FL, label="upper end"),
        Parameter(
            "share",
            LEAST_SHARE,
            1.0,
            "1",
            0.1,
            1.0,
            from_heterogeneity=True,
            label="share of the flights with brakes out",
            shown_as="flights",
        ),
        Parameter(
            "ln_ratio_noise",
            0.0,
            1.5,
            "1",
            0.1,
            label="ln of the ratio of short-scale noise",
            shown_as="logarithm",
            symbol="short-scale noise",
            by_product=True,
        ),
        spread_of("spread_middle_fl", 100.0, "FL", 10.0, "spread of the window's middle between flights"),
        spread_of("spread_height_fl", 50.0, "FL", 10.0, "spread of the window's height between flights"),
        spread_of("spread_extra", 2.0, "1", 0.1, "spread of the drag between flights with brakes out", "percent"),
    )
    misfit_of_rate = 0.1

    def plausible(self, state: FlightState, theta: Tensor) -> bool:
        """Brakes are felt where they are out; their window has a height, ends below the top and is no whole descent.

        A share of the flights that was driven to its least is of a few odd ones, and of no procedure.
        """
        law, (_, top) = BrakeLaw(*theta), self.range_fl(state)
        felt = float(law.extra_where_out) >= LEAST_DRAG
        bounded = float(law.extra_cd0) < MOST_DRAG - AT_BOUND
        shared = float(law.share) > LEAST_SHARE + AT_BOUND
        within = NARROWEST_FL <= float(law.height_fl) <= self.longest_fl(state)
        return felt and bounded and shared and within and float(law.high_fl) < top - FROM_TOP_FL

    def may_be(self, state: FlightState, theta: Tensor) -> tuple[str, ...]:
        """Turns, where no heading is known, each flight has its own drag, and a bank of an airliner adds as much.

        What it adds is known as well as that of a turn by headings.
        """
        if state.turned_more is not None or not self.is_law(theta):
            return ()
        law = BrakeLaw(*theta)
        within = state.mask * self.within(state, law.low_fl, law.high_fl)["rate"]
        bank = log_rate(state, induced=1 + math.tan(math.radians(MOST_BANK_DEG)) ** 2) - state.own_log_rate
        brakes = self.whole_change(state, law.extra_where_out)
        return ("turn",) if float((within * (brakes - AS_MEASURED[1] * bank)).sum()) <= 0 else ()

    def whole_change(self, state: FlightState, size: Tensor) -> Tensor:
        """By the energy equation."""
        return log_rate(state, parasitic=1 + size) - state.own_log_rate

    def shift(self, state: FlightState, theta: Tensor) -> Shift:
        """Rate by the energy equation within the window, on the share that flies it; mean over own windows."""
        law = BrakeLaw(*theta)
        change = law.share * self.whole_change(state, law.extra_where_out)
        shown = {quantity: weight * change for quantity, weight in self._mean_within(state, law).items()}
        # Edges of a window are steps of the rate, which count as short-scale noise.
        return {**shown, "noise_rate": law.ln_ratio_noise * torch.ones_like(change[:, 0])}

    def _mean_within(self, state: FlightState, law: BrakeLaw) -> dict[str, Tensor]:
        """Weight of each band in the mean over the windows of the law."""
        if law.is_one_window:
            return self.within(state, law.low_fl, law.high_fl)
        total: dict[str, Tensor] = {}
        for x, u in zip(*NODES, strict=True):
            for y, v in zip(*NODES, strict=True):
                half = (0.5 * (law.height_fl + y * law.spread_height_fl)).clamp(min=0.0)
                centre = law.middle_fl + x * law.spread_middle_fl
                for quantity, weight in self.within(state, centre - half, centre + half).items():
                    total[quantity] = total.get(quantity, 0.0) + u * v * weight
        return total

    def mixture(self, theta: Tensor) -> tuple[float, Tensor]:
        """Flights have them out or do not."""
        law = BrakeLaw(*theta)
        share, noise = law.share, law.ln_ratio_noise / law.share
        own = law._replace(extra_cd0=law.extra_where_out, share=torch.ones_like(share), ln_ratio_noise=noise)
        return float(share), torch.stack(own)

    def law_start(self, state: FlightState) -> Tensor:
        """Windows of each flight's own about the middle third of the levels."""
        size, share, middle, height, spread = FIRST_LAW
        low, high = self.range_fl(state)
        third = (high - low) / 3.0
        law = [size * share, low + third, high - third, share, 0.0, middle, height, spread * size]
        return torch.tensor(law, dtype=torch.float64)

    def windows(self, state: FlightState, theta: Tensor) -> Windows:
        """The law's window, or all windows of the grid where each flight has its own."""
        law, (size, _, _) = BrakeLaw(*theta), self.size(theta)
        shape = self.whole_change(state, torch.tensor(size, dtype=torch.float64)) / size
        ends, lower, upper = self._windows(state, law)
        inset = self.inset_fl / 2
        first, second = (self.below(state, at) for at in (ends + inset, ends - inset))
        slots = tuple((quantity, band) for quantity in first for band in range(shape.shape[1]))
        # Edges of a window are short-scale noise, the more the larger the drag: all upper rows have it.
        noise = torch.full_like(shape[:, :1], float(law.ln_ratio_noise / law.extra_cd0))
        shape = torch.cat([shape] * len(first) + [noise], 1)
        rows = [torch.cat(list(part.values()), 1) for part in (first, second)]
        table = torch.cat([torch.nn.functional.pad(row, (0, 1), value=k) for k, row in enumerate(rows)])
        names = (*slots, ("noise_rate", -1))
        return Windows(names, shape, torch.zeros_like(shape), table, lower, upper + len(ends))

    def _windows(self, state: FlightState, law: BrakeLaw) -> tuple[Tensor, Tensor, Tensor]:
        """Ends (E,) of windows, and which of them are the lower and the upper one of each (W,)."""
        if law.is_one_window:
            return torch.stack([law.low_fl, law.high_fl]), torch.tensor([0]), torch.tensor([1])
        low, high = self.range_fl(state)
        # Brakes that are out at the bottom of the levels were out further down as well: how far, the law tells.
        steps = math.ceil(self.longest_fl(state) / 2 / self.grid_fl)
        ends = torch.arange(low - steps * self.grid_fl, high + self.grid_fl / 2, self.grid_fl, dtype=torch.float64)
        height = ends - ends[:, None]
        chosen = (height >= NARROWEST_FL) & (height <= self.longest_fl(state)) & (ends >= low + NARROWEST_FL)
        if self._about:
            usual, tall = self._about
            near = ((ends + ends[:, None]) / 2 - usual).abs() <= GRID_FL
            chosen = chosen & near & ((height - tall).abs() <= GRID_FL)
        lower, upper = torch.nonzero(chosen, as_tuple=True)
        return ends, lower, upper

    def sought_about(self, theta: Tensor) -> "SpeedBrake":
        """The same with a finer grid about a law of nearly one window."""
        law = BrakeLaw(*theta)
        if law.is_one_window or max(float(law.spread_middle_fl), float(law.spread_height_fl)) >= GRID_FL:
            return self
        finer = copy(self)
        finer.grid_fl, finer._about = FINE_FL, (float(law.middle_fl), float(law.height_fl))
        return finer

    def log_prior(self, state: FlightState, theta: Tensor) -> Tensor:
        """Normal laws of the middle and the height of a window."""
        law = BrakeLaw(*theta)
        ends, lower, upper = self._windows(state, law)
        if len(lower) == 1:
            return torch.zeros(1, dtype=torch.float64)
        middle, height = (ends[upper] + ends[lower]) / 2, ends[upper] - ends[lower]
        log = -0.5 * ((middle - law.middle_fl) / law.spread_middle_fl) ** 2
        log = log - 0.5 * ((height - law.height_fl) / law.spread_height_fl) ** 2
        return log - log.logsumexp(0)

    def size(self, theta: Tensor) -> tuple[float, float, float]:
        """Share of the flights with brakes out, and the drag that they add in those."""
        law = BrakeLaw(*theta)
        return float(law.share), float(law.extra_where_out), float(law.spread_extra)

    def learn(self, state: FlightState, theta: Tensor, learnt: Learnt) -> Tensor:
        """Share, drag and windows of the flights with brakes out."""
        before, (size, spread) = BrakeLaw(*theta), learnt.mean_and_spread()
        share, size = min(max(learnt.share, LEAST_SHARE), 1.0), max(size, LEAST_DRAG / 2)
        law = {name: float(value) for name, value in before._asdict().items()}
        law |= {"share": share, "extra_cd0": size * share}
        law["ln_ratio_noise"] = float(before.ln_ratio_noise / before.share) * share
        law["spread_extra"] = min(max(spread, LEAST_SPREAD_EXTRA), MOST_SPREAD * size)
        ends, lower, upper = self._windows(state, before)
        if len(lower) > 1:
            middles, heights = (ends[upper] + ends[lower]) / 2, ends[upper] - ends[lower]
            middle, of_middle = _mean_and_spread(middles, learnt.taken, float(before.spread_middle_fl))
            height, of_height = _mean_and_spread(heights, learnt.taken, float(before.spread_height_fl))
            law |= {"low_fl": middle - height / 2, "high_fl": middle + height / 2}
            law |= {"spread_middle_fl": of_middle, "spread_height_fl": of_height}
        return self.clamp(torch.tensor(list(law.values()), dtype=theta.dtype))

    def own_change(self, state: FlightState, theta: Tensor, uniform: Tensor) -> FlightChange:
        """The rate in a window of each flight's own."""
        law, inset = BrakeLaw(*theta), self.inset_fl / 2
        place, tall = torch.special.ndtri(uniform[:, :2].clamp(min=1e-12)).unbind(1)
        middle, height = law.middle_fl + place * law.spread_middle_fl, law.height_fl + tall * law.spread_height_fl
        half = height.clamp(min=NARROWEST_FL) / 2
        extra = positive_size(uniform[:, 2], law.extra_cd0, law.spread_extra)
        within = self.below(state, middle + half - inset)["rate"] - self.below(state, middle - half + inset)["rate"]
        return FlightChange(flown={"rate": within * self.whole_change(state, extra[:, None])})


def _mean_and_spread(values: Tensor, weight: Tensor, before: float) -> tuple[float, float]:
    """Weighted mean and standard deviation of values (W,), with a little of the spread before."""
    total = weight.sum().clamp(min=1e-9)
    mean = (weight * values).sum() / total
    variance = ((weight * (values - mean) ** 2).sum() + PRIOR_FLIGHTS * before**2) / (total + PRIOR_FLIGHTS)
    return float(mean), max(float(variance) ** 0.5, LEAST_SPREAD_FL)
