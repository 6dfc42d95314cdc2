"""Causes with their sizes, groups, closure and rivals, and what would separate what these data cannot."""

from collections.abc import Callable, Mapping, Sequence

import torch
from torch import Tensor

from descentflow.diagnosis.correction.closure import GapMeasure, rivals_closure
from descentflow.diagnosis.findings.cause_found import Cause, Closure, Heterogeneity, ParameterEstimate, ScoreGain
from descentflow.diagnosis.findings.gap_found import WouldSplit
from descentflow.diagnosis.inference.heterogeneity import together
from descentflow.diagnosis.inference.likelihood import EffectsLikelihood
from descentflow.diagnosis.inference.selection import Chosen
from descentflow.diagnosis.inference.two_sides import Compared
from descentflow.diagnosis.inference.uncertainty import covariance
from descentflow.diagnosis.report.both_sides import BothSides, on_both_sides, told_of_both
from descentflow.diagnosis.report.sizes import NINETY, known_errors, share_of, sizes_of
from descentflow.effects import UNKNOWN, Effect

SHOWS = {"TAS": "tas", "geoaltitude": "height", "groundspeed": "wind", "Mach": "mismatch"}
"""Channel -> the quantity that it makes, the one most often worth adding first."""


def causes_of(
    likelihood: EffectsLikelihood,
    chosen: Chosen,
    measure: GapMeasure,
    shifts: Mapping[str, Tensor],
    spreads: Mapping[str, float],
    progress: Callable[[str], None],
    *,
    inherited: bool = False,
) -> list[Cause]:
    """Every chosen effect, in order of selection.

    Args:
        likelihood: Flights and catalogue.
        chosen: Outcome of the selection.
        measure: Of the gap.
        shifts: By effect, (n, p) with each flight's own share of it.
        spreads: How widely the shares spread between flights, by effect.
        progress: Called with what is being done.
        inherited: Whether the simulator's own flights have the effects as well.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_likelihood
        >>> from descentflow.effects import EFFECTS
        >>> likelihood = example_likelihood(EFFECTS["temperature"], [10.0])
        >>> from descentflow.diagnosis.inference.discrepancy import discrepancy_columns
        >>> columns = discrepancy_columns(likelihood.compared)
        >>> from descentflow.diagnosis.inference.heterogeneity import heterogeneous_shifts
        >>> from descentflow.diagnosis.inference.selection import select
        >>> chosen = select(likelihood, columns, lambda stage: None)
        >>> measure = GapMeasure(likelihood, likelihood.compared.of("tas"), seed=0)
        >>> shifts, spreads = heterogeneous_shifts(likelihood, chosen.fit)
        >>> found = causes_of(likelihood, chosen, measure, shifts, spreads, lambda stage: None)
        >>> [(cause.effect, round(cause.parameters["deviation_k"].estimate)) for cause in found]
        [('temperature', 10)]
    """
    fit = chosen.fit
    spread = covariance(likelihood, fit).diagonal().clamp(min=0.0).sqrt()
    errors = dict(zip(fit.effects, torch.split(spread, [len(fit.theta[n]) for n in fit.effects]), strict=True))
    shift = together(shifts, likelihood)
    progress("measuring what other effects would close")
    alone = {name: single.fit.shift for name, single in chosen.singles.items()}
    rivals = rivals_closure(measure, alone, measure.floor(shift))
    closure = Closure(measure.marginal(shift), measure.conditional(fit.shift), measure.transfer(fit))
    causes = []
    for name in fit.effects:
        effect, (gain, error) = likelihood.catalogue[name], chosen.gains[name]
        sizes = parameters(effect, fit.theta[name], errors[name], int(likelihood.real.sum()))
        first = next(iter(sizes.values()), None)
        both = BothSides() if inherited else on_both_sides(likelihood.compared, effect)
        told = sizes_of(effect, fit.theta[name], errors[name], int(likelihood.real.sum()))
        cause = Cause(
            effect=name,
            group=list(chosen.groups[name]),
            probability=chosen.probability[name],
            inclusion=None if chosen.inclusion is None else chosen.inclusion.of_group[name],
            parameters=sizes,
            score_gain=ScoreGain(gain, gain - NINETY * error, gain + NINETY * error),
            heterogeneity=Heterogeneity(effect.heterogeneity, spreads[name]),
            closure=closure,
            rivals=[row for row in rivals if row.effect != name],
            inherited=inherited,
            label=effect.text,
            text=effect.in_words(None if first is None else first.estimate, has_some=both.has_some),
            share_of_flights=share_of(effect, fit.theta[name], errors[name], int(likelihood.real.sum())),
            own_closure=closure.marginal if len(shifts) == 1 else measure.marginal(shifts[name]),
            sizes=told_of_both(effect, told, both),
            on_both_sides=both.measured,
        )
        causes.append(cause)
    return causes


def parameters(effect: Effect, theta: Tensor, error: Tensor, flights: int) -> dict[str, ParameterEstimate]:
    """Estimate and 90 % interval of every parameter, kept within its physical bounds.

    Args:
        effect: Whose parameters they are.
        theta: Estimates (k,).
        error: Standard errors (k,), zero where the data say nothing.
        flights: Real flights, by which a share of them is known.

    Example:
        >>> from descentflow.effects import EFFECTS
        >>> theta, error = torch.tensor([10.0]), torch.tensor([0.5])
        >>> print(parameters(EFFECTS["temperature"], theta, error, 400)["deviation_k"])
        deviation from the standard atmosphere 10 (9.18 to 10.8) K
    """
    found: dict[str, ParameterEstimate] = {}
    known = known_errors(effect, theta, error, flights)
    for p, value, sd in zip(effect.parameters, theta.tolist(), known.tolist(), strict=True):
        if p.is_spread:
            if value > 0.0:
                found[p.name] = ParameterEstimate(value, None, None, p.unit, p.text)
            continue
        if sd == 0.0 and not p.from_heterogeneity:
            # The data say nothing of it: a channel that is not there.
            continue
        low: float | None = None
        high: float | None = None
        if sd > 0.0:
            low, high = max(value - NINETY * sd, p.low), min(value + NINETY * sd, p.high)
        found[p.name] = ParameterEstimate(value, low, high, p.unit, p.text)
    return found


def would_split(
    compared: Compared,
    catalogue: Mapping[str, Effect],
    causes: Sequence[Cause],
    undecided: Sequence[Sequence[str]] = (),
) -> list[WouldSplit]:
    """Channels that are not there and would separate a cause from its group, or help an unknown one to a name.

    Args:
        compared: Flights of both sides.
        catalogue: Effects by name.
        causes: That were named.
        undecided: Effects that would be named, each with those that it may be as well for lack of their channels.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_sides
        >>> from descentflow.effects import EFFECTS
        >>> [row.channels for row in would_split(example_sides(), EFFECTS, [])]  # of an unknown cause
        [['geoaltitude'], ['groundspeed'], ['Mach']]
    """
    there = set(compared.quantities())
    found = []
    for alike in undecided:
        needed = list(dict.fromkeys(channel for name in alike for channel in catalogue[name].needs))
        found.append(WouldSplit(list(alike), needed, "they look alike in the channels given, so neither is named"))
    for cause in causes:
        names = [cause.effect, *cause.group]
        able = list(dict.fromkeys(channel for name in names for channel in catalogue[name].splits))
        missing = [channel for channel in able if channel in SHOWS and SHOWS[channel] not in there]
        if len(names) > 1 and missing:
            found.append(WouldSplit(names, missing, "they look alike in the channels given"))
        groups = dict.fromkeys(catalogue[name].scale_group for name in names)
        found += [WouldSplit(list(group.members), [], group.why) for group in groups if group is not None]
    if not causes:
        why = "it is not among the channels"
        found += [WouldSplit([UNKNOWN], [c], why) for c, quantity in SHOWS.items() if quantity not in there]
    return found
