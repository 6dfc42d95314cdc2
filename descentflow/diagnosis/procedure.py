"""The diagnosis itself: from flights and a simulator to a report."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial

import polars as pl
import torch
from torch import Tensor

from descentflow.core.freed_memory import give_back
from descentflow.core.threads import one_thread
from descentflow.diagnosis.causes_of_both_sides import with_shared_effects
from descentflow.diagnosis.correction.closure import GapMeasure
from descentflow.diagnosis.correction.correction_made import CorrectionMade, correction_made
from descentflow.diagnosis.correction.costs import costs_of, profile_of
from descentflow.diagnosis.correction.measured_gap import measured_gap
from descentflow.diagnosis.correction.previous_round import held_against
from descentflow.diagnosis.correction.recipe import levels_compared, recipe_of
from descentflow.diagnosis.diagnosis_settings import Settings
from descentflow.diagnosis.evidence_procedure import EvidenceDiagnosis
from descentflow.diagnosis.findings.findings import SIGNIFICANT, Details, NullTest, Verdict
from descentflow.diagnosis.findings.gap_found import BelowRounding, GapCell
from descentflow.diagnosis.findings.selection_found import DetectionLimit
from descentflow.diagnosis.inference.blind_whitening import blind_whitening
from descentflow.diagnosis.inference.detection_limit import detection_limits
from descentflow.diagnosis.inference.discrepancy import discrepancy_columns
from descentflow.diagnosis.inference.held_out import HeldOut, held_out_shifts
from descentflow.diagnosis.inference.heterogeneity import together
from descentflow.diagnosis.inference.inclusion import NAMED
from descentflow.diagnosis.inference.left_over import LeftOver, least_left
from descentflow.diagnosis.inference.likelihood import EffectsLikelihood, Fit
from descentflow.diagnosis.inference.naming_rule import least_shifts, named_alone
from descentflow.diagnosis.inference.permutation import null_test
from descentflow.diagnosis.inference.search import parameters_of_part
from descentflow.diagnosis.inference.selection import Chosen
from descentflow.diagnosis.inference.spread_learnt import SpreadLearnt, select_by_either
from descentflow.diagnosis.inference.two_sides import Compared, compare
from descentflow.diagnosis.inference.where import FALSE_CELLS, where
from descentflow.diagnosis.left_out_channels import left_out_channels
from descentflow.diagnosis.not_identifiable import not_identifiable
from descentflow.diagnosis.practical_size import below_rounding, rounding_of
from descentflow.diagnosis.reference_flights import both_sides
from descentflow.diagnosis.report.causes import causes_of, would_split
from descentflow.diagnosis.report.details import curves, discrepancy_of, remaining_of, singles_of, subsets_of
from descentflow.diagnosis.report.gap_report import GapReport
from descentflow.diagnosis.report.odd_flights import flights_worth_a_look
from descentflow.diagnosis.stages import stages_of
from descentflow.measurements.quantity_registry import QUANTITIES

LEAST_CLOSED = 0.5
"""Share of the gap from which what is named is its cause: else more is left than is explained."""
SAMPLES_SLACK = 5.0
"""How much larger negligible shifts are against samples: they miss what components and energy share leave out, up to a
percent of the rate about the transition."""


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
    # Of thousands of small steps a seventh is what torch keeps for derivatives, of which none are taken.
    with one_thread(), torch.inference_mode():
        return _run(frame, settings, dropped)


def _run(frame: pl.DataFrame, settings: Settings, dropped: Mapping[str, int]) -> GapReport:
    simulator = settings.simulator
    give_back()
    settings.progress("measuring flights")
    sides = both_sides(simulator, frame, settings.channels, settings.seed)
    real, source = sides.real, sides.source
    compared = compare(sides.reference, real, simulator.aircraft, SAMPLES_SLACK if source == "samples" else 1.0)
    counts = {
        "flights_given": frame["flight_id"].n_unique(),
        "flights_off_the_grid": frame["flight_id"].n_unique() - len(real),
        "flights_compared": len(real),
        "simulator_flights": 0 if sides.reference is None else len(sides.reference),
        **dropped,
    }
    engine = EvidenceDiagnosis if settings.by_evidence else Diagnosis
    report = engine(compared, settings, source).report(counts, frame)
    report = replace(report, left_out_channels=left_out_channels(sides.lacked, settings.catalogue))
    report = with_shared_effects(report, real, settings, source)
    if settings.previous is None:
        return report
    settings.progress("holding it against the round before")
    before = held_against(settings.previous, settings.previous_name, compared, report, settings.seed)
    return replace(report, previous=before)


class Diagnosis:
    """The steps of one diagnosis, in their order.

    Example:
        >>> from descentflow.aircraft_types.registry import aircraft
        >>> from descentflow.diagnosis.inference.example_sides import EFFECTS, example_sides
        >>> from descentflow.diagnosis.simulator import Simulator
        >>> asked = Settings(Simulator(aircraft("A320")), EFFECTS, [], 0, str)
        >>> sides = example_sides(EFFECTS["mass"], [0.2])
        >>> Diagnosis(sides, asked, "training flights").report({}, pl.DataFrame()).verdict
        'effect'
    """

    def __init__(self, compared: Compared, settings: Settings, source: str) -> None:
        """Prepare the likelihood of effects.

        Args:
            compared: Flights of both sides.
            settings: What is diagnosed, and how.
            source: Where the simulator's side comes from.
        """
        self.compared, self.settings, self.source = compared, settings, source
        settings.progress("estimating the spread between flights")
        self.discrepancy = discrepancy_columns(compared)
        self.learnt = SpreadLearnt.of(compared, settings.catalogue, settings.seed)
        self._of_last: tuple[Fit, HeldOut] | None = None

    @property
    def likelihood(self) -> EffectsLikelihood:
        """Of the flights as they are."""
        return self.learnt.likelihood

    def report(self, counts: Mapping[str, int], frame: pl.DataFrame) -> GapReport:
        """Run the steps and put the answer together.

        Args:
            counts: Of flights and rows.
            frame: Prepared descents, for the stages.
        """
        settings, progress = self.settings, self.settings.progress
        progress("asking whether there is a gap")
        test = self._null_test(self.likelihood)
        self.learnt, chosen = select_by_either(self.learnt, self.discrepancy, settings.seed, progress)
        # What a search keeps is made again where it is asked for; it leaves much between what is kept of it.
        for searched in (self.learnt.likelihood, self.learnt.searched):
            searched.forget()
        give_back()
        progress("asking where it lies")
        likelihood = self.likelihood
        cells, affected = where(self.compared, settings.transition_fl, settings.seed)
        verdict = self.verdict(test.p_value, chosen, cells)
        if verdict == "effect" and self._leaves_most(chosen.fit, affected):
            verdict = self._without_all(chosen)
        small = [] if verdict == "none" else self._below_rounding(cells)
        if small:
            verdict = "none"
        if verdict == "partial" and chosen.beside is not None:
            # What is left must not pull what is known.
            chosen = replace(chosen, fit=chosen.beside)
        is_named = verdict in ("effect", "partial")
        fit = chosen.fit if is_named else chosen.null
        # Of no gap, entries that stand out by chance would make one.
        affected = self._measured_over(affected & (verdict != "none"), fit.effects)
        give_back()
        progress("measuring how far the gap shrinks")
        measure = GapMeasure(likelihood, affected, settings.seed)
        shifts, spreads = self._held_out(fit)
        shift = together(shifts, likelihood)
        gap = measure.gap(shift)
        made = self._made(frame, fit, spreads) if is_named else CorrectionMade()
        causes = causes_of(likelihood, chosen, measure, shifts, spreads, progress) if is_named else []
        progress("asking at which stage the simulator loses most")
        stages = stages_of(settings.simulator, frame, settings.seed)
        details = self._details(chosen, test, fit.shift, counts)
        details = self._measured(details, affected, shift if causes else None)
        scores = made.scoring.rows([call() for call in made.scoring.calls])
        hidden = not_identifiable(settings, self.source)
        likelihood.forget()
        give_back()
        return GapReport(
            verdict=verdict,
            p_value=test.p_value,
            global_p=test.p_value,
            floor=gap.floor,
            gap_before=gap.before,
            where=cells,
            stages=stages,
            causes=causes,
            gap_after=gap.after,
            remaining=remaining_of(
                self.compared,
                self.compared.y - fit.shift,
                gap.after - gap.floor,
                1.0 - chosen.outside.share_explained,
            ),
            would_split=hidden
            if verdict == "none"
            else would_split(self.compared, settings.catalogue, causes, chosen.undecided),
            dropped=dict(counts),
            details=details,
            costs=costs_of(self.compared, self.compared.y - shift if causes else None, settings.seed),
            recipe=recipe_of(causes, settings.catalogue, levels_compared(self.compared)),
            scores=scores,
            write_corrected=made.write,
            corrected_file=made.file_name,
            flights_worth_a_look=flights_worth_a_look(likelihood, shift, profile_of(self.compared))
            if verdict in ("unknown", "partial")
            else [],
            write_flights=made.write_flights,
            below_rounding=small,
        )

    def _below_rounding(self, cells: Sequence[GapCell]) -> list[BelowRounding]:
        """The gap by quantity, if it is less than the rounding of one report throughout."""
        c = self.compared
        return below_rounding(c, cells, costs_of(c, None, self.settings.seed), profile_of(c))

    def _measured(self, details: Details, affected: Tensor, shift: Tensor | None) -> Details:
        """With what the gap was measured over, for the next round: of flights, apart from the noise of reports."""
        of_flights = affected & ~self._noise()
        apart = bool((affected & self._noise()).any()) and bool(of_flights.any())
        found = measured_gap(self.compared, of_flights if apart else affected, self.settings.seed)
        details = replace(details, measured_over=found.entries, gap_error=found.error)
        if shift is None or not apart:
            return details
        closure = GapMeasure(self.likelihood, of_flights, self.settings.seed).marginal(shift)
        return replace(details, closure_of_flights=closure)

    def _noise(self) -> Tensor:
        """Entries (p,) that are noise of reports."""
        return torch.tensor([QUANTITIES[e.quantity].is_noise for e in self.compared.entries])

    def _made(self, frame: pl.DataFrame, fit: Fit, spreads: Mapping[str, float]) -> CorrectionMade:
        """The simulator with the causes in it, and its scores."""
        self.settings.progress("putting the causes into the simulator's flights")
        asked = self.settings
        # Effects are put in where they were found: at the coefficients that the simulator's own flights show.
        simulator = replace(asked.simulator, aircraft=self.compared.state.aircraft)
        of_part = partial(parameters_of_part, self.likelihood, fit)
        return correction_made(simulator, frame, self.compared, fit.theta, of_part, asked, spreads)

    def _null_test(self, likelihood: EffectsLikelihood) -> NullTest:
        """Whether there is a gap at all, under a covariance that does not know the sides."""
        c, settings = self.compared, self.settings
        give_back()
        blind = blind_whitening(c, settings.seed)
        give_back()
        unsided = EffectsLikelihood(c, blind, settings.catalogue, settings.seed, likelihood)
        return null_test(unsided, self.discrepancy, settings.transition_fl, settings.seed)

    def _measured_over(self, affected: Tensor, effects: Sequence[str]) -> Tensor:
        """Entries that a gap is measured over: those affected, or all where none is.

        Short-scale noise is among them only where it is the matter, or all that there is: edges of windows and changes
        of path raise it as well, and no effect claims to undo that.
        """
        noise = self._noise()
        affected = affected if bool(affected.any()) else torch.ones_like(affected)
        is_matter = any(self.settings.catalogue[name].is_noise for name in effects)
        return affected if is_matter or not bool((affected & ~noise).any()) else affected & ~noise

    def verdict(self, p_value: float, chosen: Chosen, cells: Sequence[GapCell]) -> Verdict:
        """Whether there is a gap, and whether the named causes are all, a part, or none of it.

        Args:
            p_value: Of the null test.
            chosen: Outcome of the selection.
            cells: Quantities and levels, with a p-value each.
        """
        # Samples always differ from flights a little, however many permutations say so: it must matter too.
        idle = self.source == "samples" and not chosen.fit.effects and not chosen.outside.named
        if p_value > SIGNIFICANT or idle or _is_negligible(chosen, cells):
            return "none"
        if not chosen.fit.effects:
            return "unknown"
        if not (chosen.outside.named and self._left(chosen.fit, *chosen.alike).is_gap):
            return "effect"
        return self._without_all(chosen)

    def _without_all(self, chosen: Chosen) -> Verdict:
        """Whether what is named is a part of the cause, where it is not all of it, or none."""
        is_part = not chosen.outside.is_larger and self._left(chosen.beside or chosen.fit).confirmed
        return "partial" if is_part else "unknown"

    def _leaves_most(self, fit: Fit, affected: Tensor) -> bool:
        """Whether named effects close less than half of a gap, in aircraft that they were not fitted to."""
        measure = GapMeasure(self.likelihood, self._measured_over(affected, fit.effects), self.settings.seed)
        shift = together(self._held_out(fit)[0], self.likelihood)
        closed = measure.claimed(shift, measure.floor(shift))
        return closed is not None and closed < LEAST_CLOSED

    def _held_out(self, fit: Fit) -> HeldOut:
        """What effects shift in flights that their parameters were not learnt from; of the last fit asked for, kept."""
        if self._of_last is None or self._of_last[0] is not fit:
            self._of_last = fit, held_out_shifts(self.likelihood, fit)
        return self._of_last[1]

    def _detection_limits(self, fit: Fit) -> list[DetectionLimit]:
        """The smallest sizes that would be named: beyond the rounding of one report, as a gap must be."""
        unit = least_shifts(self.compared.negligible(), self._rounding())
        return list(detection_limits(self.likelihood, named_alone, fit, least=unit).values())

    def _rounding(self) -> Tensor:
        """What the rounding of one flight's reports leaves open of each entry; unknown, and zero, without a rate."""
        profile = profile_of(self.compared)
        none = torch.zeros(len(self.compared.entries), dtype=torch.float64)
        return rounding_of(self.compared, profile) if profile else none

    def _left(self, *fits: Fit) -> LeftOver:
        """What the named causes, or those that stand in their place, leave in physical units."""
        return least_left(self.likelihood, fits, self._rounding(), SIGNIFICANT)

    def _details(self, chosen: Chosen, test: NullTest, shift: Tensor, counts: Mapping[str, int]) -> Details:
        settings = self.settings
        return Details(
            simulator=settings.simulator.name,
            regime="anchored",
            typecode=settings.simulator.aircraft.typecode,
            normal_from=self.source,
            seed=settings.seed,
            quantities=list(self.compared.quantities()),
            transition_fl=settings.transition_fl,
            mass_kg=self.compared.state.mass_kg,
            test=test,
            discrepancy=discrepancy_of(chosen.outside),
            singles=singles_of(self.likelihood, chosen),
            curves=curves(self.compared, self.compared.y - shift),
            flights=dict(counts),
            labels={name: effect.text for name, effect in settings.catalogue.items()},
            narrow_simulator=self.learnt.narrow,
            subsets=subsets_of(chosen),
            profile=profile_of(self.compared),
            detection_limits=self._detection_limits(chosen.fit),
        )


def _is_negligible(chosen: Chosen, cells: Sequence[GapCell]) -> bool:
    """Whether what differs is less than what is negligible, of which the likelihood knows nothing and the test does.

    Then no effect and no shift without a cause is probable, and no quantity stands out at any level.
    """
    nothing = sum(one.weight for one in chosen.sets if not one.effects and not one.discrepancy)
    return nothing >= NAMED and all(cell.p_value > FALSE_CELLS for cell in cells)
