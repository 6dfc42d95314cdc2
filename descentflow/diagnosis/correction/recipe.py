"""The recipe for the owner of a simulator: what to enter for each cause, in physical units and by level."""

from collections.abc import Mapping, Sequence

from descentflow.diagnosis.findings.cause_found import Cause
from descentflow.diagnosis.findings.correction_found import RecipeNumber, RecipeStep
from descentflow.diagnosis.inference.two_sides import Compared
from descentflow.effects import Effect

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


def levels_compared(compared: Compared) -> tuple[float, float]:
    """Lowest and highest flight level that are compared."""
    ranges = [compared.level_range(entry) for entry in compared.entries]
    return min(low for low, _ in ranges), max(high for _, high in ranges)


def _step(cause: Cause, effect: Effect, levels_fl: tuple[float, float]) -> RecipeStep:
    ends = {size.parameter: size.value.estimate for size in cause.sizes if size.parameter in WINDOW}
    low, high = (ends.get(name, level) for name, level in zip(WINDOW, levels_fl, strict=True))
    told_only = {p.name for p in effect.parameters if p.by_product}
    entered = [size for size in cause.sizes if size.parameter not in WINDOW and size.parameter not in told_only]
    numbers = [RecipeNumber(size.parameter, size.unit, size.value, low, high) for size in entered]
    share = 1.0 if cause.share_of_flights is None else cause.share_of_flights.estimate or 1.0
    text = effect.recipe({size.parameter: size.text for size in entered}) or cause.text
    if text[:1] in ("+", "-"):
        # A difference from what the simulator has says by itself not of what it is one.
        text = f"{cause.label or cause.effect} {text}"
    place = f"FL{low:.0f} to FL{high:.0f}"
    some = "" if cause.share_of_flights is None else f", {cause.in_flights()}"
    return RecipeStep(cause.effect, f"{text}, {place}{some}", numbers, share)
