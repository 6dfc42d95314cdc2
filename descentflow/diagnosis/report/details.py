"""What figures and careful readers need besides the answer."""

from torch import Tensor

from descentflow.diagnosis.findings.costs_found import Measured
from descentflow.diagnosis.findings.findings import Curve, Discrepancy, SingleEffect
from descentflow.diagnosis.findings.gap_found import LargestDifference, Remaining
from descentflow.diagnosis.findings.selection_found import Subset
from descentflow.diagnosis.inference.likelihood import EffectsLikelihood
from descentflow.diagnosis.inference.selection import Chosen, Outside
from descentflow.diagnosis.inference.two_sides import Compared
from descentflow.diagnosis.inference.where import strongest_block
from descentflow.diagnosis.report.sizes import told_text
from descentflow.effects import UNKNOWN
from descentflow.effects.effect import NONE

BOUND = 1e-6
"""How near an estimate is to a bound that it was driven to."""
SHOWN = 10
"""Sets of effects that are written down."""


def discrepancy_of(outside: Outside) -> Discrepancy:
    """What a shift of no particular cause explains beyond the named effects.

    Example:
        >>> discrepancy_of(Outside(explained=300.0, rest=100.0, error=20.0, named=True)).share_explained
        0.75
    """
    return Discrepancy(outside.explained, outside.rest, outside.error, outside.share_explained, outside.named)


def singles_of(likelihood: EffectsLikelihood, chosen: Chosen) -> list[SingleEffect]:
    """Every effect of the catalogue alone, best first.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_likelihood
        >>> from descentflow.effects import EFFECTS
        >>> likelihood = example_likelihood(EFFECTS["temperature"], [10.0])
        >>> from descentflow.diagnosis.inference.discrepancy import discrepancy_columns
        >>> columns = discrepancy_columns(likelihood.compared)
        >>> from descentflow.diagnosis.inference.selection import select
        >>> singles_of(likelihood, select(likelihood, columns, lambda stage: None))[0].effect
        'temperature'
    """
    found = []
    for name, c in sorted(chosen.singles.items(), key=lambda item: -item[1].gain):
        parameters = likelihood.catalogue[name].parameters
        theta = {p.name: float(v) for p, v in zip(parameters, c.fit.theta[name], strict=True)}
        found.append(SingleEffect(name, c.gain, c.error, theta, _refused(likelihood, name, c.fit.theta[name])))
    return found


def _refused(likelihood: EffectsLikelihood, name: str, theta: Tensor) -> str:
    """Why parameters cannot be what the effect says; empty where they can."""
    effect = likelihood.catalogue[name]
    if effect.plausible(likelihood.compared.state, theta):
        return ""
    for p, value in zip(effect.parameters, theta.tolist(), strict=True):
        at_bound = value != 0.0 and not p.low + BOUND < value < p.high - BOUND
        if at_bound and not p.from_heterogeneity and not p.by_product:
            return f"{told_text(p, Measured(p.told(value)))} is the limit of what is possible"
    told = [
        (told_text(p, Measured(p.told(value))), abs(value) < NONE * p.scale)
        for p, value in zip(effect.parameters, theta.tolist(), strict=True)
        if value != 0.0 and not p.by_product and not p.is_spread
    ]
    # What is next to none is no reason.
    sizes = [text for text, none in told if not none] or [text for text, _ in told]
    return f"it fits best with sizes that it cannot have: {', '.join(sizes)}"


def subsets_of(chosen: Chosen) -> list[Subset]:
    """The heaviest sets of effects with their weights, ``unknown`` where a shift without a cause is beside them.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_likelihood
        >>> from descentflow.effects import EFFECTS
        >>> likelihood = example_likelihood(EFFECTS["temperature"], [10.0])
        >>> from descentflow.diagnosis.inference.discrepancy import discrepancy_columns
        >>> columns = discrepancy_columns(likelihood.compared)
        >>> from descentflow.diagnosis.inference.selection import select
        >>> subsets_of(select(likelihood, columns, lambda stage: None))[0].effects
        ['temperature']
    """
    return [Subset([*one.effects, *([UNKNOWN] if one.discrepancy else [])], one.weight) for one in chosen.sets[:SHOWN]]


def remaining_of(compared: Compared, left: Tensor, gap: float, share_unexplained: float) -> Remaining:
    """What is left once the causes are in the simulator, and where the most of it lies.

    Args:
        compared: Flights of both sides.
        left: (n, p) the same once the causes are in the simulator, or off the flights.
        gap: Left above the noise floor, in spreads.
        share_unexplained: Of what effects and a free discrepancy explain together.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_sides
        >>> from descentflow.effects import EFFECTS
        >>> sides = example_sides(EFFECTS["temperature"], [10.0])
        >>> remaining_of(sides, sides.y, 0.5, 0.0).largest.quantity
        'tas'
    """
    mean = left[compared.real].nanmean(0)
    if compared.has_reference:
        mean = mean - left[~compared.real].nanmean(0)
    standing = (mean.abs() / compared.negligible()).nan_to_num(0.0)
    most = int(standing.argmax())
    entry = compared.entries[most]
    low, high = compared.level_range(entry)
    largest = LargestDifference(entry.quantity, low, high, float(mean[most]), float(standing[most]))
    return Remaining(max(gap, 0.0), share_unexplained, largest, strongest_block(compared, left))


def curves(compared: Compared, left: Tensor) -> dict[str, Curve]:
    """Mean difference by band with its error, before and after, for the figures.

    Args:
        compared: Flights of both sides.
        left: (n, p) the same once the causes are in the simulator, or off the flights.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_sides
        >>> sides = example_sides()
        >>> curve = curves(sides, sides.y)["tas"]
        >>> curve.before == curve.after, len(curve.level_fl)
        (True, 11)
    """
    real, levels = compared.real, compared.middles_fl()

    def apart(y: Tensor) -> Tensor:
        mean = y[real].nanmean(0)
        return mean - y[~real].nanmean(0).nan_to_num(0.0) if compared.has_reference else mean

    count = 1 / real.sum().double()
    if compared.has_reference:
        count = count + 1 / (~real).sum().double()
    found: dict[str, Curve] = {}
    for quantity in compared.quantities():
        at = compared.columns(quantity)
        size: Tensor = compared.scale[at] * count.sqrt()
        bands = [compared.entries[i].band for i in at.tolist()]
        middles = [levels[b] if b >= 0 else None for b in bands]
        before, after = apart(compared.y[:, at]), apart(left[:, at])
        found[quantity] = Curve(middles, before.tolist(), after.tolist(), size.tolist())
    return found
