"""The diagnosis itself: from flights and a simulator to a report."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import polars as pl
import torch
from torch import Tensor

from descentflow.core.errors import ConfigError
from descentflow.core.units import FL_M
from descentflow.diagnosis.correction.closure import Closure
from descentflow.diagnosis.correction.corrected_simulator import corrected
from descentflow.diagnosis.inference.discrepancy import discrepancy_columns
from descentflow.diagnosis.inference.heterogeneity import lawful_shift
from descentflow.diagnosis.inference.likelihood import Contest
from descentflow.diagnosis.inference.permutation import null_test
from descentflow.diagnosis.inference.selection import Chosen, select
from descentflow.diagnosis.inference.shared_effects import Inherited, inherited_causes
from descentflow.diagnosis.inference.two_sides import Compared, compare
from descentflow.diagnosis.inference.where import strongest_block, where
from descentflow.diagnosis.inference.whitening import whiten
from descentflow.diagnosis.reference_flights import both_sides
from descentflow.diagnosis.report.causes import causes_of, would_split
from descentflow.diagnosis.report.details import curves, details_of
from descentflow.diagnosis.report.gap_report import GapReport
from descentflow.diagnosis.simulator import Simulator, check_count, check_type, kept_channels
from descentflow.diagnosis.stages import stages_of
from descentflow.effects import Effect
from descentflow.measurements.quantities import checked, grid_of, measured
from descentflow.physics.transition import transition_altitude_m

SLACK = 5.0
"""Samples miss what components and energy share leave out: up to a percent of the rate about the transition."""
ENOUGH = 100
"""Flights of a simulator from which the spread between flights is learnt without the real ones."""
SIGNIFICANT = 0.02
"""A gap is called from this p-value; it leaves room below five false alarms in a hundred."""


def run(
    frame: pl.DataFrame,
    simulator: Simulator,
    channels: Sequence[str],
    catalogue: Mapping[str, Effect],
    seed: int,
    dropped: Mapping[str, int],
    say: Callable[[str], None],
) -> GapReport:
    """Diagnose.

    Args:
        frame: Prepared descents.
        simulator: What is diagnosed.
        channels: Channels to use.
        catalogue: Effects that may be named.
        seed: Of permutations, folds, bootstrap and samples.
        dropped: Rows that preparation left out, by reason.
        say: Told what is being done.

    Raises:
        DataError: If too few flights show levels of the simulator's grid.
        ConfigError: If the catalogue is empty.
    """
    if not catalogue:
        raise ConfigError("an empty catalogue", expected="at least one effect", mend="pass EFFECTS, or some of them")
    check_type(frame, simulator)
    low, high = simulator.levels(frame)
    say("measuring flights")
    grid = grid_of(frame, low, high, channels)
    check_count(checked(measured(grid)), frame, low, high)
    reference, real, source = both_sides(simulator, grid, seed)
    if reference is not None:
        reference = kept_channels(reference, real)
    compared = compare(reference, real, simulator.aircraft, SLACK if source == "samples" else 1.0)
    counts = {
        "flights_given": frame["flight_id"].n_unique(),
        "flights_off_the_grid": frame["flight_id"].n_unique() - len(real),
        "flights_compared": len(real),
        "simulator_flights": 0 if reference is None else len(reference),
        **dropped,
    }
    diagnosis = Diagnosis(compared, catalogue, simulator, source, seed, say)
    report = diagnosis.report(counts, frame)
    # A gap that is faint and of no shape leaves room for a cause that both sides have.
    faint = report.verdict == "unknown" and not report.details["discrepancy"]["named"]
    if source == "physics" or not (faint or report.verdict == "none"):
        return report
    found = inherited_causes(real, simulator.aircraft, catalogue, seed, say)
    return report if found is None else diagnosis.inherited(report, found)


class Diagnosis:
    """The steps of one diagnosis, in their order."""

    def __init__(
        self,
        compared: Compared,
        catalogue: Mapping[str, Effect],
        simulator: Simulator,
        source: str,
        seed: int,
        say: Callable[[str], None],
    ) -> None:
        """Prepare the contest."""
        self.compared, self.catalogue, self.simulator = compared, catalogue, simulator
        self.source, self.seed, self.say = source, seed, say
        say("estimating the spread between flights")
        weights = whiten(
            compared.y,
            compared.real,
            compared.cluster,
            compared.nugget(),
            compared.of_flight(),
            learn=normal_flights(compared),
        )
        self.contest = Contest(compared, weights, catalogue, seed)
        self.discrepancy, self.shapes = discrepancy_columns(compared)
        self.transition_fl = float(transition_altitude_m(simulator.aircraft)) / FL_M

    def report(self, counts: Mapping[str, int], frame: pl.DataFrame) -> GapReport:
        """Run the steps and put the answer together."""
        self.say("asking whether there is a gap")
        everyone = torch.ones_like(self.compared.real)
        c = self.compared
        blind = whiten(c.y, everyone, c.cluster, c.nugget(), c.of_flight(), c.real)
        unsided = Contest(self.compared, blind, self.catalogue, self.seed, self.contest)
        test = null_test(unsided, self.discrepancy, self.seed)
        self.say("asking where it lies")
        cells, affected = where(self.contest, self.transition_fl, self.seed)
        chosen = select(self.contest, self.discrepancy, self.say)
        verdict = self._verdict(test.p_value, chosen)
        named = chosen if verdict != "none" else None
        fit = chosen.fit if verdict == "effect" else chosen.null
        if verdict == "none" or not bool(affected.any()):
            # Entries that stand out by chance would make a gap of it.
            affected = torch.ones_like(affected)
        affected = self._without_by_products(affected, fit.effects)
        self.say("measuring how far the gap shrinks")
        closure = Closure(self.contest, affected, self.seed)
        lawful, spreads = lawful_shift(self.contest, fit)
        gap = closure.gap(lawful)
        causes = causes_of(self.contest, chosen, closure, lawful, spreads, self.say) if verdict == "effect" else []
        self.say("asking at which stage the simulator loses most")
        stages = stages_of(self.simulator, frame, self.seed)
        remaining = self._remaining(fit.shift, gap.after, gap.floor, chosen)
        details = details_of(self, chosen, test.__dict__, fit.shift, counts)
        write = corrected(self.simulator, self.compared.state.mass_kg, self.catalogue, fit.theta)
        return GapReport(
            verdict=verdict,
            p_value=test.p_value,
            floor=gap.floor,
            gap_before=gap.before,
            where=cells,
            stages=stages,
            causes=causes,
            gap_after=gap.after,
            remaining=remaining,
            would_split=self._hidden() if named is None else would_split(self.contest, named, causes),
            dropped=dict(counts),
            details=details,
            write_corrected=write if verdict == "effect" else None,
        )

    def inherited(self, report: GapReport, found: Inherited) -> GapReport:
        """The report of flights that are as the simulator's own were, and not as it assumes."""
        contest, fit = found.contest, found.chosen.fit
        cells, affected = where(contest, self.transition_fl, self.seed)
        closure = Closure(contest, affected if bool(affected.any()) else torch.ones_like(affected), self.seed)
        lawful, spreads = lawful_shift(contest, fit)
        gap = closure.gap(lawful)
        causes = causes_of(contest, found.chosen, closure, lawful, spreads, self.say)
        details = {**report.details, "regime": "refit", "curves": curves(contest, fit.shift)}
        write = corrected(self.simulator, self.compared.state.mass_kg, self.catalogue, fit.theta, inherited=True)
        return replace(
            report,
            verdict="effect",
            p_value=found.p_value,
            where=cells,
            floor=gap.floor,
            gap_before=gap.before,
            gap_after=gap.after,
            causes=[{**cause, "inherited": True} for cause in causes],
            details=details,
            write_corrected=write,
            would_split=self._hidden(),
        )

    def _hidden(self) -> list[dict[str, Any]]:
        """What no comparison with a simulator of the same flights could show."""
        if self.source == "physics":
            return []
        names = [name for name, effect in self.catalogue.items() if effect.inherited_from is None]
        why = (
            "if the simulator's own flights had them as well, its inferred drag and speeds hold them: not identifiable"
        )
        return [{"between": names, "channels": [], "why": why}]

    def _without_by_products(self, affected: Tensor, effects: Sequence[str]) -> Tensor:
        """Entries that a gap is measured over: short-scale noise only where it is the matter, or all that there is.

        Edges of windows and changes of path raise it as well, and no effect claims to undo that.
        """
        noise = torch.tensor([e.quantity.startswith("noise") for e in self.compared.entries])
        if "measurement_noise" in effects or not bool((affected & ~noise).any()):
            return affected
        return affected & ~noise

    def _verdict(self, p_value: float, chosen: Chosen) -> str:
        """``none``, ``effect`` or ``unknown``."""
        # Samples always differ from flights a little, however many permutations say so: it must matter too.
        idle = self.source == "samples" and not chosen.fit.effects and not chosen.outside.named
        if p_value > SIGNIFICANT or idle:
            return "none"
        return "unknown" if chosen.outside.named or not chosen.fit.effects else "effect"

    def _remaining(self, shift: Tensor, after: float, floor: float, chosen: Chosen) -> dict[str, Any]:
        """What is left once the causes are in the simulator, and where the most of it lies."""
        contest = self.contest
        left = self.compared.y - shift
        mean = left[contest.real].nanmean(0)
        if contest.has_reference:
            mean = mean - left[~contest.real].nanmean(0)
        standing = (mean.abs() / self.compared.negligible()).nan_to_num(0.0)
        most = int(standing.argmax())
        entry = self.compared.entries[most]
        low, high = self.compared.level_range(entry)
        return {
            "gap": max(after - floor, 0.0),
            "share_unexplained": 1.0 - chosen.outside.share_explained,
            "largest": {
                "quantity": entry.quantity,
                "level_low_fl": low,
                "level_high_fl": high,
                "difference": float(mean[most]),
                "in_negligible_shifts": float(standing[most]),
            },
            "block": strongest_block(contest, left),
        }


def normal_flights(compared: Compared) -> Tensor | None:
    """Flights that the spread is learnt from: the simulator's where they are enough, else all.

    An effect that takes some flights and leaves others would widen the spread in its own direction, and so hide itself.
    """
    known = ~compared.real
    enough = int(known.sum()) >= max(ENOUGH, compared.y.shape[1])
    return known if enough and bool(compared.free.all()) else None
