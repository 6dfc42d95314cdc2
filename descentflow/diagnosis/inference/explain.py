"""Explanation of the difference of two sides: causes with sizes, what stands next to them, and what is unknown."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch
from torch import Tensor

from descentflow.core.linear_gaussian import Array, posterior
from descentflow.diagnosis.findings.findings import DetectionLimit
from descentflow.diagnosis.findings.gap_found import Nuisance
from descentflow.diagnosis.inference.candidates import Candidate, MeanEffect
from descentflow.diagnosis.inference.flight_effects import FlightShapes, differing
from descentflow.diagnosis.inference.moments import Moments, moments
from descentflow.diagnosis.inference.naming import (
    Named,
    free_in_every_set,
    layers_of_air,
    name_effects,
    nuisances,
    outweighs_causes,
)
from descentflow.diagnosis.inference.sets import OF_AIR, Names, Search, SetFit, SetFits
from descentflow.diagnosis.inference.signatures import Signatures
from descentflow.diagnosis.sides.two_sides import Compared
from descentflow.effects import Effect
from descentflow.effects.effect import NOISE


@dataclass(frozen=True)
class Explanation:
    """Explanation of the flights of two sides.

    Attributes:
        compared: Flights of both sides.
        weighed: The same as they are weighed: without their own air, and without what is free in every set.
        catalogue: Effects that may be named.
        search: Sets of effects for the means of both sides.
        sets: All that were fitted, heaviest first.
        named: Effects with their groups and probabilities.
        is_none: Whether there is probably nothing to explain.
        best: The set of the causes, with an unknown cause where one is probable.
        theta: By cause: its parameters (k,).
        errors: Standard errors of these.
        nuisances: Noise, level-offs and layers of air that the simulator has too little of, besides any cause.
    """

    compared: Compared
    weighed: Compared
    catalogue: Mapping[str, Effect]
    search: Search
    sets: Sequence[SetFit]
    named: Named
    is_none: bool
    best: SetFit
    theta: Mapping[str, Tensor]
    errors: Mapping[str, Tensor]
    nuisances: Sequence[Nuisance]


def explain(
    compared: Compared, catalogue: Mapping[str, Effect], progress: Callable[[str], None] = lambda _: None
) -> Explanation:
    """Explain how the real flights differ from the simulator's: weigh sets of effects, and name what they say.

    Args:
        compared: Flights of both sides.
        catalogue: Effects that may be named.
        progress: Called with what is being done.
    """
    progress("measuring means and shapes of flights")
    assumed, free = compared.assumed, free_in_every_set(compared)
    aside, within = (compared.only(torch.nonzero(part)[:, 0]) for part in (free, ~free))
    within = within.in_own_air()
    known, by_flight = moments(within), differing(catalogue)
    signatures = Signatures(within, known)
    # Few flights can tell what their own channels contradict, and no cause that needs a spread or coefficients.
    able = [e for e in catalogue.values() if not compared.short_of_causes or e.inherited_from is not None]
    means = [MeanEffect(effect, signatures) for effect in able if effect not in by_flight]
    candidates: list[Candidate] = [one for one in means if np.abs(one.at(one.start).jacobian).max(initial=0.0) > 0.0]
    if by_flight and "rate" in within.quantities() and not compared.short_of_causes:
        candidates += FlightShapes(within, known, by_flight).candidates(signatures)
    groups = list(dict.fromkeys(e.scale_group.members for e in catalogue.values() if e.scale_group))
    progress("weighing sets of effects")
    search = Search(known, candidates, assumed, exclusive=groups)
    fits, sets = search.fits, search.sets()
    named = name_effects(sets, assumed, alike=groups)
    heaviest = next((fit for fit in sets if set(named.groups) <= set(fit.names)), sets[0])
    is_none = named.none > 1.0 - assumed.named

    def at_best(names: Names) -> SetFit:
        # A gap that the causes do not explain alone keeps all that is unknown; any other what measures the air.
        keeps_all = not is_none and (not names or named.has_unknown)
        unknown = {q: scale for q, scale in heaviest.unknown.items() if keeps_all or q in heaviest.air}
        return search.sized(fits.fit(names, unknown, heaviest.sizes))

    best = at_best(() if is_none or outweighs_causes(named, heaviest, known, fits) else tuple(named.groups))
    best, named = changed_surely(best, named, at_best, fits)
    names = best.names
    # Edges and changes of single flights raise short-scale noise, and so do some effects by definition.
    raised = any(
        catalogue[name] in by_flight
        or any(quantity.startswith(NOISE) for quantity in catalogue[name].shift(within.state, catalogue[name].start()))
        for name in names
    )
    theta = {name: fits.candidates[name].theta(best.sizes[name]) for name in names}
    errors = {name: fits.candidates[name].theta_errors(best.errors[name]) for name in names}
    for name in names:
        by_channel = catalogue[name].of_air or catalogue[name].rate_follows_cas
        measured = sizes_measured(fits.candidates[name], best, known) if by_channel else None
        if measured:
            theta[name], errors[name] = map(torch.from_numpy, measured)
    lacks = [*nuisances(aside, raised=raised), *layers_of_air(best, known, fits)]
    return Explanation(compared, within, catalogue, search, sets, named, is_none, best, theta, errors, lacks)


def changed_surely(
    best: SetFit, named: Named, at_best: Callable[[Names], SetFit], fits: SetFits
) -> tuple[SetFit, Named]:
    """The causes whose 90 % interval leaves out no change.

    Where that of the first of a group does not, and surely one of the group is a cause, another leads.

    Args:
        best: The set of the causes.
        named: With their groups.
        at_best: Fits a set.
        fits: Of the catalogue.
    """
    groups: dict[str, Names] = {}
    for lead in best.names:
        group = (lead, *named.groups[lead])
        surely_one = sum(named.probability[one] for one in group) > 1.0 - fits.assumed.least_shown
        for member in group if surely_one else (lead,):
            fit = at_best(tuple(member if one == lead else one for one in best.names))
            if fits.candidates[member].differs(fit.sizes[member], fit.errors[member]):
                groups[member] = tuple(one for one in group if one != member)
                break
    return at_best(tuple(groups)), replace(named, groups=groups)


def sizes_measured(candidate: Candidate, best: SetFit, known: Moments) -> tuple[Array, Array] | None:
    """Sizes (k,) of an effect by the quantity that measures it alone, and their standard errors; None without one.

    Layers bend the profiles of either side, and fleets differ in whose aircraft they have. By least squares over the
    levels the sizes are the mean deviation, slope or change of speeds, whatever the evidence weighs most; bands that
    all go together do not average out, as shrunk correlations would have it.

    Args:
        candidate: The effect.
        best: The set of the causes, about whose sizes it is linear.
        known: Moments of both sides.
    """
    sizes = best.sizes[candidate.name]
    jacobian = candidate.at(sizes).jacobian
    for quantity in (*OF_AIR, "cas"):
        at = (known.quantity == quantity) & (jacobian != 0.0).any(1)
        if np.linalg.matrix_rank(jacobian[at]) == len(sizes):
            weight = np.linalg.pinv(jacobian[at])
            variance = weight @ (known.covariance + known.shrunk_off)[np.ix_(at, at)] @ weight.T
            return sizes + weight @ (known.difference - best.shift)[at], np.sqrt(variance.diagonal())
    return None


POWER_80 = 0.8416
"""Standard normal quantile of 80 %."""


def detection_limits(explained: Explanation) -> list[DetectionLimit]:
    r"""The smallest size of each effect that would be named; effects that only single flights show have none.

    Of one size with the prior :math:`N(0, \tau^2)`, known by the flights to :math:`\sigma`, the evidence gains

    .. math:: \ln B(\theta) = \frac{\theta^2}{2\sigma^2}\frac{\tau^2}{\tau^2 + \sigma^2}
       - \frac12 \ln\Big(1 + \frac{\tau^2}{\sigma^2}\Big)

    on average. An effect alone is named from :math:`\ln B = \ln\frac{0.95}{0.05} + \ln\frac{1 - \pi}{\pi}`. A standard
    normal quantile of 0.84 times :math:`\sigma` more makes that so in 80 of 100 cases.

    Args:
        explained: The explanation.
    """
    limits, known, assumed = [], explained.search.known, explained.search.assumed
    needed = math.log(assumed.named / (1.0 - assumed.named)) + math.log((1.0 - assumed.inclusion) / assumed.inclusion)
    for candidate in explained.search.fits.candidates.values():
        if not isinstance(candidate, MeanEffect) or not len(candidate.start):
            continue
        about, prior = candidate.at(candidate.start), candidate.prior_sd
        # The others of its sizes are free: what is left of the first is what the flights say of it alone.
        apart = posterior(known.difference, known.covariance, about.jacobian, candidate.start, prior)
        variance = apart.covariance[0, 0]
        parameter = candidate.effect.parameters[0]
        size = math.inf
        if variance < prior[0] ** 2 * (1.0 - 1e-9):
            sigma = math.sqrt(1.0 / (1.0 / variance - 1.0 / prior[0] ** 2))
            ratio = (prior[0] / sigma) ** 2
            wanted = 2.0 * (needed + 0.5 * math.log1p(ratio)) * (1.0 + ratio) / ratio
            size = sigma * (math.sqrt(wanted) + POWER_80)
            moved = float((np.abs(about.jacobian[:, 0]) / known.negligible).max())
            size = max(size, assumed.least_shift / max(moved, 1e-30))
        possible = size if abs(size) <= max(abs(parameter.low), abs(parameter.high)) else None
        limits.append(DetectionLimit(candidate.name, parameter.name, possible, parameter.unit, parameter.text))
    return limits
