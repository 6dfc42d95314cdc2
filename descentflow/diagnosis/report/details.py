"""Details for figures and careful readers besides the answer."""

from torch import Tensor

from descentflow.diagnosis.findings.findings import Curve
from descentflow.diagnosis.findings.gap_found import LargestDifference, Remaining
from descentflow.diagnosis.inference.two_sides import Compared
from descentflow.diagnosis.inference.where import strongest_block

SHOWN = 10
"""Sets of effects that are written down."""


def remaining_of(compared: Compared, left: Tensor, gap: float, share_unexplained: float) -> Remaining:
    """Gap that is left once the causes are in the simulator, and its largest part.

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
