"""The diagnosis: from flights of both sides to a report, measured on the corrected simulator."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import polars as pl
import torch
from torch import Tensor

from descentflow.core.threads import one_thread
from descentflow.diagnosis.correction.corrected_descents import CorrectionMade, correction_made
from descentflow.diagnosis.correction.corrected_sides import corrected_entries
from descentflow.diagnosis.correction.costs import costs_of, profile_of
from descentflow.diagnosis.correction.effects_in_flights import Correction
from descentflow.diagnosis.correction.measured_gap import MeasuredGap
from descentflow.diagnosis.correction.recipe import levels_compared, recipe_of
from descentflow.diagnosis.diagnosis_settings import Settings
from descentflow.diagnosis.findings.cause_found import Alternative, Cause, ClosedShare, Closure
from descentflow.diagnosis.findings.costs_found import Cost
from descentflow.diagnosis.findings.findings import Details, Discrepancy, SingleEffect, Verdict
from descentflow.diagnosis.findings.gap_found import BelowRounding, GapCell
from descentflow.diagnosis.findings.selection_found import Subset
from descentflow.diagnosis.inference.explain import Explainer, Explanation, detection_limits
from descentflow.diagnosis.inference.naming import set_apart
from descentflow.diagnosis.inference.sets import SetFit
from descentflow.diagnosis.inference.two_sides import Compared, compare
from descentflow.diagnosis.inference.where import PERMUTATIONS, where
from descentflow.diagnosis.practical_size import below_rounding
from descentflow.diagnosis.reference_flights import both_sides
from descentflow.diagnosis.report.gap_report import GapReport
from descentflow.diagnosis.report.sizes import on_both_sides, parameters, share_of, sizes_of, told_of_both
from descentflow.diagnosis.report.what_is_left import (
    OWN_FLIGHTS,
    curves,
    flights_worth_a_look,
    left_out_channels,
    not_identifiable,
    remaining_of,
    would_split,
)
from descentflow.effects import UNKNOWN

SHOWN_SETS = 10
"""Sets of effects that are written down."""
SURELY = 3.0
"""Standard errors from which a mean counts among those that a gap is measured over."""


def run(frame: pl.DataFrame, settings: Settings, dropped: Mapping[str, int]) -> GapReport:
    """Diagnose.

    Args:
        frame: Prepared descents.
        settings: What is diagnosed, and how.
        dropped: Rows that preparation left out, by reason.

    Raises:
        DataError: If too few flights show levels of the simulator's grid.

    Example:
        >>> from descentflow.aircraft_types.registry import aircraft
        >>> from descentflow.diagnosis.simulator import Simulator
        >>> from descentflow.effects import EFFECTS
        >>> frame = pl.read_parquet("descents.parquet")
        >>> asked = Settings(Simulator(aircraft("A320")), {"mass": EFFECTS["mass"]}, ["IAS", "vertical_rate"], 0, str)
        >>> run(frame, asked, {}).verdict
        'effect'
    """
    # Thousands of small steps: derivatives are not taken, and threads would wait for each other.
    with one_thread(), torch.inference_mode():
        return _run(frame, settings, dropped)


def _run(frame: pl.DataFrame, settings: Settings, dropped: Mapping[str, int]) -> GapReport:
    simulator = settings.simulator
    settings.progress("measuring flights")
    sides = both_sides(simulator, frame, settings.channels)
    real, source = sides.real, sides.source
    compared = compare(sides.reference, real, simulator.aircraft)
    counts = {
        "flights_given": frame["flight_id"].n_unique(),
        "flights_off_the_grid": frame["flight_id"].n_unique() - len(real),
        "flights_compared": len(real),
        "simulator_flights": 0 if sides.reference is None else len(sides.reference),
        **dropped,
    }
    report = Diagnosis(compared, settings, source).report(counts, frame)
    report = replace(report, left_out_channels=left_out_channels(sides.lacked, settings.catalogue))
    if source == OWN_FLIGHTS:
        # Here and not above: a comparison of flights with flights must not pay for models.
        from descentflow.diagnosis.causes_of_both_sides import with_shared_effects

        report = with_shared_effects(report, real, settings, against_physics)
    if settings.previous is None:
        return report

    from descentflow.diagnosis.correction.previous_round import held_against

    settings.progress("holding it against the round before")
    before = held_against(settings.previous, settings.previous_name, compared, settings.seed)
    return replace(report, previous=before)


def against_physics(compared: Compared, settings: Settings) -> GapReport:
    """Diagnose flights that are compared with what physics claims.

    Example:
        >>> from descentflow.aircraft_types.registry import aircraft
        >>> from descentflow.diagnosis.inference.example_sides import example_sides
        >>> from descentflow.effects import EFFECTS
        >>> from descentflow.diagnosis.simulator import Simulator
        >>> asked = Settings(Simulator(aircraft("A320")), EFFECTS, [], 0, str)
        >>> against_physics(example_sides(EFFECTS["temperature"], [10.0]), asked).verdict
        'effect'
    """
    return Diagnosis(compared, settings, "physics").report({}, pl.DataFrame())


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
    whole = next((cost for cost in costs if cost.name == "time_at_speed" and cost.after is not None), None)
    if whole is None or whole.after is None:
        return False
    left = abs(whole.after.estimate)
    return left > SURELY_LEFT * whole.floor and left > LEFT_SHARE * abs(whole.before.estimate)


class Diagnosis:
    """The steps of one diagnosis, in their order.

    Example:
        >>> from descentflow.aircraft_types.registry import aircraft
        >>> from descentflow.diagnosis.inference.example_sides import example_sides
        >>> from descentflow.effects import EFFECTS
        >>> from descentflow.diagnosis.simulator import Simulator
        >>> asked = Settings(Simulator(aircraft("A320")), EFFECTS, [], 0, str)
        >>> sides = example_sides(EFFECTS["temperature"], [10.0])
        >>> Diagnosis(sides, asked, "training flights").report({}, pl.DataFrame()).causes[0].effect
        'temperature'
    """

    def __init__(self, compared: Compared, settings: Settings, source: str) -> None:
        """Take the flights.

        Args:
            compared: Flights of both sides.
            settings: What is diagnosed, and how.
            source: Where the simulator's side comes from.
        """
        self.compared, self.settings, self.source = compared, settings, source
        settings.progress("measuring means and shapes of flights")
        self.explainer = Explainer(compared, settings.catalogue)

    def report(self, counts: Mapping[str, int], frame: pl.DataFrame) -> GapReport:
        """Run the steps and put the answer together.

        Args:
            counts: Of flights and rows.
            frame: Prepared descents, for the corrected simulator.
        """
        asked, compared, progress = self.settings, self.compared, self.settings.progress
        progress("weighing sets of effects")
        found = self.explainer.explanation()
        progress("asking where the gap lies")
        cells, _ = where(compared, asked.transition_fl, asked.seed)
        p_value = min((cell.p_value for cell in cells), default=1.0)
        verdict, small = self._verdict(found, cells, p_value)
        theta = dict(found.theta) if verdict in ("effect", "partial") else {}
        progress("putting the causes into the simulator's flights")
        left = self._left(theta)
        entries = self._measured_over()
        closure = MeasuredGap(compared, entries, asked.seed)
        costs = costs_of(compared, left if theta else None, asked.seed)
        if verdict == "effect" and leaves_cost(costs):
            verdict = "partial"
        closed = closure.share(left) if theta else ClosedShare(None, None, None)
        causes = self._causes(found, theta, closed, costs)
        made = self._made(theta, frame)
        floor, after = closure.floor(left), closure.after(left)
        hidden = not_identifiable(asked, self.source)
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
            details=self._details(found, left, closure),
            costs=costs,
            recipe=recipe_of(causes, asked.catalogue, levels_compared(compared)),
            write_corrected=made.write,
            corrected_file=made.file_name,
            write_flights=made.write_flights,
            flights_worth_a_look=flights_worth_a_look(compared, left, profile_of(compared))
            if verdict in ("unknown", "partial")
            else [],
            below_rounding=small,
        )

    def _verdict(self, found: Explanation, cells: list[GapCell], p_value: float) -> tuple[Verdict, list[BelowRounding]]:
        """Verdict by the weights, unless chance or the rounding of one report explains it."""
        compared = self.compared
        if p_value > compared.assumed.false_gap:
            return "none", []
        small = below_rounding(compared, cells, costs_of(compared, None, self.settings.seed), profile_of(compared))
        return ("none" if small else found.verdict), small

    def _left(self, theta: Mapping[str, Tensor]) -> Tensor:
        """Entries (n, p) once the simulator has the causes."""
        if not self.compared.has_reference:
            # Nominal descents have no flights of their own: the causes are taken off the real ones.
            left = self.compared.y.clone()
            for name, value in theta.items():
                left = left - self.compared.vector(self.settings.catalogue[name].shift(self.compared.state, value))
            return left
        return corrected_entries(self.compared, self._correction(theta))

    def _correction(self, theta: Mapping[str, Tensor]) -> Correction:
        asked, mass_kg = self.settings, self.compared.state.mass_kg
        return Correction(asked.catalogue, theta, mass_kg, asked.simulator.cleaning, asked.seed)

    def _measured_over(self) -> Tensor:
        """Entries (p,) whose means surely differ, all where none does; what a simulator lacks besides is no gap."""
        known = self.explainer.known
        standing = np.abs(known.difference) / np.sqrt(known.covariance.diagonal())
        differs = torch.from_numpy(standing > SURELY)
        within = torch.nonzero(~set_apart(self.compared))[:, 0]
        chosen = torch.zeros(len(self.compared.entries), dtype=torch.bool)
        chosen[within[differs] if bool(differs.any()) else within] = True
        return chosen

    def _causes(
        self, found: Explanation, theta: Mapping[str, Tensor], closed: ClosedShare, costs: list[Cost]
    ) -> list[Cause]:
        """Every cause, the one that takes most of the time away first."""
        causes = [
            replace(self._cause(found, name), closure=Closure(closed), takes_away=self._takes_away(name, theta, costs))
            for name in theta
        ]
        return sorted(causes, key=lambda cause: -abs(cause.takes_away.get("time", 0.0)))

    def _takes_away(self, name: str, theta: Mapping[str, Tensor], costs: list[Cost]) -> dict[str, float]:
        """By cost over all levels: how much more of the difference is left without one of the causes."""
        left = self._left({other: value for other, value in theta.items() if other != name})
        pairs = zip(costs_of(self.compared, left, self.settings.seed), costs, strict=True)
        return {
            without.name: without.after.estimate - cost.after.estimate
            for without, cost in pairs
            if (cost.low_fl, cost.high_fl) == (costs[0].low_fl, costs[0].high_fl)
            and without.after is not None
            and cost.after is not None
        }

    def _alternative(self, found: Explanation, name: str, member: str) -> Alternative:
        """An effect of a cause's group in its place, beside the other causes."""
        fits, effect = self.explainer.search.fits, self.settings.catalogue[member]
        names = tuple(member if other == name else other for other in found.best.names)
        fit, candidate = fits.fit(names, found.best.unknown, found.best.sizes), fits.candidates[member]
        known = (effect, candidate.theta(fit.sizes[member]), candidate.theta_errors(fit.errors[member]))
        flights = int(self.compared.real.sum())
        sizes = told_of_both(effect, sizes_of(*known, flights), on_both_sides(self.compared, effect))
        return Alternative(member, found.named.probability[member], sizes, share_of(*known, flights))

    def _cause(self, found: Explanation, name: str) -> Cause:
        """A cause with its sizes and alternatives, still without what it closes and takes away."""
        effect, value, error = self.settings.catalogue[name], found.theta[name], found.errors[name]
        flights = int(self.compared.real.sum())
        sizes = parameters(effect, value, error, flights)
        first = next(iter(sizes.values()), None)
        both = on_both_sides(self.compared, effect)
        group = found.named.groups[name]
        inclusion = sum(
            weight
            for weight, one in zip(found.named.weights.tolist(), found.sets, strict=True)
            if {name, *group} & set(one.names)
        )
        return Cause(
            effect=name,
            group=list(group),
            probability=found.named.probability[name],
            parameters=sizes,
            evidence_nats=self._gain(found.best, name),
            closure=Closure(ClosedShare(None, None, None)),
            label=effect.text,
            text=effect.in_words(None if first is None else first.estimate, has_some=both.has_some),
            inclusion=inclusion,
            share_of_flights=share_of(effect, value, error, flights),
            sizes=told_of_both(effect, sizes_of(effect, value, error, flights), both),
            on_both_sides=both.measured,
            alternatives=[self._alternative(found, name, member) for member in group],
        )

    def _gain(self, best: SetFit, name: str) -> float:
        """Nats that a set gains by one of its effects."""
        without = tuple(other for other in best.names if other != name)
        return best.log_weight - self.explainer.search.fits.fit(without, best.unknown, best.sizes).log_weight

    def _made(self, theta: Mapping[str, Tensor], frame: pl.DataFrame) -> CorrectionMade:
        """The simulator with the causes in it."""
        if not theta:
            return CorrectionMade()
        asked = self.settings
        # Effects are put in where they were found: at the coefficients that the simulator's own flights show.
        simulator = replace(asked.simulator, aircraft=self.compared.state.aircraft)
        return correction_made(simulator, frame, self.compared.state.mass_kg, theta, asked)

    def _details(self, found: Explanation, left: Tensor, closure: MeasuredGap) -> Details:
        asked, compared = self.settings, self.compared
        weights = zip(found.sets, found.named.weights.tolist(), strict=True)
        return Details(
            simulator=asked.simulator.name,
            regime="anchored",
            typecode=asked.simulator.aircraft.typecode,
            normal_from=self.source,
            seed=asked.seed,
            quantities=list(compared.quantities()),
            transition_fl=asked.transition_fl,
            mass_kg=compared.state.mass_kg,
            n_permutations=PERMUTATIONS,
            discrepancy=self._discrepancy(found),
            singles=self._singles(found),
            curves=curves(compared, left),
            labels={name: effect.text for name, effect in asked.catalogue.items()},
            subsets=[Subset([*one.names, *[UNKNOWN] * one.has_unknown], w) for one, w in weights][:SHOWN_SETS],
            profile=profile_of(compared),
            detection_limits=detection_limits(self.explainer),
            measured_over=closure.entries(),
            gap_error=closure.error,
            lacks=list(found.lacks),
        )

    def _discrepancy(self, found: Explanation) -> Discrepancy:
        """Evidence (nats) of an unknown cause beyond the named effects."""
        fits, best = self.explainer.search.fits, found.best
        alone = fits.fit(best.names, None, best.sizes)
        explained = alone.log_weight - fits.fit(()).log_weight
        rest = max((one.log_weight for one in found.sets if one.names == best.names and one.has_unknown), default=None)
        gained = 0.0 if rest is None else max(rest - alone.log_weight, 0.0)
        return Discrepancy(explained, gained, found.named.unknown)

    def _singles(self, found: Explanation) -> list[SingleEffect]:
        """Every effect alone, best first."""
        fits = self.explainer.search.fits
        null, rows = fits.fit(()).log_weight, []
        for name, candidate in fits.candidates.items():
            fit = fits.fit((name,))
            theta = candidate.theta(fit.sizes[name]).tolist()
            sizes = {p.name: v for p, v in zip(self.settings.catalogue[name].parameters, theta, strict=True)}
            refused = "" if candidate.plausible(fit.sizes[name]) else "it fits best with sizes that it cannot have"
            rows.append(SingleEffect(name, fit.log_weight - null, sizes, refused))
        return sorted(rows, key=lambda row: -row.gain_nats)
