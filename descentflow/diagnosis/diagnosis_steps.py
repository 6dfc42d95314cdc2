"""Steps of one diagnosis: from the flights of two sides to a report, measured on the corrected simulator."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import polars as pl
import torch
from torch import Tensor

from descentflow.diagnosis.correction.corrected_descents import correction_made
from descentflow.diagnosis.correction.costs import costs_of, profile_of
from descentflow.diagnosis.correction.effects_in_flights import AddedEffects, corrected_entries
from descentflow.diagnosis.correction.measured_gap import MeasuredGap
from descentflow.diagnosis.diagnosis_settings import Settings
from descentflow.diagnosis.findings.cause_found import ClosedShare
from descentflow.diagnosis.findings.costs_found import Cost
from descentflow.diagnosis.findings.findings import Details
from descentflow.diagnosis.inference.explain import Explainer, detection_limits
from descentflow.diagnosis.inference.naming import set_apart
from descentflow.diagnosis.inference.where import PERMUTATIONS, where
from descentflow.diagnosis.practical_size import below_rounding
from descentflow.diagnosis.report.described import (
    cause_of,
    discrepancy_of,
    heaviest_sets,
    levels_compared,
    recipe_of,
    singles_of,
)
from descentflow.diagnosis.report.gap_report import GapReport
from descentflow.diagnosis.report.what_is_left import (
    curves,
    flights_worth_a_look,
    not_identifiable,
    remaining_of,
    would_split,
)

SURELY = 3.0
"""Standard errors from which a mean counts among those that a gap is measured over."""
SURELY_LEFT = 2.58 / 1.645
"""Half widths of a 90 % interval in that of 99 %: one right answer in a hundred is called a part."""
LEFT_SHARE = 0.1
"""Share of the difference before that an effect's equation may miss of it."""


def leaves_cost(costs: Sequence[Cost]) -> bool:
    """Test for time at equal speed that the causes leave, by more than chance and more than a tenth.

    Example:
        >>> from descentflow.diagnosis.findings.costs_found import Measured
        >>> def time(after: Measured) -> Cost:
        ...     return Cost("time_at_speed", "time", "s", 150, 350, 600, 620, Measured(20, 18, 22), after, floor=3.0)
        >>> leaves_cost([time(Measured(1.0, -2.0, 4.0))]), leaves_cost([time(Measured(-9.0, -12.0, -6.0))])
        (False, True)
    """
    # Of all levels, which come first: of many parts one is off by chance.
    for whole in costs:
        if whole.name == "time_at_speed" and whole.after:
            left = abs(whole.after.estimate)
            return left > SURELY_LEFT * whole.floor and left > LEFT_SHARE * abs(whole.before.estimate)
    return False


@dataclass(frozen=True)
class Diagnosis:
    """The steps of one diagnosis, in their order.

    Attributes:
        explainer: Of the flights of both sides.
        settings: What is diagnosed, and how.
        source: Where the simulator's side comes from.
    """

    explainer: Explainer
    settings: Settings
    source: str

    def report(self, counts: Mapping[str, int], frame: pl.DataFrame) -> GapReport:
        """Run the steps and put the answer together.

        Args:
            counts: Of flights and rows.
            frame: Prepared descents, for the corrected simulator.
        """
        asked, compared, progress = self.settings, self.explainer.compared, self.settings.progress
        progress("weighing sets of effects")
        found = self.explainer.explanation()
        progress("asking where the gap lies")
        cells = where(compared, asked.transition_fl, asked.seed)
        p_value = min((cell.p_value for cell in cells), default=1.0)
        profile, is_gap = profile_of(compared), p_value <= compared.assumed.false_gap
        before = costs_of(compared, None, asked.seed) if is_gap else []
        small = below_rounding(compared, cells, before, profile) if is_gap else []
        verdict = found.verdict if is_gap and not small else "none"
        theta = dict(found.theta) if verdict in ("effect", "partial") else {}
        progress("putting the causes into the simulator's flights")
        left = self._left(theta)
        closure = MeasuredGap(compared, self._measured_over(), asked.seed)
        costs = costs_of(compared, left if theta else None, asked.seed)
        if verdict == "effect" and leaves_cost(costs):
            verdict = "partial"
        closed = closure.share(left) if theta else ClosedShare(None, None, None)
        causes = [cause_of(self.explainer, found, name, closed, self._takes_away(name, theta, costs)) for name in theta]
        # The one that takes most of the time away first.
        causes.sort(key=lambda cause: -abs(cause.takes_away.get("time", 0.0)))
        # Effects are put in where they were found: at the coefficients that the simulator's own flights show.
        simulator, mass_kg = replace(asked.simulator, aircraft=compared.state.aircraft), compared.state.mass_kg
        made = correction_made(simulator, frame, mass_kg, theta, asked) if theta else {}
        floor, after = closure.floor(left), closure.after(left)
        hidden = not_identifiable(asked, self.source)
        unexplained = verdict in ("unknown", "partial")
        return GapReport(
            verdict=verdict,
            p_value=p_value,
            floor=floor,
            gap_before=closure.before,
            where=cells,
            causes=causes,
            gap_after=after,
            remaining=remaining_of(compared, left, after - floor, found.named.unknown),
            would_split=hidden if verdict == "none" else would_split(compared, asked.catalogue, causes),
            dropped=dict(counts),
            details=Details(
                simulator=asked.simulator.name,
                regime="anchored",
                typecode=asked.simulator.aircraft.typecode,
                normal_from=self.source,
                seed=asked.seed,
                quantities=list(compared.quantities()),
                transition_fl=asked.transition_fl,
                mass_kg=mass_kg,
                n_permutations=PERMUTATIONS,
                discrepancy=discrepancy_of(self.explainer, found),
                singles=singles_of(self.explainer),
                curves=curves(compared, left),
                labels={name: effect.text for name, effect in asked.catalogue.items()},
                subsets=heaviest_sets(found),
                detection_limits=detection_limits(self.explainer),
                profile=profile,
                measured_over=closure.entries(),
                gap_error=closure.error,
                lacks=list(found.lacks),
            ),
            costs=costs,
            recipe=recipe_of(causes, asked.catalogue, levels_compared(compared)),
            corrections=made,
            corrected_file=next(iter(made), ""),
            flights_worth_a_look=flights_worth_a_look(compared, left, profile) if unexplained else [],
            below_rounding=small,
        )

    def _left(self, theta: Mapping[str, Tensor]) -> Tensor:
        """Entries (n, p) once the simulator has the causes."""
        asked, compared = self.settings, self.explainer.compared
        if compared.has_reference:
            mass_kg, cleaning = compared.state.mass_kg, asked.simulator.cleaning
            return corrected_entries(compared, AddedEffects(asked.catalogue, theta, mass_kg, cleaning, asked.seed))
        # Nominal descents have no flights of their own: the causes are taken off the real ones.
        left = compared.y.clone()
        for name, value in theta.items():
            left = left - compared.vector(asked.catalogue[name].shift(compared.state, value))
        return left

    def _measured_over(self) -> Tensor:
        """Entries (p,) whose means surely differ, all where none does; what a simulator lacks besides is no gap."""
        known = self.explainer.known
        standing = np.abs(known.difference) / np.sqrt(known.covariance.diagonal())
        differs = torch.from_numpy(standing > SURELY)
        within = torch.nonzero(~set_apart(self.explainer.compared))[:, 0]
        chosen = torch.zeros(len(self.explainer.compared.entries), dtype=torch.bool)
        chosen[within[differs] if bool(differs.any()) else within] = True
        return chosen

    def _takes_away(self, name: str, theta: Mapping[str, Tensor], costs: list[Cost]) -> dict[str, float]:
        """By cost over all levels: how much more of the difference is left without one of the causes."""
        left = self._left({other: value for other, value in theta.items() if other != name})
        pairs = zip(costs_of(self.explainer.compared, left, self.settings.seed), costs, strict=True)
        return {
            without.name: without.after.estimate - cost.after.estimate
            for without, cost in pairs
            if (cost.low_fl, cost.high_fl) == (costs[0].low_fl, costs[0].high_fl) and without.after and cost.after
        }
