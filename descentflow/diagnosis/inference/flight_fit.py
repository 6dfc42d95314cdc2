r"""Fits of effects that flights have each in their own way, beside effects that all have alike.

Two precisions are at work. Which flights have an effect, and of which size, is a fact of each flight by itself: the
law is learnt with the spread between single flights, from real flights alone, about a mean of their own that may be off
the simulator's by as much as a free discrepancy (so that a second cause does not pass for flights that differ). What
flights have in common is weighed as everywhere else, with what is negligible for means added: effects that all have
alike are fitted to the flights without what is expected of the others, and flights that hold a path say nothing of the
rate. The log score of a held-out flight is that of the mixture,

.. math:: \ln N(r_i; 0, Q_i^{-1}) + \ln\Bigl[1 - \pi + \pi \sum_w p_w L_{iw}\Bigr],

under the same precision :math:`Q_i` as that of any other fit, so that fits of all kinds can be set beside each other.
"""

import torch
from torch import Tensor

from descentflow.diagnosis.inference.discrepancy import SPREAD
from descentflow.diagnosis.inference.flight_laws import Law, Taken, log_ratio, taken
from descentflow.diagnosis.inference.flight_ways import WaysOfFlights
from descentflow.diagnosis.inference.likelihood import EffectsLikelihood, FlightShares
from descentflow.diagnosis.inference.whitening import Whitening
from descentflow.effects.flight_law import DiffersByFlight
from descentflow.effects.flight_state import FlightState

Laws = dict[str, Tensor]
"""Parameters of the effects that differ by flight, by name."""
MAX_SECANTS = 4
"""Times at most that ways are worked out anew at what was learnt..."""
MAX_STEPS = 15
"""...and steps of expectation and maximisation for each of them, at most..."""
FINE_STEPS = 3
"""...of which so many at most, the last, are of all ways where an effect has a coarser set of them."""
MIN_EM_GAIN = 0.2
"""Nats by which a step must raise the likelihood for another to follow: far less than decides between two sets..."""
GAIN_OF_FLIGHT = 5e-4
"""...or so many of each flight, where they are more than 400: of as many more flights a step gains as much more."""
MANY = 800
"""Flights from which on laws are learnt of every k-th at first, of half as many at least: then few steps are left."""
SETTLED = 0.02
"""Relative change of a size below which ways need not be worked out anew."""
MIN_TAKEN = 0.5
"""Probability from which a flight is taken to hold a path: then its rate says nothing of thrust and drag."""


class FlightFit:
    """Laws fitted to the real flights of a likelihood, and what they say of each.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_likelihood
        >>> from descentflow.effects import EFFECTS
        >>> likelihood = example_likelihood(EFFECTS["speed_brake"], [0.4, 200, 240, 1, 0, 0, 0, 0])
        >>> law = torch.tensor([0.2, 200.0, 240.0, 0.5, 0.0, 0.0, 0.0, 0.1]).double()
        >>> flights = FlightFit(likelihood, {"speed_brake": law})
        >>> flights.learn(torch.zeros_like(likelihood.y[likelihood.real]))
        >>> round(float(flights.laws["speed_brake"][3]), 1)  # all real flights of the example have brakes out
        1.0
    """

    def __init__(self, likelihood: EffectsLikelihood, laws: Laws, every: int = 1) -> None:
        """Prepare.

        Args:
            likelihood: Of all flights.
            laws: Where to start.
            every: Of the real flights each so many are taken.
        """
        self.likelihood, self.laws = likelihood, dict(laws)
        self.effects = {n: e for n in laws if isinstance(e := likelihood.catalogue[n], DiffersByFlight)}
        self.at = torch.nonzero(likelihood.real)[::every, 0]
        self.state: FlightState = likelihood.compared.state.rows(self.at)
        self.seen = likelihood.compared.y[self.at].isfinite()
        self.single = likelihood.single
        if every > 1:
            self.single = self.single.rows(torch.arange(int(likelihood.real.sum()))[::every])
        self.total = self.single.total(torch.ones(len(self.at)))
        self.total += torch.diag((SPREAD * likelihood.compared.negligible()) ** -2)
        self.factor = torch.linalg.cholesky(self.total)
        self.off = torch.zeros(likelihood.y.shape[1], dtype=likelihood.y.dtype)
        self.taken: Taken
        self.shifts: dict[str, Tensor] = {}

    def learn(self, expected: Tensor) -> None:
        """Learn the laws, given what is expected (m, p) of the real flights without the effects."""
        every = 2 * len(self.at) // MANY
        if len(self.at) >= MANY and not bool(self.off.any()):
            some = FlightFit(self.likelihood, self.laws, every)
            some.learn(expected[::every])
            self.laws, self.off = some.laws, some.off
        fine = self.effects
        self.effects = {name: effect.coarser(self.laws[name]) for name, effect in fine.items()}
        for _ in range(MAX_SECANTS):
            before = self.laws
            self._settle(expected, MAX_STEPS)
            if all(self._is_settled(name, before[name], theta) for name, theta in self.laws.items()):
                break
        if any(self.effects[name] is not effect for name, effect in fine.items()):
            self.effects = fine
            self._settle(expected, FINE_STEPS)

    def _settle(self, expected: Tensor, most: int) -> None:
        """Steps of expectation and maximisation until they gain nothing, ``most`` of them at most."""
        ways = self.ways(self.laws, expected + self.off, self.state, self.single)
        left = self.likelihood.compared.y[self.at].nan_to_num(0.0) - expected
        left = torch.where(self.seen, left, 0.0)
        whole, reached = self.single.summed(left), -torch.inf
        least = max(MIN_EM_GAIN, GAIN_OF_FLIGHT * len(self.at))
        shown = {name: w.weighted(left) for name, w in ways.items()}
        for _ in range(most):
            explained = {n: w.explained_of(shown[n] - w.weighted_alike(self.off)) for n, w in ways.items()}
            self.taken = taken(explained, self._laws(self.laws))
            # The likelihood of flights and of their own mean together, up to a constant.
            value = float(self.taken.log_ratio.sum() + self.off @ whole - 0.5 * self.off @ self.total @ self.off)
            slots = {n: w.at_slots(self.taken.ways[n]) for n, w in ways.items()}
            self.laws = self.learnt()
            without = whole - torch.stack([w.summed(slots[n]) for n, w in ways.items()]).sum(0)
            self.off = torch.cholesky_solve(without[:, None], self.factor)[:, 0]
            if value < reached + least:
                break
            reached = value
        self.shifts = {name: w.placed(slots[name]) for name, w in ways.items()}

    def _is_settled(self, name: str, before: Tensor, now: Tensor) -> bool:
        size, other = self.effects[name].size(before)[1], self.effects[name].size(now)[1]
        return abs(other - size) <= SETTLED * abs(size)

    def learnt(self, chosen: Tensor | None = None) -> Laws:
        """Laws that the flights (m,) chosen say, by what is expected of each."""
        said = {name: ways.learnt(chosen) for name, ways in self.taken.ways.items()}
        return {name: self.effects[name].learn(self.state, t, said[name]) for name, t in self.laws.items()}

    def ways(self, laws: Laws, expected: Tensor, state: FlightState, precision: Whitening) -> dict[str, WaysOfFlights]:
        """Ways of every effect in some flights, of which (k, p) is expected without."""
        c = self.likelihood.compared
        beyond = torch.zeros(len(expected), len(c.state.altitude_m), dtype=expected.dtype)
        rates = c.columns("rate")
        beyond[:, [c.entries[i].band for i in rates.tolist()]] = expected[:, rates]
        found = {name: self.effects[name].ways(state, theta, beyond) for name, theta in laws.items()}
        return {name: WaysOfFlights(ways, c.entries, precision) for name, ways in found.items()}

    def log_ratio(self, laws: Laws, rest: Tensor, expected: Tensor, at: Tensor) -> Tensor:
        """Logarithm (k,) of the mixture's density over that without the effects, of what is left (k, p) of flights.

        Args:
            laws: Of the effects.
            rest: What is left of the flights without the effects.
            expected: (k, p) what is expected of them without.
            at: (k,) which flights of either side these are.
        """
        state, precision = self.likelihood.compared.state.rows(at), self.likelihood.whitening.rows(at)
        ways = self.ways(laws, expected, state, precision)
        return log_ratio({n: w.explained(rest) for n, w in ways.items()}, self._laws(laws))

    def holds_rate(self) -> Tensor:
        """Which real flights (m,) hold a path or a rate."""
        held = torch.zeros(len(self.at), dtype=torch.bool)
        for name in self.laws:
            if self.effects[name].holds_rate:
                held |= self.taken.ways[name].share > MIN_TAKEN
        return held

    def shares(self) -> dict[str, FlightShares]:
        """What each flight has of every effect; zero for the simulator's flights."""
        found = {}
        for name, theta in self.laws.items():
            ways = self.taken.ways[name]
            share, probability, size = ways.share, ways.placed(ways.probability), ways.placed(ways.size)
            numbers = self.effects[name].own_numbers(self.state, theta, probability / share[:, None].clamp(1e-12), size)
            found[name] = FlightShares(
                self._of_all(share),
                {key: self._of_all(value) for key, value in numbers.items()},
                self._of_all(self.shifts[name]),
            )
        return found

    def _of_all(self, values: Tensor) -> Tensor:
        whole = torch.zeros(len(self.likelihood.y), *values.shape[1:], dtype=values.dtype)
        whole[self.at] = values
        return whole

    def _laws(self, laws: Laws) -> dict[str, Law]:
        state = self.likelihood.compared.state
        return {
            name: Law(self.effects[name].log_prior(state, theta), *self.effects[name].size(theta))
            for name, theta in laws.items()
        }

    def shift(self) -> Tensor:
        """Shift (n, p) that is expected of the effects in each flight."""
        return self._of_all(torch.stack(list(self.shifts.values())).sum(0))
