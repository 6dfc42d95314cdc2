"""Steps of a diagnosis of measured flights: explain the difference, put the causes in, measure what is left.

Each step is decided elsewhere: which effects are named in :mod:`~descentflow.diagnosis.inference.explain`, where the
flights differ in ``_where``, by how much matters in :mod:`~descentflow.diagnosis.gap.practical_size`, the verdict in
:mod:`~descentflow.diagnosis.inference.verdict`.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import polars as pl
import torch
from torch import Tensor

from descentflow.diagnosis.correction.corrected_descents import correction_made
from descentflow.diagnosis.correction.effects_in_flights import AddedEffects, corrected_entries
from descentflow.diagnosis.findings.cause_found import Cause, ClosedShare
from descentflow.diagnosis.findings.costs_found import CLOSED, COST_LABELS, Cost, LevelMeans
from descentflow.diagnosis.findings.findings import Curve, Details, Findings
from descentflow.diagnosis.gap._measured_gap import MeasuredGap
from descentflow.diagnosis.gap._what_is_left import (
    CERTAIN_ERRORS,
    curves,
    flights_worth_a_look,
    not_identifiable,
    remaining_of,
    standard_errors,
    would_split,
)
from descentflow.diagnosis.gap._where import PERMUTATIONS, where
from descentflow.diagnosis.gap.costs import costs_of, profile_of
from descentflow.diagnosis.gap.practical_size import below_rounding
from descentflow.diagnosis.inference._described import cause_of, discrepancy_of, heaviest_sets, recipe_of, singles_of
from descentflow.diagnosis.inference.explain import Explanation, detection_limits, explain
from descentflow.diagnosis.inference.verdict import verdict_of
from descentflow.diagnosis.sides.diagnosis_settings import Settings
from descentflow.diagnosis.sides.two_sides import Compared


def diagnose_compared(
    compared: Compared, settings: Settings, source: str, counts: Mapping[str, int], frame: pl.DataFrame
) -> Findings:
    """Diagnose flights of both sides that are measured already.

    Args:
        compared: Flights of both sides.
        settings: What is diagnosed, and how.
        source: Where the simulator's side comes from.
        counts: Of flights and rows.
        frame: Prepared descents, for the corrected simulator.
    """
    why = explain(compared, settings.catalogue, settings.progress)
    settings.progress("asking where the gap lies")
    cells = where(compared.in_own_air(), settings.transition_fl, settings.seed)
    p_value = min((cell.p_value for cell in cells), default=1.0)
    profile, costs = profile_of(compared), costs_of(compared, None, settings.seed)
    is_gap = p_value <= compared.assumed.false_gap
    small = below_rounding(compared, cells, costs, profile) if is_gap else []
    is_gap = is_gap and not small
    theta = why.theta if is_gap else {}
    settings.progress("putting the causes into the simulator's flights")
    cleaning, seed = settings.simulator.cleaning, settings.seed
    added = AddedEffects(settings.catalogue, theta, compared.state.mass_kg, cleaning, seed)
    left, closure = left_with(compared, added), MeasuredGap(compared, _measured_over(why), seed)
    floor, after, error = closure.floor(left), closure.after(left), standard_errors(compared)
    costs = _costs_with(compared, added) if theta else costs
    verdict = verdict_of(why, is_gap=is_gap, costs=costs)
    causes = _causes(why, added, closure.share(left), costs) if theta else []
    # Effects are put in where they were found: at the coefficients that the simulator's own flights show.
    simulator = replace(settings.simulator, aircraft=compared.state.aircraft)
    made = correction_made(simulator, frame, added) if theta else {}
    hidden = not_identifiable(settings, source)
    unexplained = verdict in ("unknown", "partial")
    return Findings(
        verdict=verdict,
        p_value=p_value,
        floor=floor,
        gap_before=closure.before,
        where=cells,
        causes=causes,
        gap_after=after,
        remaining=remaining_of(compared, left, error, after - floor, why.named.unknown),
        would_split=hidden if verdict == "none" else would_split(compared, settings.catalogue, causes),
        dropped=dict(counts),
        details=_details(why, settings, source, curves(compared, left, error), closure, profile),
        costs=costs,
        recipe=recipe_of(causes, settings.catalogue, compared.levels()),
        corrections=made,
        corrected_file=next(iter(made), ""),
        flights_worth_a_look=flights_worth_a_look(compared, left, profile) if unexplained else [],
        below_rounding=small,
    )


def _causes(why: Explanation, added: AddedEffects, closed: ClosedShare, costs: Sequence[Cost]) -> list[Cause]:
    """Named effects, the one that takes most of the time away first."""
    causes = [cause_of(why, name, closed, _takes_away(why.compared, added, name, costs)) for name in added.theta]
    return sorted(causes, key=lambda cause: -abs(cause.takes_away.get("time", 0.0)))


def _details(
    why: Explanation,
    settings: Settings,
    source: str,
    by_level: dict[str, Curve],
    closure: MeasuredGap,
    profile: list[LevelMeans],
) -> Details:
    """Settings, evidence of every effect, and what lies behind the figures."""
    return Details(
        simulator=settings.simulator.name,
        # What is normal is what the simulator's flights, or physics, claim.
        regime="anchored",
        typecode=settings.simulator.aircraft.typecode,
        normal_from=source,
        seed=settings.seed,
        quantities=list(why.compared.quantities()),
        transition_fl=settings.transition_fl,
        mass_kg=why.compared.state.mass_kg,
        n_permutations=PERMUTATIONS,
        discrepancy=discrepancy_of(why),
        singles=singles_of(why),
        curves=by_level,
        labels={name: effect.text for name, effect in settings.catalogue.items()},
        subsets=heaviest_sets(why),
        detection_limits=detection_limits(why),
        profile=profile,
        measured_over=closure.entries(),
        gap_error=closure.error,
        lacks=list(why.nuisances),
    )


def left_with(compared: Compared, added: AddedEffects) -> Tensor:
    """Entries (n, p) of all flights once the simulator has the causes."""
    if compared.has_simulated:
        return corrected_entries(compared, added)
    # Nominal descents have no flights of their own: the causes are taken off the real ones.
    left = compared.y.clone()
    for name, value in added.theta.items():
        left = left - compared.vector(added.catalogue[name].shift(compared.state, value))
    return left


def _measured_over(why: Explanation) -> Tensor:
    """Entries (p,) whose means certainly differ, all where none does, of those that causes are weighed by."""
    known = why.search.known
    standing = np.abs(known.difference) / np.sqrt(known.covariance.diagonal())
    differs = standing > CERTAIN_ERRORS
    chosen = {e for e, certain in zip(why.weighed.entries, differs, strict=True) if certain or not differs.any()}
    return torch.tensor([entry in chosen for entry in why.compared.entries])


def _costs_with(compared: Compared, added: AddedEffects) -> list[Cost]:
    """Costs before and after the causes; also those in each flight's own air, where that is measured and a cause.

    The mean of a wind is one cause, and its layers and days are none: in its own air a flight has all of it.
    """
    costs = costs_of(compared, left_with(compared, added), added.seed)
    others = {name: value for name, value in added.theta.items() if not added.catalogue[name].of_air}
    # What both sides have alike is compared without any cost.
    if not costs or len(others) == len(added.theta) or not compared.measures_air:
        return costs
    freed, low_fl, high_fl = compared.in_own_air(), costs[0].low_fl, costs[0].high_fl
    own = costs_of(freed, left_with(freed, replace(added, theta=others)), added.seed)
    whole = {cost.name: replace(cost, low_fl=low_fl, high_fl=high_fl) for cost in reversed(own)}
    return costs + [replace(whole[name], name=inside, label=COST_LABELS[inside][0]) for name, inside in CLOSED.items()]


def _takes_away(compared: Compared, added: AddedEffects, name: str, costs: Sequence[Cost]) -> dict[str, float]:
    """By cost over all levels: how much more of the difference is left without one of the causes."""
    others = {other: value for other, value in added.theta.items() if other != name}
    whole = {cost.name: cost.after.estimate for cost in reversed(costs) if cost.after}
    without = {cost.name: cost.after for cost in reversed(_costs_with(compared, replace(added, theta=others)))}
    return {cost: after.estimate - whole[cost] for cost, after in without.items() if after and cost in whole}
