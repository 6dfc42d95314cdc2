r"""What each flight's own air adds to what it shows, beyond the mean air of the real flights.

The spread between flights is learnt from the simulator's, for an effect that takes some flights and leaves others would
hide itself in that of real ones. But real flights meet the air of many days where a simulator may know one. Taken for
alike in all flights, each flight's deviation from the mean would be left to effects that flights have each in their own
way: brakes in every flight, where half of them have them. True airspeed, groundspeed and height say each flight's own
air :math:`a_i` by generalised least squares, with errors :math:`V_i`; where it differs more between real flights than
between the simulator's, by the variance :math:`S`, the search for causes looks at

.. math:: y_i - J_i (S^{-1} + V_i^{-1})^{-1} V_i^{-1} (a_i - \bar a),

which is the flight in the mean air, with the flight's own sensitivities :math:`J_i`.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import torch
from scipy.special import fdtri
from torch import Tensor

from descentflow.diagnosis.inference.effect_shifts import EffectShifts
from descentflow.diagnosis.inference.two_sides import Compared
from descentflow.diagnosis.inference.whitening import Whitening
from descentflow.effects.effect import Effect

FALSELY_WIDER = 0.001
"""Chance that the air is said to differ more between real flights where it does not; little follows if it is."""
ALSO_OTHERWISE = ("rate", "cas", "lag")
"""Quantities that say little of the air by themselves: crews, mass and drag move them."""
MOST_ERROR = 4.0
"""Error variance, in medians, of the flights by which the spread is judged: what short ones say is mostly error."""


def in_mean_air(compared: Compared, weights: Whitening, catalogue: Mapping[str, Effect]) -> Compared:
    """The flights without what their own air adds; as they are, where it differs no more than the simulator's.

    Args:
        compared: Flights of both sides.
        weights: Precision that was learnt from the simulator's flights.
        catalogue: Effects; those that every flight measures by itself are asked.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_sides
        >>> from descentflow.diagnosis.inference.whitening import whiten
        >>> from descentflow.effects import EFFECTS
        >>> sides = example_sides(EFFECTS["temperature"], [10.0])  # all real flights in the same air
        >>> weights = whiten(sides.y, sides.real, sides.airframe, sides.nugget(), sides.of_flight())
        >>> in_mean_air(sides, weights, EFFECTS) is sides
        True
    """
    names = [n for n, effect in catalogue.items() if effect.heterogeneity == "measured covariate"]
    shifts = EffectShifts(compared, weights, {name: catalogue[name] for name in names})
    at = _entries(compared, shifts, names)
    if not len(at):
        return compared
    own, error = _air_of_flights(
        compared, weights, _sensitivities(shifts, {n: catalogue[n].start() for n in names}), at
    )
    # Sensitivities change a little with the air itself: once more, where it was found.
    mean = own[compared.real].nanmean(0).nan_to_num(0.0)
    sensitivity = _sensitivities(shifts, _about(catalogue, names, mean))
    own, error = _air_of_flights(compared, weights, sensitivity, at)
    spread = torch.tensor([_excess_variance(own[:, k], error[:, k], compared) for k in range(own.shape[1])])
    if not bool((spread > 0).any()):
        return compared
    deviation = (own - own[compared.real].nanmean(0)) * spread / (spread + error)
    added = torch.einsum("npk,nk->np", sensitivity, deviation.nan_to_num(0.0))
    return replace(compared, y=torch.where(compared.real[:, None], compared.y - added, compared.y))


def _about(catalogue: Mapping[str, Effect], names: Sequence[str], mean: Tensor) -> dict[str, Tensor]:
    """Parameters of the effects from all of them one after the other (k,)."""
    sizes = [len(catalogue[name].parameters) for name in names]
    return {n: catalogue[n].clamp(part) for n, part in zip(names, torch.split(mean, sizes), strict=True)}


def _sensitivities(shifts: EffectShifts, theta: Mapping[str, Tensor]) -> Tensor:
    """Sensitivities (n, p, k) of all flights."""
    return torch.cat([shifts.jacobian(name, value) for name, value in theta.items()], 2)


def _entries(compared: Compared, shifts: EffectShifts, names: Sequence[str]) -> Tensor:
    """Entries (e,) that say the air, and are moved by little else."""
    if not names:
        return torch.zeros(0, dtype=torch.long)
    start = _sensitivities(shifts, {name: shifts.start_of(name) for name in names})
    otherwise = torch.stack([compared.of(quantity) for quantity in ALSO_OTHERWISE]).any(0)
    return torch.nonzero((start.abs() > 0).any(2).any(0) & ~otherwise)[:, 0]


def _air_of_flights(compared: Compared, weights: Whitening, sensitivity: Tensor, at: Tensor) -> tuple[Tensor, Tensor]:
    """What each flight says of its air (n, k), and the variance of the error; NaN where it says nothing."""
    seen = compared.y.isfinite()
    precision = replace(weights, covariance=weights.between).only(at, seen)
    y = compared.y[:, at]
    rest = torch.where(seen[:, at], y - y[~compared.real].nanmean(0), 0.0)
    own = torch.where(seen[:, at, None], sensitivity[:, at], 0.0)
    weighted = precision.apply(own)
    information = torch.einsum("npk,npl->nkl", own, weighted)
    size = information.diagonal(dim1=1, dim2=2)
    known = size > 1e-9 * size.amax(0)
    alone = torch.diag_embed(torch.where(known, 0.0, 1.0 + size.amax(0)))
    inverse = torch.linalg.inv(information + alone)
    found = (inverse @ torch.einsum("npk,np->nk", weighted, rest)[:, :, None])[:, :, 0]
    return torch.where(known, found, torch.nan), torch.where(known, inverse.diagonal(dim1=1, dim2=2), torch.nan)


def _excess_variance(own: Tensor, error: Tensor, compared: Compared) -> float:
    """Variance between real flights beyond that of the simulator's; zero unless it stands out (F test)."""
    seen = own.isfinite()
    if not bool(seen.any()):
        return 0.0
    seen &= error < MOST_ERROR * error[seen].median()
    sides = [seen & side for side in (compared.real, ~compared.real)]
    freedom = [len(torch.unique(compared.airframe[side])) - 1 for side in sides]
    if min(freedom) < 1:
        return 0.0
    real, simulated = (float(own[side].var()) for side in sides)
    return real - simulated if real > simulated * float(fdtri(*freedom, 1 - FALSELY_WIDER)) else 0.0
