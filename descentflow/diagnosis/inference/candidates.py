"""Candidate causes: an effect with a mean shift, its prior, and the evidence of single flights as well."""

from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from descentflow.core.linear_gaussian import Array
from descentflow.diagnosis.findings.costs_found import NINETY
from descentflow.diagnosis.inference.flight_mixture import LearntLaw
from descentflow.diagnosis.inference.signatures import Signature, Signatures
from descentflow.effects import Effect


class MeanEffect:
    """An effect that shows in the means: its sizes are those of its parameters that a mean can tell."""

    log_gain = 0.0

    def __init__(self, effect: Effect, signatures: Signatures) -> None:
        """Look at an effect.

        Args:
            effect: Of the catalogue.
            signatures: In the real flights.
        """
        self.effect, self.name, self._signatures = effect, effect.name, signatures
        self.start = np.array([parameter.start for parameter in effect.parameters])
        scale = np.array([parameter.scale for parameter in effect.parameters])
        self.prior_sd = self.free_sd = signatures.assumed.prior_scales * scale

    def theta(self, sizes: Array) -> Tensor:
        """All parameters of the effect."""
        return torch.from_numpy(np.asarray(sizes, dtype=float))

    def theta_errors(self, errors: Array) -> Tensor:
        """Standard errors of all parameters, zero where nothing that is compared answers to one."""
        answers = np.abs(self.at(self.start).jacobian).max(0) > 0.0
        return torch.from_numpy(np.where(answers, errors, 0.0))

    def at(self, sizes: Array) -> Signature:
        """Signature at sizes (k,)."""
        return self._signatures.of(self.effect, self.theta(sizes))

    def clamp(self, sizes: Array) -> Array:
        """Sizes within the effect's bounds."""
        found: Array = self.effect.clamp(self.theta(sizes)).numpy()
        return found

    def plausible(self, sizes: Array) -> bool:
        """True if the effect finds them so."""
        return self.effect.plausible(self._signatures.state, self.theta(sizes))

    def differs(self, sizes: Array, errors: Array) -> bool:
        """True if the 90 % interval of some size leaves out no change at all."""
        return bool((np.abs(sizes - self.start) > NINETY * errors).any())


@dataclass(frozen=True)
class FlightsEffect:
    """An effect that some flights have, each in its own way: the shapes of these say its mean shift, up to factors.

    Attributes:
        name: Of the effect.
        law: Law by which flights have it.
        parts: (p, c) of the mean shift: what goes with the sizes of flights, and what does not.
        log_gain: Nats that the shapes gain by it.
        misfit: (p, p) what its equation misses at factors of one.
        prior_sd: (c,) of the factors about one.

    Example:
        >>> brakes = FlightsEffect("speed_brake", torch.zeros(8), np.ones((2, 1)), 30.0, np.eye(2), np.array([0.2]))
        >>> brakes.at(np.array([2.0])).shift
        array([2., 2.])
    """

    name: str
    law: LearntLaw
    parts: Array
    log_gain: float
    misfit: Array
    prior_sd: Array

    @property
    def free_sd(self) -> Array:
        """Of the factors where the sizes of flights are to make the means: it is the sizes that are free."""
        sd: Array = np.eye(self.parts.shape[1])[0]
        return sd

    @property
    def start(self) -> Array:
        """One: the means show what the shapes say."""
        return np.ones(self.parts.shape[1])

    def at(self, sizes: Array) -> Signature:
        """Signature at factors (c,)."""
        return Signature(self.parts @ sizes, self.parts, float(sizes.mean()) ** 2 * self.misfit, 0.0 * self.misfit)

    def clamp(self, sizes: Array) -> Array:
        """No factor below zero."""
        return np.maximum(sizes, 0.0)

    def plausible(self, sizes: Array) -> bool:
        """Asked of the law already."""
        return True

    def differs(self, sizes: Array, errors: Array) -> bool:
        """That some flights have it is shown by their shapes."""
        return True

    def theta(self, sizes: Array) -> Tensor:
        """The law, with the sizes of flights as the means show them."""
        return self.law.at(float(sizes[0]))

    def theta_errors(self, errors: Array) -> Tensor:
        """Standard errors of the law's parameters, the mean size's by that of its factor."""
        return self.law.errors(float(errors[0]))


Candidate = MeanEffect | FlightsEffect
"""An effect that may be in a set: sizes with a normal prior about ``start``, and a signature at each of them."""
