"""Explanation of the difference of two sides: causes with sizes, what stands beside them, and what is unknown."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from descentflow.diagnosis.findings.findings import DetectionLimit, Verdict
from descentflow.diagnosis.findings.gap_found import Lack
from descentflow.diagnosis.inference.candidates import Candidate, MeanEffect
from descentflow.diagnosis.inference.flight_effects import FlightShapes, differing
from descentflow.diagnosis.inference.linear_gaussian import posterior
from descentflow.diagnosis.inference.moments import moments
from descentflow.diagnosis.inference.naming import Named, lacks, layers_of_air, name_effects, set_apart, verdict_of
from descentflow.diagnosis.inference.sets import Search, SetFit
from descentflow.diagnosis.inference.signatures import Signatures
from descentflow.diagnosis.inference.two_sides import Compared
from descentflow.effects import Effect
from descentflow.effects.effect import NOISE


@dataclass(frozen=True)
class Explanation:
    """Explanation of the flights of two sides.

    Attributes:
        verdict: See :data:`descentflow.diagnosis.findings.findings.Verdict`.
        named: Effects with their groups and probabilities.
        best: The set of the named effects, with an unknown cause where one is probable.
        sets: All that were fitted, heaviest first.
        theta: By effect of ``best``: its parameters (k,).
        errors: Standard errors of these.
        lacks: What the simulator lacks besides.
    """

    verdict: Verdict
    named: Named
    best: SetFit
    sets: Sequence[SetFit]
    theta: Mapping[str, Tensor]
    errors: Mapping[str, Tensor]
    lacks: Sequence[Lack]


class Explainer:
    """The steps from flights of two sides to an explanation."""

    def __init__(self, compared: Compared, catalogue: Mapping[str, Effect]) -> None:
        """Take the moments and the shapes of single flights.

        Args:
            compared: Flights of both sides.
            catalogue: Effects that may be named.
        """
        self.compared, self.assumed = compared, compared.assumed
        apart = set_apart(compared)
        self._aside, self.within = (compared.only(torch.nonzero(part)[:, 0]) for part in (apart, ~apart))
        self.known, self.catalogue = moments(self.within, self.assumed), catalogue
        signatures = Signatures(self.within, self.known, self.assumed)
        self._by_flight = differing(catalogue)
        others = [effect for effect in catalogue.values() if effect not in self._by_flight]
        means = [MeanEffect(effect, signatures, self.assumed) for effect in others]
        candidates: list[Candidate] = [
            one for one in means if np.abs(one.at(one.start).jacobian).max(initial=0.0) > 0.0
        ]
        if self._by_flight and "rate" in self.within.quantities():
            candidates += FlightShapes(self.within, self.known, self._by_flight, self.assumed).candidates(signatures)
        self.groups = list(dict.fromkeys(e.scale_group.members for e in catalogue.values() if e.scale_group))
        self.search = Search(self.known, candidates, self.assumed, exclusive=self.groups)

    def explanation(self) -> Explanation:
        """Weigh the sets and name what they say."""
        fits, sets = self.search.fits, self.search.sets()
        named = name_effects(sets, self.assumed, alike=self.groups)
        heaviest = next((one for one in sets if set(named.groups) <= set(one.names)), sets[0])
        verdict = verdict_of(named, heaviest, self.known, fits)
        has_cause = verdict in ("effect", "partial")
        names = tuple(named.groups) if has_cause else ()
        keeps_all = verdict in ("partial", "unknown")
        unknown = {q: scale for q, scale in heaviest.unknown.items() if keeps_all or q in heaviest.air}
        best = self.search.sized(fits.fit(names, unknown, heaviest.sizes))
        # Edges and changes of single flights raise short-scale noise, and so do some effects by definition.
        start, state = {name: self.catalogue[name].start() for name in names}, self.within.state
        raised = any(
            self.catalogue[name] in self._by_flight
            or any(quantity.startswith(NOISE) for quantity in self.catalogue[name].shift(state, start[name]))
            for name in names
        )
        return Explanation(
            verdict,
            named,
            best,
            sets,
            {name: fits.candidates[name].theta(best.sizes[name]) for name in names},
            {name: fits.candidates[name].theta_errors(best.errors[name]) for name in names},
            [
                *lacks(self._aside, self.assumed, raised=raised),
                *layers_of_air(best, self.known, fits),
            ],
        )


def explain(compared: Compared, catalogue: Mapping[str, Effect]) -> Explanation:
    """Explain how the real flights differ from the simulator's.

    Args:
        compared: Flights of both sides.
        catalogue: Effects that may be named.
    """
    return Explainer(compared, catalogue).explanation()


POWER_80 = 0.8416
"""Standard normal quantile of 80 %."""


def detection_limits(explainer: Explainer) -> list[DetectionLimit]:
    r"""The smallest size of each effect that would be named; effects that only single flights show have none.

    Of one size with the prior :math:`N(0, \tau^2)`, known by the flights to :math:`\sigma`, the evidence gains

    .. math:: \ln B(\theta) = \frac{\theta^2}{2\sigma^2}\frac{\tau^2}{\tau^2 + \sigma^2}
       - \frac12 \ln\Big(1 + \frac{\tau^2}{\sigma^2}\Big)

    on average. An effect alone is named from :math:`\ln B = \ln\frac{0.95}{0.05} + \ln\frac{1 - \pi}{\pi}`. A standard
    normal quantile of 0.84 times :math:`\sigma` more makes that so in 80 of 100 cases.

    Args:
        explainer: Of the flights.
    """
    found, known, assumed = [], explainer.known, explainer.assumed
    needed = math.log(assumed.named / (1.0 - assumed.named)) + math.log((1.0 - assumed.inclusion) / assumed.inclusion)
    for candidate in explainer.search.fits.candidates.values():
        if not isinstance(candidate, MeanEffect) or not len(candidate.start):
            continue
        about, prior = candidate.at(candidate.start), candidate.prior_sd
        # The others of its sizes are free: what is left of the first is what the flights say of it alone.
        apart = posterior(known.difference, known.covariance, about.jacobian, candidate.prior_mean, prior)
        variance = apart.covariance[0, 0]
        parameter = next(p for p in candidate.effect.parameters if not p.from_heterogeneity)
        size = math.inf
        if variance < prior[0] ** 2 * (1.0 - 1e-9):
            sigma = math.sqrt(1.0 / (1.0 / variance - 1.0 / prior[0] ** 2))
            ratio = (prior[0] / sigma) ** 2
            size = (
                sigma * math.sqrt(2.0 * (needed + 0.5 * math.log1p(ratio)) * (1.0 + ratio) / ratio) + POWER_80 * sigma
            )
            moved = float((np.abs(about.jacobian[:, 0]) / known.negligible).max())
            size = max(size, assumed.least_shift / max(moved, 1e-30))
        possible = size if abs(size) <= max(abs(parameter.low), abs(parameter.high)) else None
        found.append(DetectionLimit(candidate.name, parameter.name, possible, parameter.unit, parameter.text))
    return found
