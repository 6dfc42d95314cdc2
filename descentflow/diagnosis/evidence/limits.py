r"""The smallest size of an effect that would be named.

Of one size with the prior :math:`N(0, \tau^2)`, known by the flights to :math:`\sigma`, the evidence gains

.. math:: \ln B(\theta) = \frac{\theta^2}{2\sigma^2}\frac{\tau^2}{\tau^2 + \sigma^2}
   - \frac12 \ln\Big(1 + \frac{\tau^2}{\sigma^2}\Big)

on average. An effect alone is named from :math:`\ln B = \ln\frac{0.95}{0.05} + \ln\frac{1 - \pi}{\pi}`. A standard
normal quantile of 0.84 times :math:`\sigma` more makes that so in 80 of 100 cases.
"""

import math

import numpy as np

from descentflow.diagnosis.evidence.candidates import MeanEffect
from descentflow.diagnosis.evidence.explain import Explainer
from descentflow.diagnosis.findings.gap_found import LargestDifference
from descentflow.diagnosis.findings.selection_found import DetectionLimit
from descentflow.diagnosis.inference.linear_gaussian import posterior

POWER_80 = 0.8416
"""Standard normal quantile of 80 %."""


def detection_limits(explainer: Explainer) -> list[DetectionLimit]:
    """Limits of the effects that show in the means; those that only single flights show have none.

    Args:
        explainer: Of the flights.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_sides
        >>> from descentflow.effects import EFFECTS
        >>> found = detection_limits(Explainer(example_sides(), {"temperature": EFFECTS["temperature"]}))
        >>> found[0].parameter, 0.3 < found[0].size < 3.0
        ('deviation_k', True)
    """
    found = []
    for candidate in explainer.search.fits.candidates.values():
        if isinstance(candidate, MeanEffect) and len(candidate.start):
            found.append(_limit(explainer, candidate))
    return found


def _limit(explainer: Explainer, candidate: MeanEffect) -> DetectionLimit:
    known, assumed = explainer.known, explainer.assumed
    about = candidate.at(candidate.start)
    prior = candidate.prior_sd
    # The others of its sizes are free: what is left of the first is what the flights say of it alone.
    apart = posterior(known.difference, known.covariance, about.jacobian, candidate.prior_mean, prior)
    variance = apart.covariance[0, 0]
    parameter = next(p for p in candidate.effect.parameters if not p.from_heterogeneity)
    size: float | None = None
    if variance < prior[0] ** 2 * (1.0 - 1e-9):
        sigma = math.sqrt(1.0 / (1.0 / variance - 1.0 / prior[0] ** 2))
        ratio = (prior[0] / sigma) ** 2
        needed = math.log(assumed.named / (1.0 - assumed.named)) + math.log(
            (1.0 - assumed.inclusion) / assumed.inclusion
        )
        size = sigma * math.sqrt(2.0 * (needed + 0.5 * math.log1p(ratio)) * (1.0 + ratio) / ratio) + POWER_80 * sigma
        moved = float((np.abs(about.jacobian[:, 0]) / known.negligible).max())
        size = max(size, assumed.least_shift / max(moved, 1e-30))
        size = None if abs(size) > max(abs(parameter.low), abs(parameter.high)) else size
    shows = None if size is None else _shows(explainer, about.jacobian[:, 0] * size)
    return DetectionLimit(candidate.name, parameter.name, size, parameter.unit, parameter.text, shows)


def _log_odds(probability: float) -> float:
    return math.log(probability / (1.0 - probability))


def _shows(explainer: Explainer, shift: np.ndarray) -> LargestDifference:
    """Entry where a shift (p,) is largest in units of what is negligible."""
    standing = np.abs(shift) / explainer.known.negligible
    most = int(standing.argmax())
    entry = explainer.within.entries[most]
    low, high = explainer.within.level_range(entry)
    return LargestDifference(entry.quantity, low, high, float(shift[most]), float(standing[most]))
