"""Nuisances that a simulator lacks: noise of reports, level-offs where its flights have none, and layers of air."""

import math

import numpy as np
import torch
from torch import Tensor

from descentflow.diagnosis.evidence.assumptions import Assumptions
from descentflow.diagnosis.evidence.moments import Moments, moments
from descentflow.diagnosis.evidence.set_fit import SetFit, SetFits
from descentflow.diagnosis.findings.gap_found import Lack
from descentflow.diagnosis.inference.two_sides import Compared
from descentflow.measurements.quantity_registry import QUANTITIES

OF_LEVEL_OFFS = ("level", "level_gaps")
RAISED_BY_CAUSES = ("noise_rate", "noise_altitude", "noise_groundspeed")
"""Noise that edges of windows, paths, turns and late reports change as well."""
USUAL = 15.0
"""Prior size of a lack of level-offs, in negligible shifts."""


def set_apart(compared: Compared) -> Tensor:
    """Entries (p,) that are free in every set of effects.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_sides
        >>> bool(set_apart(example_sides()).any())  # rates and speeds alone
        False
    """
    own = compared.y[~compared.real].numpy()
    alike = np.nanstd(own, 0) == 0.0 if compared.has_reference else np.zeros(len(compared.entries), dtype=bool)
    flags = [
        QUANTITIES[entry.quantity].is_noise or (entry.quantity in OF_LEVEL_OFFS and bool(same))
        for entry, same in zip(compared.entries, alike, strict=True)
    ]
    return torch.tensor(flags, dtype=torch.bool)


def lacks(compared: Compared, assumed: Assumptions, *, raised: bool) -> list[Lack]:
    """Differences that probably exist, by the odds of a normal size against none.

    Args:
        compared: Flights of both sides, with the entries of :func:`set_apart` alone.
        assumed: Constants.
        raised: Whether an effect is named that may raise short-scale noise as well.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_sides
        >>> sides = example_sides()
        >>> lacks(sides.only(torch.nonzero(set_apart(sides))[:, 0]), Assumptions(), raised=False)
        []
    """
    if not compared.entries:
        return []
    known, found = moments(compared, assumed), []
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
        usual = (1.0 if noise else USUAL * unit) ** 2
        odds = 0.5 * (size**2 / error - size**2 / (error + usual) - math.log1p(usual / error)) + prior_odds
        if odds > needed and (not noise or abs(size) > assumed.noise_matters / 3.0):
            found.append(Lack(name, size, math.sqrt(error)))
    return found


def layers_of_air(best: SetFit, known: Moments, fits: SetFits) -> list[Lack]:
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
    found = []
    for name in best.air:
        prior = fits.unknown_covariance({name: best.unknown[name]})
        gain = prior @ np.linalg.inv(best.noise)
        departure = gain @ (known.difference - best.shift)
        at = int(np.argmax(np.abs(departure)))
        found.append(Lack(name, float(departure[at]), math.sqrt(max(prior[at, at] - (gain @ prior)[at, at], 0.0))))
    return sorted(found, key=lambda lack: lack.quantity)
