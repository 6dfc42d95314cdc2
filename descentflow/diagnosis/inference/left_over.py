r"""What the named effects leave, in physical units: mean differences over parts of the levels, and what they may be.

A large share of the log score may be next to nothing in ft/min, and half of the rate's gap a small share of it: so
this, and no score, decides whether what is named is all that matters. What is left of a part's mean may be chance, with
the standard error :math:`s` of the mean, or what the named effects are off by: their equations hold to stated shares
:math:`\varepsilon_e` of their shifts (:mod:`~descentflow.diagnosis.inference.signature_columns`). A gap is left where

.. math:: |\bar r| > \textstyle\sum_e \varepsilon_e |\bar d_e| + z\,s \quad\text{and}\quad |\bar r| > q,

with q the larger of what the rounding of one flight's reports leaves open and what equations leave out, and z such that
chance leaves one in any of the parts as rarely as a gap is called without one.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import torch
from scipy.special import ndtri
from torch import Tensor

from descentflow.diagnosis.inference.aircraft_groups import by_aircraft
from descentflow.diagnosis.inference.likelihood import EffectsLikelihood, Fit
from descentflow.diagnosis.inference.signature_columns import misfit_of
from descentflow.diagnosis.inference.two_sides import Compared
from descentflow.measurements.quantity_registry import QUANTITIES

THIRDS = 3
"""Parts of the levels in which a mean is taken, as the costs are told: a window of 5,000 ft fills most of one."""


@dataclass(frozen=True)
class Part:
    """Mean over a part of the levels of one quantity.

    Attributes:
        quantity: Which.
        level_low_fl: From...
        level_high_fl: ...to.
        before: The gap before.
        left: What is left of it.
        error: Standard error of either.
        allowed: What the named effects may be off by.
        least: What a flight's reports and the equations leave open.

    Example:
        >>> Part("rate", 150.0, 220.0, before=-0.19, left=-0.17, error=0.004, allowed=0.01, least=0.005).is_gap(z=3.0)
        True
    """

    quantity: str
    level_low_fl: float
    level_high_fl: float
    before: float
    left: float
    error: float
    allowed: float
    least: float

    def is_gap(self, z: float) -> bool:
        """Whether what is left matters, and is neither chance nor what the named effects may be off by."""
        return abs(self.left) > max(self.least, self.allowed + z * self.error)

    def was_gap(self, z: float) -> bool:
        """Whether there was a gap."""
        return abs(self.before) > max(self.least, z * self.error)


@dataclass(frozen=True)
class LeftOver:
    """By quantity and part of the levels; ``moved`` are the quantities that each named effect moves.

    Example:
        >>> warm = Part("tas", 150, 290, before=0.02, left=0.0, error=0.001, allowed=0.0, least=0.001)
        >>> slow = Part("rate", 150, 290, before=-0.2, left=-0.2, error=0.01, allowed=0.0, least=0.005)
        >>> moved = {"temperature": frozenset({"rate", "tas"}), "mass": frozenset({"rate"})}
        >>> found = LeftOver((warm, slow), 0.02, moved)
        >>> found.is_gap, found.confirmed
        (True, ('temperature',))
    """

    parts: tuple[Part, ...]
    level: float = 0.02
    moved: Mapping[str, frozenset[str]] = field(default_factory=dict)

    @property
    def is_gap(self) -> bool:
        """Whether a gap is left anywhere."""
        return bool(self.gaps)

    @property
    def gaps(self) -> tuple[Part, ...]:
        """Where one is left. Noise, counts and lost times are by-products of much, and are not asked."""
        judged = [part for part in self.parts if QUANTITIES[part.quantity].by_band]
        return tuple(part for part in judged if part.is_gap(self._z))

    @property
    def confirmed(self) -> tuple[str, ...]:
        """Effects that close a gap: in a quantity that they move there was one, and none is left."""
        left = {part.quantity for part in self.parts if part.is_gap(self._z)}
        closed = {part.quantity for part in self.parts if part.was_gap(self._z)} - left
        return tuple(name for name, quantities in self.moved.items() if quantities & closed)

    @property
    def _z(self) -> float:
        return -float(ndtri(self.level / (2 * max(len(self.parts), 1))))


def left_over(likelihood: EffectsLikelihood, fit: Fit, least: Tensor, level: float) -> LeftOver:
    """What a fit leaves.

    Args:
        likelihood: Of the flights.
        fit: Of the named effects.
        least: (p,) what the rounding of one flight's reports leaves open of each entry.
        level: Chance that a gap is left in any part where none is.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_likelihood
        >>> from descentflow.diagnosis.inference.search import fit_effects
        >>> from descentflow.effects import EFFECTS
        >>> likelihood = example_likelihood(EFFECTS["mass"], [0.2])
        >>> fits, least = [fit_effects(likelihood, names) for names in ((), ("mass",))], torch.zeros(33)
        >>> [left_over(likelihood, fit, least, 0.02).is_gap for fit in fits]
        [True, False]
    """
    compared = likelihood.compared
    least = torch.maximum(least, compared.negligible())
    means = _means(likelihood, fit)
    found = []
    for quantity in compared.quantities():
        for at in _thirds(compared, quantity):
            before, _ = _mean_difference(compared, compared.y[:, at])
            left, error = _mean_difference(compared, (compared.y - fit.shift)[:, at])
            levels = [compared.level_range(compared.entries[i]) for i in at.tolist()]
            low, high = min(low for low, _ in levels), max(high for _, high in levels)
            allowed = sum(
                misfit_of(quantity, likelihood.catalogue[name].misfit_of_rate) * float(mean[at].mean().abs())
                for name, mean in means.items()
            )
            found.append(Part(quantity, low, high, before, left, error, allowed, float(least[at].mean())))
    moved = {name: mean.abs() > compared.negligible() for name, mean in means.items()}
    quantities = {
        name: frozenset(e.quantity for e, moves in zip(compared.entries, there.tolist(), strict=True) if moves)
        for name, there in moved.items()
    }
    return LeftOver(tuple(found), level, quantities)


def least_left(likelihood: EffectsLikelihood, fits: Sequence[Fit], least: Tensor, level: float) -> LeftOver:
    """What the first fit leaves, or what one that stands in its place does where that leaves no gap.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_likelihood
        >>> from descentflow.diagnosis.inference.search import fit_effects
        >>> from descentflow.effects import EFFECTS
        >>> likelihood = example_likelihood(EFFECTS["mass"], [0.2])
        >>> fits = [fit_effects(likelihood, names) for names in ((), ("mass",))]
        >>> least_left(likelihood, fits, torch.zeros(33), 0.02).is_gap
        False
    """
    found = [left_over(likelihood, fit, least, level) for fit in fits]
    return next((one for one in found if not one.is_gap), found[0])


def _means(likelihood: EffectsLikelihood, fit: Fit) -> dict[str, Tensor]:
    """Mean shift (p,) of each effect."""
    found = {}
    for name, theta in fit.theta.items():
        own = fit.per_flight.get(name)
        shift = likelihood.all_shift(name, theta) if own is None else own.shift
        found[name] = shift[likelihood.real].mean(0)
    return found


def _mean_difference(compared: Compared, y: Tensor) -> tuple[float, float]:
    """Mean over bands (n, b) of real minus the simulator's flights, and its error, whole aircraft counted as one."""
    mean, variance = torch.zeros((), dtype=y.dtype), 0.0
    for side, sign in ((compared.real, 1.0), (~compared.real, -1.0)):
        if bool(side.any()):
            part = y[side]
            of_band, count = part.nanmean(0).nan_to_num(0.0), part.isfinite().sum(0).clamp(min=1)
            mean = mean + sign * of_band.mean()
            share = ((part - of_band) / count).nan_to_num(0.0).mean(1)
            variance += float(by_aircraft(share, compared.airframe[side]).square().sum())
    return float(mean), variance**0.5


def _thirds(compared: Compared, quantity: str) -> list[Tensor]:
    """Entries of a quantity in each third of the levels that has any; all of one that is of the whole flight."""
    at = compared.columns(quantity)
    if not QUANTITIES[quantity].by_band:
        return [at]
    bands = torch.tensor([compared.entries[i].band for i in at.tolist()])
    place = (bands * THIRDS) // len(compared.state.altitude_m)
    return [at[place == third] for third in range(THIRDS) if bool((place == third).any())]
