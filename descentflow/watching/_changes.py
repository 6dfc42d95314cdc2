"""Change that an alarm is about: its day with an interval, its shape, where it shows, and its size."""

from typing import Any

import numpy as np
import polars as pl

from descentflow.watching.change_evidence import SHAPES, Evidence
from descentflow.watching.day_record import PARTS, SIZES, WATCHED

UNITS = {"time_at_speed": "s", "fuel": "kg"}
SHOWN = 0.05
"""Weight from which a quantity is named among those that changed."""


def change_of(days: pl.DataFrame, evidence: Evidence, alarm: int) -> dict[str, Any]:
    """The change that the evidence of a day speaks for.

    Args:
        days: In order, up to the last one.
        evidence: Evidence after each.
        alarm: Day of the alarm, by position.

    Returns:
        Plain values for `alarm.json`: day of the alarm; day of the change with a 90 % interval; ``step`` or ``drift``;
        quantities that show it with their changes; and its size in seconds and kilograms.
    """
    likeliest, first, last = evidence.dates(alarm)
    names = days["day"].to_list()
    shape = SHAPES[int(evidence.shape[alarm].argmax())]
    weight = np.exp(evidence.quantity[alarm] - np.logaddexp.reduce(evidence.quantity[alarm]))
    before, after = days[:likeliest], days[likeliest : alarm + 1]
    shown = []
    for (quantity, (label, unit, factor)), share in zip(WATCHED.items(), weight.tolist(), strict=True):
        if share >= SHOWN:
            change = round(_difference(before, after, f"{quantity}: mean") * factor, 4)
            shown.append(
                {"quantity": quantity, "label": label, "weight": round(share, 4), "change": change, "unit": unit}
            )
    return {
        "raised": names[alarm],
        "change": {
            "day": names[likeliest],
            "earliest": names[first],
            "latest": names[last],
            "before": names[max(likeliest - 1, 0)],
        },
        "shape": shape,
        "log_e": round(float(evidence.log_e[alarm]), 3),
        "shown_by": sorted(shown, key=lambda change: -float(change["weight"])),
        "size": {f"{name} ({UNITS[name]})": round(_of_parts(before, after, name), 2) for name in SIZES},
    }


def _of_parts(before: pl.DataFrame, after: pl.DataFrame, name: str) -> float:
    """Change of a cost, summed over the parts of the levels that both show."""
    return sum(_difference(before, after, f"{name} {part}") for part in PARTS)


def _difference(before: pl.DataFrame, after: pl.DataFrame, column: str) -> float:
    """Mean over days after minus before, days by their flights."""
    means = []
    for side in (before, after):
        values, flights = (side[name].cast(pl.Float64).fill_null(np.nan).to_numpy() for name in (column, "flights"))
        seen = np.isfinite(values)
        means.append(float(np.average(values[seen], weights=flights[seen])) if seen.any() else float("nan"))
    # A quantity that one side does not show speaks for no change.
    return means[1] - means[0] if np.isfinite(means).all() else 0.0
