"""Shares of sets with their intervals."""

from collections.abc import Sequence
from typing import Any

from scipy import stats


def share(flags: Sequence[bool]) -> dict[str, Any]:
    """Share of true flags with its 95 % interval (Wilson); None where there is no flag.

    Example:
        >>> share([True, True, True, False])
        {'n': 4, 'share': 0.75, 'low': 0.30..., 'high': 0.95...}
    """
    if not flags:
        return {"n": 0, "share": None, "low": None, "high": None}
    interval = stats.binomtest(sum(flags), len(flags)).proportion_ci(0.95, "wilson")
    return {"n": len(flags), "share": sum(flags) / len(flags), "low": float(interval.low), "high": float(interval.high)}
