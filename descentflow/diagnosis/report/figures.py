"""Figures of a diagnosis, a panel each: a cost by level, and a quantity against altitude, before and after."""

from collections.abc import Sequence
from textwrap import fill

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from matplotlib.ticker import MaxNLocator

from descentflow.diagnosis.findings.aviation_units import at_level, aviation_value, level_range
from descentflow.diagnosis.findings.costs_found import Cost, LevelMeans
from descentflow.diagnosis.findings.findings import Curve
from descentflow.measurements.quantity_registry import label_of
from descentflow.reporting.figure_style import BLUE, RED, tidy

WIDTH_IN = 3.2
"""Width at which text of 9 points is as large as the page's small print, on screens of 400 pixels too."""
CHANCE = 2.0
"""Standard errors that chance often gives."""
FLOOR = "#dddddd"
TITLE_LETTERS = 34
"""In a line of a title."""


def cost_figure(costs: Sequence[Cost], name: str) -> Figure:
    """One cost over all levels and over their thirds: before, after, and what chance gives.

    Args:
        costs: As a report holds them.
        name: Of the cost: ``time``, ``rate`` and the like.

    Example:
        >>> from descentflow.diagnosis.findings.costs_found import Measured
        >>> cost = Cost("time", "time", "s", 150.0, 370.0, 520.0, 545.0, Measured(25.0, 22.0, 28.0), None, 3.0)
        >>> cost_figure([cost], "time").axes[0].get_title()
        'time (s)'
    """
    # The whole above, its parts from the top down.
    first, *parts = [cost for cost in costs if cost.name == name]
    rows = [*sorted(parts, key=lambda cost: cost.low_fl), first]
    figure = Figure(figsize=(WIDTH_IN, 0.36 * len(rows) + 0.75), layout="constrained")
    ax = figure.subplots()
    for y, cost in enumerate(rows):
        ax.add_patch(Rectangle((-cost.floor, y - 0.36), 2 * cost.floor, 0.72, color=FLOOR))
        for value, colour, marker, up in ((cost.before, RED, "o", 0.15), (cost.after, BLUE, "s", -0.15)):
            if value:
                ax.plot(value.ends or [value.estimate] * 2, [y + up] * 2, color=colour, linewidth=1.6)
                face = colour if marker == "o" else "white"
                ax.plot([value.estimate], [y + up], marker, color=colour, markersize=5, markerfacecolor=face)
    ax.set_yticks(range(len(rows)), [level_range(cost.low_fl, cost.high_fl) for cost in rows])
    ax.set_ylim(-0.6, len(rows) - 0.4)
    _finish(ax, f"{first.label} ({first.unit})")
    return figure


def level_figure(quantity: str, curve: Curve, profile: Sequence[LevelMeans] = (), *, after: bool = True) -> Figure:
    """Difference of means against altitude, before and after the causes are added, with what chance gives.

    Args:
        quantity: Name, see :data:`descentflow.measurements.quantity_registry.QUANTITIES`.
        curve: Of it, as a report's details hold it.
        profile: What the simulator flies on average by level.
        after: Whether there are causes to add.

    Example:
        >>> curve = Curve([157.5, 172.5], before=[0.05, 0.03], after=[0.0, 0.01], error=[0.01, 0.01])
        >>> level_figure("rate", curve).axes[0].get_title()
        'rate of descent (%)'
    """
    levels = np.array(curve.level_fl, dtype=float)

    def shown(values: Sequence[float]) -> tuple[list[float], str]:
        pairs = [
            aviation_value(quantity, v, fl, fl, at_level(profile, fl)) for v, fl in zip(values, levels, strict=True)
        ]
        return [value for value, _ in pairs], pairs[0][1]

    figure = Figure(figsize=(WIDTH_IN, 3.0), layout="constrained")
    ax = figure.subplots()
    chance, unit = shown([CHANCE * error for error in curve.error])
    ax.fill_betweenx(levels, -np.array(chance), chance, color=FLOOR)
    ax.plot(shown(curve.before)[0], levels, "o-", color=RED, linewidth=1.5, markersize=4)
    if after:
        ax.plot(shown(curve.after)[0], levels, "s--", color=BLUE, linewidth=1.5, markersize=4, markerfacecolor="white")
    ax.set_ylabel("flight level", fontsize=9)
    _finish(ax, label_of(quantity) + ("" if unit == "1" else f" ({unit})"))
    return figure


def _finish(ax: Axes, title: str) -> None:
    ax.axvline(0, color="#444444", linewidth=0.8)
    ax.set_title(fill(title, TITLE_LETTERS), fontsize=9)
    ax.xaxis.set_major_locator(MaxNLocator(4))
    tidy([ax])
