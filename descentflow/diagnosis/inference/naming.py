"""Named effects with what else may stand in their place, and nuisances that a simulator lacks.

Nuisances are noise of reports, level-offs where the simulator's flights have none, and layers of air: free in every
set, and no cause.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from descentflow.core.linear_gaussian import Array
from descentflow.diagnosis.findings.gap_found import Nuisance
from descentflow.diagnosis.inference.moments import Moments, moments
from descentflow.diagnosis.inference.sets import Names, SetFit, SetFits
from descentflow.diagnosis.sides.assumptions import Assumptions
from descentflow.diagnosis.sides.two_sides import Compared
from descentflow.diagnosis.sides.vectors import Vectors
from descentflow.measurements.quantity_registry import QUANTITIES


@dataclass(frozen=True)
class Named:
    """Result of the weights of sets.

    Attributes:
        weights: (sets,) that sum to one.
        probability: By effect: that it is among the causes.
        unknown: Probability of an unknown cause.
        none: Probability that there is nothing.
        groups: By named effect, likeliest first: others that may stand in its place.

    Example:
        >>> Named(np.ones(1), {"mass": 1.0}, 0.0, 0.0, {"mass": ()}).groups
        {'mass': ()}
    """

    weights: Array
    probability: Mapping[str, float]
    unknown: float
    none: float
    groups: Mapping[str, Names]

    @property
    def has_unknown(self) -> bool:
        """True if an unknown cause is more probable than not."""
        return self.unknown > 0.5


def name_effects(sets: Sequence[SetFit], assumed: Assumptions, alike: Sequence[Sequence[str]] = ()) -> Named:
    """Name the effects that are in nearly all of the weight, alone or with the fewest that may stand in their place.

    Args:
        sets: Fitted, with plausible sizes.
        assumed: Constants.
        alike: Groups of effects that no flight can tell apart.

    Example:
        >>> weights = {"mass": 0.0, "drag": -1.0}
        >>> fits = [SetFit((name,), {}, {}, {}, weight, {}, np.eye(1)) for name, weight in weights.items()]
        >>> name_effects(fits, Assumptions()).groups
        {'mass': ('drag',)}
    """
    weights = np.exp(np.array([fit.log_weight for fit in sets]) - max(fit.log_weight for fit in sets))
    weights = weights / weights.sum()

    def held(*names: str) -> float:
        """Weight of the sets that have one of these."""
        return float(sum(w for w, one in zip(weights, sets, strict=True) if set(names) & set(one.names)))

    every = dict.fromkeys(name for fit in sets for name in fit.names)
    probability = {name: held(name) for name in sorted(every, key=lambda name: -held(name))}
    groups: dict[str, Names] = {}
    for name, alone in probability.items():
        if alone < assumed.least_shown or any(name in group for group in groups.values()):
            continue
        group = [name]
        others = [other for other in probability if other not in groups and other != name]
        for other in others:
            if held(*group) >= assumed.named:
                break
            together = sum(w for w, one in zip(weights, sets, strict=True) if name in one.names and other in one.names)
            if together < 1.0 - assumed.named and held(*group, other) > held(*group) + assumed.least_shown:
                group.append(other)
        if held(*group) < assumed.named or alone < 1.0 / (len(group) + 1):
            continue
        same = [other for members in alike if name in members for other in members]
        group += [o for o in others if o in same and o not in group and probability[o] * assumed.alike > alone]
        groups[name] = tuple(group[1:])
    unknown = float(sum(w for w, one in zip(weights, sets, strict=True) if one.has_unknown))
    none = float(sum(w for w, one in zip(weights, sets, strict=True) if one.is_null))
    return Named(weights, probability, unknown, none, groups)


def outweighs_causes(named: Named, heaviest: SetFit, known: Moments, fits: SetFits) -> bool:
    """Test for an unknown cause that is probable and explains more of the difference than the named effects.

    Args:
        named: By the weights.
        heaviest: The heaviest set with all that is named.
        known: Moments of both sides.
        fits: Of the catalogue.

    Example:
        >>> known = Moments(np.zeros(1), np.eye(1), np.zeros((1, 1)), np.ones(1), np.array(["rate"]), np.eye(1))
        >>> nothing = SetFit((), {}, {}, {}, 0.0, {}, np.eye(1))
        >>> fits = SetFits(known, [], Assumptions())
        >>> outweighs_causes(Named(np.ones(1), {}, 0.0, 1.0, {}), nothing, known, fits)
        False
    """
    if not named.has_unknown:
        return False
    shift = sum((heaviest.shifts[name] for name in named.groups), np.zeros(len(known.difference)))
    rest = known.difference - heaviest.shift
    of_cause = {name: scale for name, scale in heaviest.unknown.items() if name not in heaviest.air}
    left = fits.unknown_covariance(of_cause) @ np.linalg.solve(heaviest.noise, rest)
    explained, unexplained = (float(x @ np.linalg.solve(known.covariance, x)) for x in (shift, left))
    return unexplained > explained


OF_LEVEL_OFFS = ("level", "level_gaps")
RAISED_BY_CAUSES = ("noise_rate", "noise_altitude", "noise_groundspeed")
"""Noise that edges of windows, paths, turns and late reports change as well."""


def free_in_every_set(compared: Vectors) -> Tensor:
    """Entries (p,) that are free in every set of effects."""
    own = compared.y[~compared.real].numpy()
    alike = np.nanstd(own, 0) == 0.0 if compared.has_simulated else np.zeros(len(compared.entries), dtype=bool)
    flags = [
        QUANTITIES[entry.quantity].is_noise or (entry.quantity in OF_LEVEL_OFFS and bool(same))
        for entry, same in zip(compared.entries, alike, strict=True)
    ]
    return torch.tensor(flags, dtype=torch.bool)


def nuisances(compared: Compared, *, raised: bool) -> list[Nuisance]:
    """Nuisances that probably exist, by the odds of a normal size against none.

    Args:
        compared: Flights of both sides, with the entries of :func:`free_in_every_set` alone.
        raised: Whether an effect is named that may raise short-scale noise as well.
    """
    if not compared.entries:
        return []
    assumed, known, likely = compared.assumed, moments(compared), []
    prior_odds = math.log(assumed.inclusion / (1.0 - assumed.inclusion))
    needed = math.log(assumed.named / (1.0 - assumed.named))
    for name, size, variance, unit in zip(
        map(str, known.quantity),
        known.difference.tolist(),
        known.covariance.diagonal().tolist(),
        known.negligible.tolist(),
        strict=True,
    ):
        noise = QUANTITIES[name].is_noise
        by_product = assumed.noise_matters if raised and name in RAISED_BY_CAUSES else 0.0
        error = variance + by_product**2
        # Noise that is missing altogether is less by a factor of three or five: about one, as a logarithm.
        usual = (1.0 if noise else assumed.usual_level_offs * unit) ** 2
        odds = 0.5 * (size**2 / error - size**2 / (error + usual) - math.log1p(usual / error)) + prior_odds
        if odds > needed and (not noise or abs(size) > assumed.noise_matters / 3.0):
            likely.append(Nuisance(name, size, math.sqrt(error)))
    return likely


def layers_of_air(best: SetFit, known: Moments, fits: SetFits) -> list[Nuisance]:
    """The largest departure of each quantity of the air that no effect of a set explains.

    Args:
        best: The set, with the scales of the air.
        known: Moments of both sides.
        fits: Of the catalogue.

    Example:
        >>> known = Moments(np.ones(1), np.eye(1), np.zeros((1, 1)), np.ones(1), np.array(["height"]), np.eye(1))
        >>> fits = SetFits(known, [], Assumptions())
        >>> layers_of_air(fits.fit((), {"height": 6.0}), known, fits)[0].size > 0.9
        True
    """
    layers = []
    for name in best.air:
        prior = fits.unknown_covariance({name: best.unknown[name]})
        gain = prior @ np.linalg.inv(best.noise)
        departure = gain @ (known.difference - best.shift)
        at = int(np.argmax(np.abs(departure)))
        layers.append(Nuisance(name, float(departure[at]), math.sqrt(max(prior[at, at] - (gain @ prior)[at, at], 0.0))))
    return sorted(layers, key=lambda lack: lack.quantity)
