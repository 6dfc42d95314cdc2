"""The verdict of a diagnosis, decided here and nowhere else.

Two things come before it: the test by permutation and the rounding of reports say whether there is a gap, and the
evidence of sets of effects names its causes (:mod:`~descentflow.diagnosis.inference.explain`).
"""

from collections.abc import Sequence

from descentflow.diagnosis.findings.costs_found import Cost, judged
from descentflow.diagnosis.findings.findings import Verdict
from descentflow.diagnosis.inference.explain import Explanation

CERTAIN_HALF_WIDTHS = 2.58 / 1.645
"""Half widths of a 90 % interval in that of 99 %: one right answer in a hundred is called a part."""
LEAST_SHARE_LEFT = 0.1
"""Share of the difference before that an effect's equation may miss of it."""


def verdict_of(explanation: Explanation, *, is_gap: bool = True, costs: Sequence[Cost] = ()) -> Verdict:
    """No gap, or a gap of which the named causes are all, a part, or none.

    Args:
        explanation: Causes by the evidence of sets of effects.
        is_gap: Whether there is a gap by the test of permutations, larger than the rounding of reports.
        costs: Costs of the gap, before and after the causes are in the simulator.
    """
    if explanation.is_none or not is_gap:
        return "none"
    few = explanation.compared.short_of_causes > 0
    if not explanation.theta:
        # Of few flights the spread is not known well enough for an unknown cause: the time itself must differ.
        return "unknown" if not few or differs_in_time(costs) else "none"
    if not ((explanation.named.has_unknown and not few) or leaves_some(costs)):
        return "effect"
    # The air is no part of a simulator: what it leaves is unknown.
    return "unknown" if all(explanation.catalogue[name].of_air for name in explanation.theta) else "partial"


def differs_in_time(costs: Sequence[Cost]) -> bool:
    """Test for a difference of the time at equal speed over all levels, by more than chance.

    Example:
        >>> from descentflow.diagnosis.findings.costs_found import Measured
        >>> late = Cost("time_at_speed", "time", "s", 150, 350, 600, 620, Measured(20, 14, 26), None, floor=7.0)
        >>> differs_in_time([late])
        True
    """
    whole = next((cost for cost in costs if cost.name == "time_at_speed"), None)
    return whole is not None and abs(whole.before.estimate) > CERTAIN_HALF_WIDTHS * whole.floor


def leaves_some(costs: Sequence[Cost]) -> bool:
    """Test for time at equal speed and rate that the causes leave, both by more than chance and more than a tenth.

    The rate alone goes with how fast crews fly by chance, and time at equal speed alone with how the polar follows it.

    Example:
        >>> from descentflow.diagnosis.findings.costs_found import Measured
        >>> def time(after: Measured) -> Cost:
        ...     return Cost("time_at_speed", "time", "s", 150, 350, 600, 620, Measured(20, 18, 22), after, floor=3.0)
        >>> leaves_some([time(Measured(1.0, -2.0, 4.0))]), leaves_some([time(Measured(-9.0, -12.0, -6.0))])
        (False, True)
    """
    # Over all levels: of many parts one is off by chance.
    known = [(cost, abs(cost.after.estimate)) for cost in judged(costs) if cost.after]
    return bool(known) and all(
        left > max(CERTAIN_HALF_WIDTHS * cost.floor, LEAST_SHARE_LEFT * abs(cost.before.estimate))
        for cost, left in known
    )
