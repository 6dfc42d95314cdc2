"""Causes, sets and single effects of an explanation, as findings: sizes in aviation units, and alternatives."""

from collections.abc import Mapping, Sequence

import torch
from torch import Tensor

from descentflow.diagnosis.findings._sizes import BothSides, parameters, share_of, sizes_beside, sizes_of
from descentflow.diagnosis.findings.cause_found import Alternative, Cause, ClosedShare, Closure, OnBothSides
from descentflow.diagnosis.findings.correction_found import RecipeNumber, RecipeStep
from descentflow.diagnosis.findings.findings import Discrepancy, SingleEffect, Subset
from descentflow.diagnosis.inference.explain import Explanation
from descentflow.diagnosis.sides.two_sides import Compared
from descentflow.effects import UNKNOWN, Effect
from descentflow.effects.effect import NONE
from descentflow.measurements.quantity_registry import QUANTITIES

SHOWN_SETS = 10
"""Sets of effects that are written down."""


def cause_of(explanation: Explanation, name: str, closed: ClosedShare, takes_away: Mapping[str, float]) -> Cause:
    """A named effect with its sizes and alternatives.

    Args:
        explanation: The explanation.
        name: Of the effect.
        closed: Share of the gap that all causes close.
        takes_away: By cost, what this one takes away of the difference.
    """
    effect, value, error = explanation.catalogue[name], explanation.theta[name], explanation.errors[name]
    compared, fits, best = explanation.compared, explanation.search.fits, explanation.best
    flights, both, group = int(compared.real.sum()), on_both_sides(compared, effect), explanation.named.groups[name]
    alternatives = []
    for member in group:
        # In the cause's place, besides the others.
        other, candidate = explanation.catalogue[member], fits.candidates[member]
        names = tuple(member if some == name else some for some in best.names)
        fit = explanation.search.sized(fits.fit(names, best.unknown, best.sizes))
        known = (other, candidate.theta(fit.sizes[member]), candidate.theta_errors(fit.errors[member]), flights)
        sizes = sizes_beside(other, sizes_of(*known), on_both_sides(compared, other))
        alternatives.append(Alternative(member, explanation.named.probability[member], sizes, share_of(*known)))
    sizes_now = parameters(effect, value, error, flights)
    first = next((size.estimate for size in sizes_now.values()), None)
    weights = zip(explanation.named.weights.tolist(), explanation.sets, strict=True)
    without = fits.fit(tuple(member for member in best.names if member != name), best.unknown, best.sizes)
    return Cause(
        effect=name,
        group=list(group),
        probability=explanation.named.probability[name],
        parameters=sizes_now,
        evidence_nats=best.log_weight - without.log_weight,
        closure=Closure(closed),
        label=effect.text,
        text=effect.in_words(first, has_some=both.has_some),
        inclusion=sum(weight for weight, one in weights if {name, *group} & set(one.names)),
        share_of_flights=share_of(effect, value, error, flights),
        sizes=sizes_beside(effect, sizes_of(effect, value, error, flights), both),
        on_both_sides=both.measured,
        takes_away=dict(takes_away),
        alternatives=alternatives,
        of_air=effect.of_air,
    )


def on_both_sides(compared: Compared, effect: Effect) -> BothSides:
    """Measurements of an effect on either side.

    Args:
        compared: Flights of both sides; a nominal descent has none of any effect.
        effect: Of which it is asked.
    """
    if not compared.has_simulated:
        return BothSides()
    by_side = [_of_side(compared, effect, side) for side in (compared.real, ~compared.real)]
    if not all(by_side):
        return BothSides(bool(effect.against))
    rows, some = [], False
    for p, flights, simulator in zip(effect.parameters, *by_side, strict=True):
        some |= abs(simulator) >= NONE * p.scale
        rows.append(OnBothSides(p.name, p.reported_unit, p.reported(flights), p.reported(simulator)))
    return BothSides(some, rows)


def _of_side(compared: Compared, effect: Effect, side: Tensor) -> list[float]:
    """Parameters that one side shows by itself."""
    index = torch.nonzero(side)[:, 0]
    banded = [name for name in compared.quantities() if QUANTITIES[name].by_band]
    shown = {name: compared.table(name, compared.y[index]) for name in banded}
    measured = effect.measured(compared.state.rows(index), shown)
    return [] if measured is None else measured.tolist()


def discrepancy_of(explanation: Explanation) -> Discrepancy:
    """Evidence (nats) of an unknown cause beyond the named effects."""
    fits, best = explanation.search.fits, explanation.best
    alone = fits.fit(best.names, first=best.sizes)
    beside = [fit.log_weight for fit in explanation.sets if fit.names == best.names and fit.has_unknown]
    gained = max([weight - alone.log_weight for weight in beside], default=0.0)
    return Discrepancy(alone.log_weight - fits.fit(()).log_weight, max(gained, 0.0), explanation.named.unknown)


def singles_of(explanation: Explanation) -> list[SingleEffect]:
    """Every effect alone, best first."""
    fits = explanation.search.fits
    null, rows = fits.fit(()).log_weight, []
    for name, candidate in fits.candidates.items():
        fit = fits.fit((name,))
        theta = candidate.theta(fit.sizes[name]).tolist()
        sizes = {p.name: v for p, v in zip(explanation.catalogue[name].parameters, theta, strict=True)}
        refused = "" if candidate.plausible(fit.sizes[name]) else "it fits best with sizes that it cannot have"
        rows.append(SingleEffect(name, fit.log_weight - null, sizes, refused))
    return sorted(rows, key=lambda row: -row.gain_nats)


def heaviest_sets(explanation: Explanation) -> list[Subset]:
    """Sets of effects, heaviest first."""
    pairs = list(zip(explanation.sets, explanation.named.weights.tolist(), strict=True))[:SHOWN_SETS]
    return [Subset([*one.names, *[UNKNOWN] * one.has_unknown], weight) for one, weight in pairs]


WINDOW = ("low_fl", "high_fl")
"""Parameters that bound the levels where an effect is."""


def recipe_of(
    causes: Sequence[Cause], catalogue: Mapping[str, Effect], levels_fl: tuple[float, float]
) -> list[RecipeStep]:
    """Changes to make in the simulator, cause by cause; sizes are those of the flights that have the effect.

    Args:
        causes: As they were found.
        catalogue: Effects, each with its own recipe (:meth:`~descentflow.effects.effect.Effect.recipe`).
        levels_fl: Lowest and highest level that were compared: the numbers hold between them.

    Example:
        >>> from descentflow.diagnosis.diagnose import diagnose
        >>> from descentflow.effects import EFFECTS
        >>> report = diagnose("descents.parquet", "A320", catalogue={"mass": EFFECTS["mass"]})
        >>> print(recipe_of(report.causes, EFFECTS, (150, 350))[0].text)
        mass x 0.9... (0.8... to 0.9...), FL150 to FL350
    """
    return [_step(cause, catalogue[cause.effect], levels_fl) for cause in causes]


def _step(cause: Cause, effect: Effect, levels_fl: tuple[float, float]) -> RecipeStep:
    ends = {size.parameter: size.value.estimate for size in cause.sizes if size.parameter in WINDOW}
    low, high = (ends.get(name, level) for name, level in zip(WINDOW, levels_fl, strict=True))
    by_products = {p.name for p in effect.parameters if p.by_product}
    entered = [size for size in cause.sizes if size.parameter not in WINDOW and size.parameter not in by_products]
    numbers = [RecipeNumber(size.parameter, size.unit, size.value, low, high) for size in entered]
    share = 1.0 if cause.share_of_flights is None else cause.share_of_flights.estimate or 1.0
    text = effect.recipe({size.parameter: size.text for size in entered}) or cause.text
    if text[:1] in ("+", "-"):
        # A difference from what the simulator has says by itself not of what it is one.
        text = f"{cause.label or cause.effect} {text}"
    place = f"FL{low:.0f} to FL{high:.0f}"
    some = "" if cause.share_of_flights is None else f", {cause.in_flights()}"
    return RecipeStep(cause.effect, f"{text}, {place}{some}", numbers, share)
