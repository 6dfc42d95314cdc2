"""Causes on both sides: real flights match those that the simulator was trained on, and both contradict its physics.

A model's inferred drag and speeds take in whatever explains the rates and speeds of its training flights. What they
cannot take in: airspeeds that disagree with the standard atmosphere, wind between airspeed and groundspeed, IAS against
Mach number, and a reported rate against altitude over time. These are compared with what physics claims.
"""

from dataclasses import replace

import polars as pl
import torch

from descentflow.diagnosis.correction._corrected_simulator import corrected
from descentflow.diagnosis.correction.effects_in_flights import AddedEffects
from descentflow.diagnosis.diagnosis_steps import diagnose_compared
from descentflow.diagnosis.findings.cause_found import Cause
from descentflow.diagnosis.findings.findings import Findings
from descentflow.diagnosis.gap._what_is_left import not_identifiable
from descentflow.diagnosis.sides.diagnosis_settings import Settings
from descentflow.diagnosis.sides.measured_sides import OWN_FLIGHTS
from descentflow.diagnosis.sides.simulator import Simulator
from descentflow.diagnosis.sides.two_sides import Compared, compare
from descentflow.measurements.quantities import Quantities

TAKEN_IN = ("rate", "cas")
"""Quantities that a model follows whatever made them."""


def with_shared_effects(before: Findings, real: Quantities, settings: Settings) -> Findings:
    """Findings with causes that both sides have, where no other is named and there are such.

    Args:
        before: Against a model's own flights, which may hold a cause that it does not know.
        real: Real flights.
        settings: What is diagnosed, and how.

    Example:
        >>> from descentflow.aircraft_types.registry import aircraft
        >>> from descentflow.diagnosis.diagnose import diagnose
        >>> from descentflow.diagnosis.sides.simulator import Simulator
        >>> from descentflow.effects import EFFECTS
        >>> from descentflow.measurements.quantities import CHANNELS, quantities_of
        >>> import descentflow as df
        >>> warm = df.prepare(df.simulate("A320", 120, seed=1, plant={"temperature": {"deviation_k": 10.0}}))
        >>> flights = quantities_of(warm.frame, 150, 340, CHANNELS)
        >>> asked = Settings(Simulator(aircraft("A320")), {"temperature": EFFECTS["temperature"]}, CHANNELS, 0, str)
        >>> alike = diagnose("descents.parquet", "best.ckpt", catalogue=asked.catalogue)
        >>> findings = with_shared_effects(alike, flights, asked)
        >>> alike.verdict, findings.causes[0].effect  # the air of both sides is warmer
        ('none', 'temperature')
    """
    # A gap that is faint and of no shape leaves room for a cause that both sides have.
    faint = before.verdict == "unknown" and not before.details.discrepancy.named
    if not (faint or before.verdict == "none"):
        return before
    settings.progress("looking for causes that the simulator's own flights have as well")
    able = {name: effect for name, effect in settings.catalogue.items() if effect.inherited_from is not None}
    compared = _kinematic(compare(None, real, settings.simulator.aircraft))
    if not able or not compared.entries:
        return before
    physical = replace(settings, simulator=Simulator(settings.simulator.aircraft), catalogue=able)
    shared = diagnose_compared(compared, physical, "physics", {}, pl.DataFrame())
    if shared.verdict != "effect" or not all(_is_large(cause, settings) for cause in shared.causes):
        return before
    return _refit(before, shared, settings)


def _kinematic(compared: Compared) -> Compared:
    kept = [i for i, entry in enumerate(compared.entries) if entry.quantity not in TAKEN_IN]
    return compared.only(torch.tensor(kept, dtype=torch.long))


def _is_large(cause: Cause, settings: Settings) -> bool:
    """Test for a cause of the size from which it shows against physics alone."""
    least = settings.catalogue[cause.effect].inherited_from
    size = next(iter(cause.parameters.values())).estimate
    return least is not None and abs(size) >= least


def _refit(before: Findings, after: Findings, settings: Settings) -> Findings:
    """Findings of flights that are as the simulator's own were, and not as it assumes."""
    theta = {
        cause.effect: torch.tensor([parameter.estimate for parameter in cause.parameters.values()], dtype=torch.float64)
        for cause in after.causes
    }
    mass_kg, cleaning = before.details.mass_kg, settings.simulator.cleaning
    added = AddedEffects(settings.catalogue, theta, mass_kg, cleaning, settings.seed)
    made = corrected(settings.simulator, added, inherited=True)
    return replace(
        before,
        verdict=after.verdict,
        p_value=after.p_value,
        where=after.where,
        floor=after.floor,
        gap_before=after.gap_before,
        gap_after=after.gap_after,
        causes=[replace(cause, inherited=True) for cause in after.causes],
        # The gap is now another one, of what both sides have: a model refitted to such flights has it too.
        details=replace(before.details, regime="refit", curves=after.details.curves, measured_over=[], gap_error=None),
        corrections=made,
        corrected_file=next(iter(made), ""),
        recipe=after.recipe,
        would_split=not_identifiable(settings, OWN_FLIGHTS),
    )
