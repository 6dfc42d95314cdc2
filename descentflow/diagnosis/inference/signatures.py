r"""Mean shift that an effect makes, its sensitivity, and by how much its equations may be off.

.. math:: D_e(\theta) = \sum_f w_f \odot s_e(\mathrm{state}_f, \theta), \qquad J_e = \partial D_e / \partial\theta,
   \qquad F_e = (\varepsilon \odot D_e)(\varepsilon \odot D_e)^\top \circ K + C_e C_e^\top,

with the weights of the means of real flights, K smooth in altitude, :math:`\varepsilon` the share of its own shift by
which an equation may be off, and :math:`C_e` the change of :math:`D_e` by one standard deviation of each independent
part of what is not known of the simulator's coefficients, and of how its rate follows CAS.
"""

from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from descentflow.core.linear_gaussian import Array
from descentflow.diagnosis.inference.moments import FLIGHTS_OF_COEFFICIENTS, Moments
from descentflow.diagnosis.sides.simulator_coefficients import scaled
from descentflow.diagnosis.sides.two_sides import Compared
from descentflow.effects import Effect
from descentflow.effects.flight_state import FlightState

DERIVATIVE_STEP = 0.02
"""Step of differences, in sizes of a parameter that matter: shifts are smooth, and windows have edges."""
LEAST_DIRECTION = 1e-3
"""A part of the coefficients that is known to a thousandth."""
NEAR = 0.25
"""Distance, in sizes of a parameter that matter, within which a signature is taken for linear."""
MOST_MISFIT_SCALED = 25.0
"""Factor of a misfit up to which it is scaled with the square of a shift: of an effect that alone has nearly none."""


@dataclass(frozen=True)
class Signature:
    """Shift (p,), its Jacobian (p, k), and covariances (p, p) of what its equations miss and coefficients leave open.

    Example:
        >>> Signature(np.ones(2), np.ones((2, 1)), np.eye(2), np.zeros((2, 2))).shift
        array([1., 1.])
    """

    shift: Array
    jacobian: Array
    misfit: Array
    unsure: Array


def linearised(about: Signature, change: Array) -> Signature:
    """Signature of sizes that are changed by (k,): a linear shift, and a misfit that goes with its square.

    Example:
        >>> about = Signature(np.ones(2), np.ones((2, 1)), np.eye(2), np.zeros((2, 2)))
        >>> linearised(about, np.array([-0.5])).misfit[0, 0]
        np.float64(0.25)
    """
    shift = about.shift + about.jacobian @ change
    whole = max(float(about.shift @ about.shift), 1e-30)
    larger = min(float(shift @ shift) / whole, MOST_MISFIT_SCALED)
    return Signature(shift, about.jacobian, about.misfit * larger, about.unsure * larger)


@dataclass(frozen=True)
class RateByCas:
    """Response of the rate to a shift of CAS between flights beyond the polar, by band.

    Attributes:
        gain: (p, p) of the rate's entries by those of CAS.
        rate: Entries of the rate...
        cas: ...and of CAS in the same bands.
        unsure: (bands, q) one standard deviation of each independent part of the gains.

    Example:
        >>> RateByCas(np.zeros((2, 2)), np.array([0]), np.array([1]), np.zeros((1, 1))).gain.shape
        (2, 2)
    """

    gain: Array
    rate: np.ndarray
    cas: np.ndarray
    unsure: Array


class Signatures:
    """Signatures of effects in the real flights of a comparison, each computed once."""

    def __init__(self, compared: Compared, known: Moments) -> None:
        """Take the real flights.

        Args:
            compared: Flights of both sides.
            known: Their moments.
        """
        self.compared, self.known, self.assumed = compared, known, compared.assumed
        real = torch.nonzero(compared.real)[:, 0]
        self.state = compared.state.rows_of_fleet(real)
        seen = compared.y[compared.real].isfinite().numpy()
        self._weight = seen / np.maximum(seen.sum(0), 1)
        some = compared.state.rows_of_fleet(real[:: max(len(real) // FLIGHTS_OF_COEFFICIENTS, 1)])
        directions = [d for d in compared.coefficients.directions().T if float(d.abs().max()) > LEAST_DIRECTION]
        self._beside = [(scaled(some, d), scaled(some, -d)) for d in directions]
        self._rate_by_cas = rate_by_cas(compared, known)
        self._made: dict[str, list[tuple[Tensor, Signature]]] = {}

    def of(self, effect: Effect, theta: Tensor) -> Signature:
        """Signature of an effect at parameters (k,): by a nearby one where there is one."""
        theta, made = theta.double(), self._made.setdefault(effect.name, [])
        scale = torch.tensor([parameter.scale for parameter in effect.parameters], dtype=torch.float64)
        apart = [float(((theta - at) / scale).abs().max()) for at, _ in made]
        if not apart or min(apart) > NEAR:
            made.append((theta, self._signature(effect, theta)))
            return made[-1][1]
        at, about = made[apart.index(min(apart))]
        return linearised(about, (theta - at).numpy())

    def _signature(self, effect: Effect, theta: Tensor) -> Signature:
        shift: Array = (self._vectors(effect, theta, self.state) * self._weight).sum(0)
        columns = []
        for i, parameter in enumerate(effect.parameters):
            step = torch.zeros_like(theta)
            step[i] = DERIVATIVE_STEP * parameter.scale
            above, below = effect.clamp(theta + step), effect.clamp(theta - step)
            width = float(above[i] - below[i])
            apart = (self._vectors(effect, above, self.state) * self._weight).sum(0)
            apart = apart - (self._vectors(effect, below, self.state) * self._weight).sum(0)
            columns.append(apart / width if width > 0.0 else 0.0 * apart)
        misfit = self.smooth_misfit(shift, effect.misfit_of_rate)
        return Signature(shift, np.stack(columns, 1), misfit, self._unsure(effect, theta, shift))

    def smooth_misfit(self, shift: Array, of_rate: float) -> Array:
        """Covariance (p, p) of an equation that is off by a share of its own shift, smoothly in altitude."""
        share = np.where(self.known.quantity == "rate", of_rate, self.assumed.kinematic_misfit) * shift
        return np.outer(share, share) * self.known.kernel

    def _unsure(self, effect: Effect, theta: Tensor, shift: Array) -> Array:
        columns, follows = [], self._rate_by_cas
        for up, down in self._beside:
            columns.append(
                (self._vectors(effect, theta, up).mean(0) - self._vectors(effect, theta, down).mean(0)) / 2.0
            )
        if effect.rate_follows_cas:
            size = np.zeros((len(shift), follows.unsure.shape[1]))
            size[follows.rate] = shift[follows.cas][:, None] * follows.unsure
            columns += list(size.T)
        off = np.stack(columns, 1) if columns else np.zeros((len(shift), 0))
        covariance: Array = off @ off.T
        return covariance

    def _vectors(self, effect: Effect, theta: Tensor, state: FlightState) -> Array:
        shift = effect.shift(state, theta)
        if self.compared.measures_air and effect.of_air:
            # The rate that the air makes is off each flight already: its size is that of the air itself.
            shift = {quantity: part for quantity, part in shift.items() if quantity != "rate"}
        vectors: Array = self.compared.vector(shift).numpy()
        return vectors + vectors @ self._rate_by_cas.gain.T if effect.rate_follows_cas else vectors


def rate_by_cas(compared: Compared, known: Moments) -> RateByCas:
    r"""Regression of the rate on CAS between flights of one side, band by band, smoothed over the bands.

    Each band's least-squares gain :math:`g_k` has the variance :math:`v_k`; the gains are one Gaussian process of
    variance :math:`a = \overline{g^2 - v}` (moments) over altitude, so their posterior is
    :math:`G g` with :math:`G = A(A + \mathrm{diag}(v))^{-1}`, covariance :math:`A - GA`.
    """
    place = {(entry.quantity, entry.band): i for i, entry in enumerate(compared.entries)}
    pairs = [(i, place["cas", band]) for (name, band), i in place.items() if name == "rate" and ("cas", band) in place]
    p = len(compared.entries)
    rate, cas = (np.array([pair[k] for pair in pairs], dtype=int) for k in (0, 1))
    gain = np.zeros((p, p))
    if not pairs:
        return RateByCas(gain, rate, cas, np.zeros((0, 0)))
    x, y = known.departures[:, cas], known.departures[:, rate]
    both = np.isfinite(x) & np.isfinite(y)
    x, y = np.where(both, x, 0.0), np.where(both, y, 0.0)
    square = (x * x).sum(0) + 1e-9
    own = (x * y).sum(0) / square
    variance = ((y - own * x) ** 2).sum(0) / np.maximum(both.sum(0) - 1, 1) / square
    prior = max(float((own**2 - variance).mean()), 1e-9) * known.kernel[np.ix_(rate, rate)]
    drawn = prior @ np.linalg.inv(prior + np.diag(variance))
    gain[rate, cas] = drawn @ own
    values, vectors = np.linalg.eigh(prior - drawn @ prior)
    return RateByCas(gain, rate, cas, vectors * np.sqrt(np.maximum(values, 0.0)))
