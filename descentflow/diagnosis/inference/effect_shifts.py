"""What effects would shift in the compared flights, and how sensitive each flight is to their parameters."""

from collections.abc import Mapping
from functools import cached_property

import torch
from torch import Tensor

from descentflow.core.recent import Recent
from descentflow.diagnosis.inference.reference_coefficients import scaled_rows
from descentflow.diagnosis.inference.signature_columns import misfit_columns
from descentflow.diagnosis.inference.two_sides import Compared
from descentflow.diagnosis.inference.whitening import Whitening
from descentflow.effects import Effect
from descentflow.effects.flight_law import DiffersByFlight
from descentflow.effects.flight_state import FlightState
from descentflow.effects.windowed_effect import WindowedEffect

CAS_RIDGE = 0.05
"""Share of the variance of CAS that is added to it before the rate is regressed on it: bands of CAS are alike."""

FLIGHTS_BESIDE = 40
"""About so many real flights say how a mean shift answers to other coefficients: speeds differ little between them."""
MISFITS = 64
"""Mean shifts, and columns by which they may be off, that are kept: some thousand numbers each."""
KEPT = 5
"""Shifts and sensitivities that are kept, for one fit starts where another ended; n p k numbers of eight bytes each."""


class EffectShifts:
    """Shifts of a catalogue's effects in the flights that are compared.

    An effect states its shift by quantity; here it becomes a vector of each flight's entries, and where the rate
    follows the CAS (:attr:`~descentflow.effects.effect.Effect.rate_follows_cas`) it is taken along.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_sides
        >>> from descentflow.effects import EFFECTS
        >>> sides = example_sides(EFFECTS["temperature"], [10.0])
        >>> from descentflow.diagnosis.inference.whitening import whiten
        >>> weights = whiten(sides.y, sides.real, sides.airframe, sides.nugget(), sides.of_flight())
        >>> shifts = EffectShifts(sides, weights, EFFECTS)
        >>> bool((shifts.shift({"temperature": torch.tensor([10.0])})[~sides.real] == 0).all())
        True
    """

    def __init__(self, compared: Compared, whitening: Whitening, catalogue: Mapping[str, Effect]) -> None:
        """Prepare.

        Args:
            compared: Flights of both sides.
            whitening: Their covariance, by which the rate follows the CAS.
            catalogue: Effects that may be named.
        """
        self.compared, self.whitening, self.catalogue = compared, whitening, catalogue
        self.y = compared.y.nan_to_num(0.0)
        self.real = compared.real
        self.has_reference = bool((~self.real).any())
        self.cas_to_rate = cas_to_rate_gain(compared, whitening)
        self._shifts, self._jacobians = Recent[Tensor](KEPT), Recent[Tensor](KEPT)
        self._misfits = Recent[tuple[Tensor, Tensor]](MISFITS)

    def share(self, like: "EffectShifts") -> None:
        """Know what another knows of the same flights, where the rate follows the CAS alike."""
        same = self.compared.state is like.compared.state and self.compared.entries == like.compared.entries
        if same and torch.equal(self.cas_to_rate, like.cas_to_rate):
            self._shifts, self._jacobians, self._misfits = like._shifts, like._jacobians, like._misfits
            self.__dict__.update({k: like.__dict__[k] for k in ("real_state", "seen_beside") if k in like.__dict__})

    def forget(self) -> None:
        """Let go of what is kept to save time, which is made again where it is asked for."""
        for kept in (self._shifts, self._jacobians, self._misfits):
            kept.known.clear()
        self.whitening.forget()

    def all_shift(self, name: str, theta: Tensor) -> Tensor:
        """Shift (n, p) that an effect makes, or would make, in every flight."""
        return self.shift_seen(name, theta, self.compared.state)

    def shift_seen(self, name: str, theta: Tensor, state: FlightState) -> Tensor:
        """The same of some flights, looked at with other coefficients."""
        effect = self.catalogue[name]
        return self._with_rate(effect, self.compared.vector(effect.shift(state, theta)))

    @cached_property
    def seen_beside(self) -> FlightState:
        """Some real flights, nine times: as they are, and with coefficients a standard deviation above and below.

        The standard deviations are those of each direction in which the coefficients are open.
        """
        directions = self.compared.coefficients.directions().T
        steps = torch.cat([torch.zeros(1, 4, dtype=torch.float64), directions, -directions])
        real = torch.nonzero(self.real)[:, 0]
        some = real[:: max(len(real) // FLIGHTS_BESIDE, 1)]
        return scaled_rows(self.compared.state.rows(some.repeat(len(steps))), steps.repeat_interleave(len(some), 0))

    def mean_shifts_beside(self, name: str, theta: Tensor) -> Tensor:
        """Mean shift (9, p) that an effect makes in :attr:`seen_beside`."""
        found = self.shift_seen(name, theta, self.seen_beside)
        return found.reshape(9, -1, found.shape[1]).mean(1)

    def misfits(self, name: str, theta: Tensor) -> tuple[Tensor, Tensor]:
        """Mean shifts of :meth:`mean_shifts_beside`, and the columns (p, c) by which the first may be off."""

        def made() -> tuple[Tensor, Tensor]:
            means = self.mean_shifts_beside(name, theta)
            return means, misfit_columns(self.compared, means[0], self.catalogue[name].misfit_of_rate)

        return self._misfits.get(by_size(name, theta), made)

    @cached_property
    def real_state(self) -> FlightState:
        """The real flights."""
        return self.compared.state.rows_of_fleet(torch.nonzero(self.real)[:, 0])

    def real_shift(self, name: str, theta: Tensor) -> Tensor:
        """Shift (r, p) that an effect makes in every real flight; do not write into it."""
        return self._shifts.get(by_size(name, theta), lambda: self.shift_seen(name, theta, self.real_state))

    def real_jacobian(self, name: str, theta: Tensor) -> Tensor:
        """Sensitivity (r, p, k) of every real flight to one effect's parameters; do not write into it."""
        return self._jacobians.get(by_size(name, theta), lambda: self._jacobian_of(self.real_state, name, theta))

    def shift(self, theta: Mapping[str, Tensor]) -> Tensor:
        """Shift (n, p) of effects together, zero for the simulator's flights."""
        total = torch.zeros_like(self.y)
        for name, value in theta.items():
            total[self.real] += self.real_shift(name, value)
        return total

    def jacobian(self, name: str, theta: Tensor) -> Tensor:
        """Sensitivity (n, p, k) of every flight to one effect's parameters."""
        return self._jacobian_of(self.compared.state, name, theta)

    def _jacobian_of(self, state: FlightState, name: str, theta: Tensor) -> Tensor:
        effect = self.catalogue[name]
        return self._with_rate(effect, self.compared.vector(effect.sensitivity(state, theta)))

    def start_of(self, name: str) -> Tensor:
        """Parameters from which fits of an effect start; those of windowed effects start where their search ends."""
        return self.catalogue[name].start()

    def windowed(self, name: str) -> WindowedEffect | None:
        """The effect, if it acts within a window that is to be searched for."""
        effect = self.catalogue[name]
        return effect if isinstance(effect, WindowedEffect) else None

    def has_law(self, name: str, theta: Tensor) -> bool:
        """Whether parameters of an effect say that flights have it each in their own way."""
        effect = self.catalogue[name]
        return isinstance(effect, DiffersByFlight) and effect.is_law(theta)

    def moved(self, theta: Mapping[str, Tensor], step: Tensor) -> dict[str, Tensor]:
        """Parameters after a step (k,) of all of them together, within their bounds."""
        parts = dict(zip(theta, torch.split(step, [len(value) for value in theta.values()]), strict=True))
        return {name: self.catalogue[name].clamp(value + parts[name]) for name, value in theta.items()}

    def _with_rate(self, effect: Effect, vector: Tensor) -> Tensor:
        if not effect.rate_follows_cas:
            return vector
        return vector + torch.einsum("ij,nj...->ni...", self.cas_to_rate, vector)


def by_size(name: str, theta: Tensor) -> tuple[str, tuple[float, ...]]:
    """What shifts and sensitivities of an effect are kept by.

    Example:
        >>> by_size("temperature", torch.tensor([10.0]))
        ('temperature', (10.0,))
    """
    return name, tuple(theta.tolist())


def cas_to_rate_gain(compared: Compared, whitening: Whitening) -> Tensor:
    """Change of the rate for each of the CAS if flights behave as those that always flew so: (p, p).

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_likelihood
        >>> from descentflow.effects import EFFECTS
        >>> likelihood = example_likelihood(EFFECTS["temperature"], [10.0])
        >>> cas_to_rate_gain(likelihood.compared, likelihood.whitening).shape
        torch.Size([33, 33])
    """
    rate, cas = compared.columns("rate"), compared.columns("cas")
    gain = torch.zeros_like(whitening.covariance)
    if len(rate) and len(cas):
        block = whitening.covariance[cas][:, cas]
        block = block + CAS_RIDGE * torch.diag(block.diagonal())
        gain[rate[:, None], cas] = torch.linalg.solve(block, whitening.covariance[cas][:, rate]).T
    return gain
