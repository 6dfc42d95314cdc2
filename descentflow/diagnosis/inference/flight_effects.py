r"""Effects that some flights have, each in its own way, by the shapes of single flights.

Mean and residuals of normal samples are independent, so what the shapes gain multiplies the evidence of the means: for
an effect e besides others,

.. math:: G_e = \Delta\ln L_\mathrm{real} - \max(\Delta\ln L_\mathrm{sim}, 0)\,\frac{n_r}{n_s} - \tfrac32 \ln n_r,

the log likelihood with the effect minus that without, less what the simulator's own flights gain by it, less the price
of three parameters (BIC). Effects are added one after the other as long as that is above zero.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch

from descentflow.core.linear_gaussian import Array
from descentflow.diagnosis.findings.costs_found import NINETY
from descentflow.diagnosis.inference._flight_rates import FlightRates, Spread, flight_rates, spread_of
from descentflow.diagnosis.inference.candidates import FlightsEffect
from descentflow.diagnosis.inference.flight_mixture import FlightWindows, MixtureFit, fit_mixture, flight_windows
from descentflow.diagnosis.inference.moments import Moments
from descentflow.diagnosis.inference.signatures import Signatures
from descentflow.diagnosis.sides.two_sides import Compared
from descentflow.effects import Effect
from descentflow.effects.flight_law import DiffersByFlight
from descentflow.effects.flight_state import log_rate

FEWEST_FLIGHTS = 10
"""Real flights whose shapes can tell anything."""
FEWEST_BANDS = 4
"""Bands of a flight whose shape is looked at."""
SHORT_EM_ROUNDS, EM_ROUNDS = 8, 25
"""Rounds of EM while the spread of normal flights is sought, and after it."""
LAW_PARAMETERS = 3.0
"""Parameters of a law: its share, and mean and spread of its sizes."""


@dataclass(frozen=True)
class Side:
    """Flights of one side.

    Attributes:
        index: (n,) positions among the compared flights.
        values: (n, m) rates about the mean.
        seen: (n, m).
        windows: Windows by effect.

    Example:
        >>> Side(np.arange(2), np.zeros((2, 3)), np.ones((2, 3), dtype=bool), {}).values.shape
        (2, 3)
    """

    index: np.ndarray
    values: Array
    seen: np.ndarray
    windows: Mapping[str, FlightWindows]


class FlightShapes:
    """The shapes of the flights of both sides."""

    def __init__(self, compared: Compared, known: Moments, effects: Sequence[DiffersByFlight]) -> None:
        """Take the flights.

        Args:
            compared: Flights of both sides.
            known: Their moments.
            effects: That flights may have each in its own way.
        """
        self.compared, self.known, self.assumed = compared, known, compared.assumed
        self.effects = {effect.name: effect for effect in effects}
        self.rates = flight_rates(compared, known)
        real = compared.real.numpy()
        enough = self.rates.seen.sum(1) >= FEWEST_BANDS
        self.real, self.simulated = self._side(real & enough), self._side(~real & enough)
        self.spread = self._spread()
        self.first_offset = known.difference[self.rates.entries]
        self._kept: dict[tuple[bool, tuple[str, ...]], MixtureFit] = {}

    def candidates(self, signatures: Signatures) -> list[FlightsEffect]:
        """The effects whose shapes gain, each with its mean shift; one that gains nothing alone is tried with no other.

        Args:
            signatures: For what their equations miss.
        """
        chosen: tuple[str, ...] = ()
        if len(self.real.index) < FEWEST_FLIGHTS:
            return []
        alone = [name for name in self.effects if self._gain((name,)) > 0.0]
        while rest := [name for name in alone if name not in chosen]:
            best = max(rest, key=lambda name: self._gain((*chosen, name)))
            larger = (*chosen, best)
            if self._gain(larger) <= self._gain(chosen) or not self._possible(larger, best):
                break
            chosen = larger
        gaining = []
        for name in chosen:
            without = tuple(other for other in chosen if other != name)
            parts = self._mean_shift(self.real, chosen, name) - self._mean_shift(self.simulated, chosen, name)
            misfit = signatures.smooth_misfit(parts.sum(1), self.effects[name].misfit_of_rate)
            law, gain = self.fit(self.real, chosen).laws[name], self._gain(chosen) - self._gain(without)
            factors = np.array([law.factor_sd(self.assumed), self.assumed.flight_size_error])[: parts.shape[1]]
            gaining.append(FlightsEffect(name, law, parts, gain, misfit, factors))
        return gaining

    def _possible(self, names: tuple[str, ...], name: str) -> bool:
        """Test for a law that an effect can have, that is none of another, and that enough flights have."""
        fit, effect, state = self.fit(self.real, names), self.effects[name], self.real.windows[name].state
        share, theta = fit.shares[name], fit.laws[name].theta
        # As many flights as chance may add are no procedure: the least share is surely passed, not by estimate.
        chance = NINETY * math.sqrt(share * (1.0 - share) / len(self.real.index))
        is_shared = share - self.fit(self.simulated, names).shares[name] - chance > self.assumed.least_share
        return is_shared and effect.plausible(state, theta) and not effect.may_be(state, theta)

    def shifts_by_flight(self, names: Sequence[str]) -> Array:
        """Expected shift (n, m) of ln rate of each real flight by effects, in the flights and bands of ``real``."""
        fit = self.fit(self.real, tuple(names))
        shifts = np.zeros_like(self.real.values)
        for name in names:
            mine, law, effect = self.real.windows[name], fit.laws[name].theta, fit.laws[name].effect
            windows = effect.windows(mine.state, law)
            at = [windows.slots.index(("rate", int(band))) for band in self.rates.bands]
            sized = (fit.taken[name] * fit.sizes[name]) @ windows.weights[:, at].numpy()
            shifts += sized * windows.shape[:, at].numpy()
            shifts += fit.taken[name].sum(1)[:, None] * windows.offset[:, at].numpy()
        return shifts

    def fit(self, side: Side, names: tuple[str, ...]) -> MixtureFit:
        """The mixture of one side, with normal flights as wide as they are likeliest."""
        key = side is self.real, names
        if key not in self._kept:
            self._kept[key] = self._fitted(side, names)
        return self._kept[key]

    def _fitted(self, side: Side, names: tuple[str, ...]) -> MixtureFit:
        """At the likeliest spread of normal flights, sought from the simulator's, from a narrow and from a wide one."""
        windows = [side.windows[name] for name in names]
        none = (0.0,) * len(self.spread.shapes)
        tried: dict[tuple[float, ...], MixtureFit] = {}
        _, white, level, *_ = self.spread.grid
        # Where many flights have the effect, those that could not show it would widen the others' spread.
        for start in (none, (level, white, white, *none[3:]), (level,) * len(none)):
            sizes: tuple[float, ...] = start
            while sizes not in tried:
                short = self._mixture(side, windows, sizes, SHORT_EM_ROUNDS)
                tried[sizes] = short
                values = side.values + short.offset * side.seen
                sizes = tuple(self.spread.likeliest(values, side.seen, short.normal, sizes))
        best = max(tried, key=lambda names: tried[names].log_likelihood)
        about = [self._about(side, name, tried[best].laws[name].theta) for name in names]
        return self._mixture(side, about, best, EM_ROUNDS)

    def _about(self, side: Side, name: str, law: torch.Tensor) -> FlightWindows:
        """Windows about the sizes of a law: a shift is not linear in them."""
        return flight_windows(self.effects[name], side.windows[name].state, self.rates.bands, side.seen, law)

    def _mixture(
        self, side: Side, windows: Sequence[FlightWindows], sizes: tuple[float, ...], rounds: int
    ) -> MixtureFit:
        odd = [size**2 * shape for shape in self.spread.shapes[2:] for size in self.assumed.odd]
        spread, law_flights = self.spread.at(sizes), self.assumed.law_flights
        first = self.first_offset if side is self.real else 0.0
        return fit_mixture(side.values, side.seen, spread, odd, windows, rounds, law_flights, first_offset=first)

    def _gain(self, names: tuple[str, ...]) -> float:
        """Nats that the shapes gain by effects."""
        if not names:
            return 0.0
        count = len(self.real.index)
        price = 0.5 * LAW_PARAMETERS * len(names) * math.log(count)
        real = self._gain_of(self.real, names) - price
        # The simulator's own flights, of which there may be none, can only lessen what is not gained anyway.
        theirs = self._gain_of(self.simulated, names) if real > 0.0 else 0.0
        return real - max(theirs, 0.0) * count / max(len(self.simulated.index), 1)

    def _gain_of(self, side: Side, names: tuple[str, ...]) -> float:
        return self.fit(side, names).log_likelihood - self.fit(side, ()).log_likelihood

    def _mean_shift(self, side: Side, names: tuple[str, ...], name: str) -> Array:
        """Mean shift (p, c) of what is compared, late reports included; c is two where a part has no size."""
        fit, mine = self.fit(side, names), side.windows[name]
        effect, law = fit.laws[name].effect, fit.laws[name].theta
        windows = effect.windows(replace(mine.state, report_delay_s=self.compared.state.report_delay_s), law)
        taken, sized = fit.taken[name], fit.taken[name] * fit.sizes[name]
        shown = [
            (sized @ windows.weights.numpy()) * windows.shape.numpy(),
            taken.sum(1)[:, None] * windows.offset.numpy(),
        ]
        shown = shown[: 1 + bool(windows.offset.any())]
        slots = {slot: k for k, slot in enumerate(windows.slots)}
        place = {band: k for k, band in enumerate(self.rates.bands)}
        could = fit.shares[name] / max(taken.sum(), 1e-9)
        shift = np.zeros((len(self.known.difference), len(shown)))
        for i, entry in enumerate(self.compared.entries):
            if entry.band >= 0 and (entry.quantity, entry.band) in slots:
                k = place.get(entry.band)
                seen = np.ones(len(taken), dtype=bool) if k is None else side.seen[:, k]
                # Of the flights that show the band and could show the effect.
                weight = seen * could * len(taken) / max(seen.sum(), 1)
                shift[i] = [weight @ part[:, slots[entry.quantity, entry.band]] for part in shown]
        return shift

    def _side(self, chosen: np.ndarray) -> Side:
        index = np.flatnonzero(chosen)
        # Rates here are by altitude over time: nothing of them is late.
        state = replace(self.compared.state.rows_of_fleet(torch.from_numpy(index)), report_delay_s=0.0)
        seen, windows = self.rates.seen[index], {}
        for name, effect in self.effects.items():
            windows[name] = flight_windows(effect, state, self.rates.bands, seen)
        return Side(index, self.rates.values[index], seen, windows)

    def _spread(self) -> Spread:
        rates: FlightRates = self.rates
        state = self.compared.state
        heavier = (log_rate(state, mass=1.05) - log_rate(state, mass=0.95)).mean(0).numpy()[rates.bands]
        kernel = self.known.kernel[np.ix_(rates.entries, rates.entries)]
        return spread_of(self.simulated.values, self.simulated.seen, heavier, kernel, self.assumed)


def differing(catalogue: Mapping[str, Effect]) -> list[DiffersByFlight]:
    """Effects of a catalogue that flights may have each in its own way.

    Example:
        >>> from descentflow.effects import EFFECTS
        >>> [effect.name for effect in differing(EFFECTS)]
        ['speed_brake', 'geometric_path']
    """
    return [effect for effect in catalogue.values() if isinstance(effect, DiffersByFlight)]
