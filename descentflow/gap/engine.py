"""The diagnosis itself: from flights and a simulator to a report."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import polars as pl
import torch
from torch import Tensor

from descentflow.data.representation import Representation
from descentflow.errors import ConfigError, DataError
from descentflow.gap.answer import causes_of, would_split
from descentflow.gap.closure import Closure
from descentflow.gap.contest import Contest
from descentflow.gap.correct import corrected
from descentflow.gap.discrepancy import discrepancy_columns
from descentflow.gap.effects import Effect
from descentflow.gap.inherited import Inherited, inherited_causes
from descentflow.gap.layout import Compared, compare
from descentflow.gap.permutation import null_test
from descentflow.gap.quantities import Quantities, checked, grid_of, measured
from descentflow.gap.reference import both_sides
from descentflow.gap.report import GapReport
from descentflow.gap.selection import Chosen, select
from descentflow.gap.stages import stages_of
from descentflow.gap.where import middles_fl, strongest_block, where
from descentflow.gap.whitening import whiten
from descentflow.performance.aircraft import Aircraft
from descentflow.performance.transition import transition_altitude_m
from descentflow.sampling.rejection import Sampler
from descentflow.surveillance.prepare import Cleaning
from descentflow.units import FL_M

FEWEST_FLIGHTS = 20
SLACK = 5.0
"""Samples miss what components and energy share leave out: up to a percent of the rate about the transition."""
ENOUGH = 100
"""Flights of a simulator from which the spread between flights is learnt without the real ones."""
SIGNIFICANT = 0.03
"""A gap is called from this p-value; it leaves room below five false alarms in a hundred."""


@dataclass(frozen=True)
class Simulator:
    """What is diagnosed: a sampler with its representation, or nominal BADA where there is none."""

    aircraft: Aircraft
    sampler: Sampler | None = None
    representation: Representation | None = None
    content: Callable[[], dict[str, Any]] | None = None
    """Reads the checkpoint again, to write a corrected one."""
    name: str = "nominal"

    def cleaning(self) -> Cleaning:
        """How rows are prepared for it: down to its own lowest level."""
        if self.representation is None:
            return Cleaning()
        return Cleaning(bottom_fl=int(self.representation.decoder.levels_fl[0]))

    def levels(self, frame: pl.DataFrame) -> tuple[float, float]:
        """Lowest and highest level of its grid."""
        if self.representation is not None:
            levels = self.representation.decoder.levels_fl
            return float(levels[0]), float(levels[-1])
        reached = frame.group_by("flight_id").agg(pl.col("level_fl").max())["level_fl"].to_numpy()
        lowest = frame["level_fl"].to_numpy().min(initial=10_000)
        top = sorted(reached.tolist(), reverse=True)[max(len(reached) // 4 - 1, 0)] if len(reached) else lowest
        return float(lowest), float(max(top, lowest + 20))


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
    _check_type(frame, simulator)
    low, high = simulator.levels(frame)
    say("measuring flights")
    grid = grid_of(frame, low, high, channels)
    _check_count(checked(measured(grid)), frame, low, high)
    reference, real, source = both_sides(simulator, grid, seed)
    if reference is not None:
        reference = _kept_channels(reference, real)
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
    if report.verdict != "none" or source == "physics":
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
        lawful, spreads = self.contest.lawful_shift(fit)
        gap = closure.gap(lawful)
        causes = causes_of(self.contest, chosen, closure, lawful, spreads, self.say) if verdict == "effect" else []
        self.say("asking at which stage the simulator loses most")
        stages = stages_of(self.simulator, frame, self.seed)
        remaining = self._remaining(fit.shift, gap.after, gap.floor, chosen)
        details = self._details(chosen, test.__dict__, fit.shift, counts)
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
        lawful, spreads = contest.lawful_shift(fit)
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

    def _details(
        self,
        chosen: Chosen,
        test: Mapping[str, Any],
        shift: Tensor,
        counts: Mapping[str, int],
    ) -> dict[str, Any]:
        """What figures and careful readers need besides the answer."""
        contest = self.contest
        ladder = sorted(chosen.singles.items(), key=lambda item: -item[1].gain)
        return {
            "simulator": self.simulator.name,
            "regime": "anchored",
            "typecode": self.simulator.aircraft.typecode,
            "normal_from": self.source,
            "seed": self.seed,
            "quantities": list(self.compared.quantities()),
            "transition_fl": self.transition_fl,
            "mass_kg": self.compared.state.mass_kg,
            "test": dict(test),
            "discrepancy": {
                "explained_nats": chosen.outside.explained,
                "rest_nats": chosen.outside.rest,
                "rest_error_nats": chosen.outside.error,
                "share_explained": chosen.outside.share_explained,
            },
            "contest": [
                {
                    "effect": name,
                    "score_gain": c.gain,
                    "error": c.error,
                    "parameters": {
                        p.name: float(v)
                        for p, v in zip(self.catalogue[name].parameters, c.fit.theta[name], strict=True)
                    },
                }
                for name, c in ladder
            ],
            "curves": curves(contest, shift),
            "flights": dict(counts),
        }


def normal_flights(compared: Compared) -> Tensor | None:
    """Flights that the spread is learnt from: the simulator's where they are enough, else all.

    An effect that takes some flights and leaves others would widen the spread in its own direction, and so hide itself.
    """
    known = ~compared.real
    enough = int(known.sum()) >= max(ENOUGH, compared.y.shape[1])
    return known if enough and bool(compared.free.all()) else None


def curves(contest: Contest, shift: Tensor) -> dict[str, Any]:
    """Mean difference by band with its error, before and after, for the figures."""
    compared = contest.compared
    levels = middles_fl(compared)
    found: dict[str, Any] = {}
    for quantity in compared.quantities():
        at = compared.columns(quantity)
        y, left = compared.y[:, at], (compared.y - shift)[:, at]
        before, after = y[contest.real].nanmean(0), left[contest.real].nanmean(0)
        count = contest.real.sum().double()
        size = compared.scale[at] / count.sqrt()
        if contest.has_reference:
            other = y[~contest.real].nanmean(0).nan_to_num(0.0)
            before, after = before - other, after - other
            size = compared.scale[at] * (1 / count + 1 / (~contest.real).sum().double()).sqrt()
        bands = [compared.entries[i].band for i in at.tolist()]
        found[quantity] = {
            "level_fl": [levels[b] if b >= 0 else None for b in bands],
            "before": before.tolist(),
            "after": after.tolist(),
            "error": size.tolist(),
        }
    return found


def _check_type(frame: pl.DataFrame, simulator: Simulator) -> None:
    types = {str(t) for t in frame["typecode"].drop_nulls().unique()} if "typecode" in frame.columns else set()
    known = {simulator.aircraft.typecode}
    if simulator.representation is not None:
        known |= set(simulator.representation.provenance.get("typecodes", []))
    if types and not types & known:
        raise DataError(
            f"descents of {', '.join(sorted(types))} for a simulator of {', '.join(sorted(known))}",
            expected="flights of the simulator's type",
            mend="choose the flights, or a simulator of their type",
        )


def _check_count(real: Quantities, frame: pl.DataFrame, low: float, high: float) -> None:
    if len(real) < FEWEST_FLIGHTS:
        raise DataError(
            f"{len(real)} flights with levels between FL{low:.0f} and FL{high:.0f} "
            f"(of {frame['flight_id'].n_unique()} given)",
            expected=f"at least {FEWEST_FLIGHTS}, and hundreds to tell effects apart",
            mend="give more flights, or a simulator of their levels",
        )


def _kept_channels(reference: Quantities, real: Quantities) -> Quantities:
    """The simulator's flights with the quantities that the real ones show: a channel left out is left out of both."""
    names = set(real.values)
    values = {name: value for name, value in reference.values.items() if name in names}
    physics = dict(reference.physics)
    if "wind" not in names:
        physics["tailwind_mps"] = torch.zeros_like(physics["tailwind_mps"])
    return Quantities(reference.levels_fl, reference.band_fl, values, physics, reference.cluster)
