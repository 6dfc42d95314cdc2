"""Causes that both sides have: flights that are as the simulator's own were, and not as it assumes."""

from dataclasses import replace

import torch

from descentflow.diagnosis.correction.closure import Gap, GapMeasure
from descentflow.diagnosis.correction.corrected_simulator import corrected
from descentflow.diagnosis.correction.correction_made import CHECKPOINT
from descentflow.diagnosis.correction.recipe import levels_compared, recipe_of
from descentflow.diagnosis.diagnosis_settings import Settings
from descentflow.diagnosis.inference.held_out import held_out_shifts
from descentflow.diagnosis.inference.heterogeneity import together
from descentflow.diagnosis.inference.shared_effects import SharedEffects, shared_effects
from descentflow.diagnosis.inference.where import where
from descentflow.diagnosis.not_identifiable import OWN_FLIGHTS, not_identifiable
from descentflow.diagnosis.report.causes import causes_of
from descentflow.diagnosis.report.details import curves
from descentflow.diagnosis.report.gap_report import GapReport
from descentflow.measurements.quantities import Quantities


def with_shared_effects(report: GapReport, real: Quantities, settings: Settings, source: str) -> GapReport:
    """The report with causes that both sides have, where no other is named and there are such.

    Args:
        report: Against the simulator's own flights.
        real: Real flights.
        settings: What is diagnosed, and how.
        source: Where the simulator's flights come from: only a model's own may hold a cause that it does not know.

    Example:
        >>> import polars as pl
        >>> from descentflow.aircraft_types.registry import aircraft
        >>> from descentflow.diagnosis.diagnose import diagnose
        >>> from descentflow.diagnosis.simulator import Simulator
        >>> from descentflow.effects import EFFECTS
        >>> from descentflow.measurements.quantities import CHANNELS, quantities_of
        >>> frame = pl.read_parquet("descents.parquet")
        >>> flights = quantities_of(frame.with_columns(TAS=frame["TAS"] * 1.02), 150, 340, CHANNELS)
        >>> asked = Settings(Simulator(aircraft("A320")), {"temperature": EFFECTS["temperature"]}, CHANNELS, 0, str)
        >>> alike = diagnose("descents.parquet", "best.ckpt")
        >>> found = with_shared_effects(alike, flights, asked, "training flights")
        >>> alike.verdict, found.causes[0].effect  # the air of both sides is warmer
        ('none', 'temperature')
    """
    if source not in OWN_FLIGHTS:
        return report
    # A gap that is faint and of no shape leaves room for a cause that both sides have.
    faint = report.verdict == "unknown" and not report.details.discrepancy.named
    if not (faint or report.verdict == "none"):
        return report
    found = shared_effects(real, settings.simulator.aircraft, settings.catalogue, settings.seed, settings.progress)
    return report if found is None else _refit_report(report, found, settings)


def _refit_report(report: GapReport, found: SharedEffects, settings: Settings) -> GapReport:
    """The report of flights that are as the simulator's own were, and not as it assumes.

    Args:
        report: Against the simulator's own flights, where no cause is named.
        found: Effects that both sides have.
        settings: What is diagnosed, and how.
    """
    likelihood, fit = found.likelihood, found.chosen.fit
    compared = likelihood.compared
    cells, affected = where(compared, settings.transition_fl, settings.seed)
    entries = affected if bool(affected.any()) else torch.ones_like(affected)
    measure = GapMeasure(likelihood, entries, settings.seed)
    shifts, spreads = held_out_shifts(likelihood, fit)
    gap: Gap = measure.gap(together(shifts, likelihood))
    causes = causes_of(likelihood, found.chosen, measure, shifts, spreads, settings.progress, inherited=True)
    write = corrected(
        settings.simulator, report.details.mass_kg, settings.catalogue, fit.theta, spreads=spreads, inherited=True
    )
    return replace(
        report,
        verdict="effect",
        p_value=found.p_value,
        global_p=found.p_value,
        where=cells,
        floor=gap.floor,
        gap_before=gap.before,
        gap_after=gap.after,
        causes=causes,
        # The gap of this report is another one, of what both sides have.
        details=replace(
            report.details,
            regime="refit",
            curves=curves(compared, compared.y - fit.shift),
            measured_over=[],
            gap_error=None,
        ),
        write_corrected=write,
        corrected_file="" if write is None else CHECKPOINT,
        recipe=recipe_of(causes, settings.catalogue, levels_compared(compared)),
        would_split=not_identifiable(settings, "training flights"),
    )
