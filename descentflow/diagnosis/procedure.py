"""The diagnosis: from flights of both sides to a report, with causes that both have and the round before."""

from collections.abc import Mapping
from dataclasses import replace

import polars as pl
import torch

from descentflow.core.threads import one_thread
from descentflow.diagnosis.diagnosis_settings import Settings
from descentflow.diagnosis.diagnosis_steps import Diagnosis
from descentflow.diagnosis.inference.explain import Explainer
from descentflow.diagnosis.inference.two_sides import compare
from descentflow.diagnosis.reference_flights import both_sides
from descentflow.diagnosis.report.gap_report import GapReport
from descentflow.diagnosis.report.what_is_left import (
    OWN_FLIGHTS,
    left_out_channels,
)


# Thousands of small steps: derivatives are not taken, and threads would wait for each other.
@one_thread()
@torch.inference_mode()
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
    settings.progress("measuring means and shapes of flights")
    report = Diagnosis(Explainer(compared, settings.catalogue), settings, source).report(counts, frame)
    report = replace(report, left_out_channels=left_out_channels(sides.lacked, settings.catalogue))
    if source == OWN_FLIGHTS:
        # Here and not above: a comparison of flights with flights must not pay for models.
        from descentflow.diagnosis.causes_of_both_sides import with_shared_effects

        report = with_shared_effects(report, real, settings)
    if settings.previous:
        from descentflow.diagnosis.correction.previous_round import held_against

        settings.progress("comparing with the round before")
        before = held_against(settings.previous, settings.previous_name, compared, settings.seed)
        report = replace(report, previous=before)
    return report
