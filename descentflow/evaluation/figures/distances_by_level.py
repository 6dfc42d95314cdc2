"""Distances between samples and held-out flights at every level, beside what chance alone would show."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from descentflow.evaluation.metrics.noise_floor import MIN_VALUES
from descentflow.evaluation.metrics.score_registry import QUANTITIES, level_statistics
from descentflow.evaluation.metrics.score_table import LevelScores, ScoreTable
from descentflow.reporting.figure_style import BAND, BLUE, GREY, RED, legend_below, say_why_empty, tidy


def level_scores_figure(table: ScoreTable, transition_fl: float) -> Figure:
    """Draw the distances by level of a table already scored.

    Flights against as many samples (line, mean over random splits) and against as many other flights (band, 5th to 95th
    percentile, and its mean), all at one fixed size. For samples distributed like the flights, the line follows the
    mean of the band and not zero. Levels with too few values are left open.

    Args:
        table: Scores, with those by level.
        transition_fl: Transition level of the type; not drawn where the grid does not hold it.

    Returns:
        A figure of a panel for each quantity and statistic, which share the flight level.

    Example:
        >>> from descentflow.evaluation.evaluate import evaluate
        >>> found = evaluate("best.ckpt", "descents.parquet", n=300, n_splits=2)
        >>> len(level_scores_figure(found.scores, transition_fl=290.0).axes)
        4
    """
    found = {(level.quantity, level.statistic): level for level in table.levels}
    drawn = [one for one in level_statistics() if one.in_figure]
    panels = [(quantity, one) for quantity in QUANTITIES if quantity.by_level for one in drawn]
    figure = Figure(figsize=(2.75 * len(panels), 5.0), layout="constrained")
    axes = figure.subplots(1, len(panels), sharey=True)
    tidy(axes)
    for ax, (quantity, statistic) in zip(axes, panels, strict=True):
        level = found[quantity.name, statistic.name]
        _draw(ax, level, transition_fl)
        ax.set_xlabel(f"{statistic.short}, {quantity.short or quantity.label} ({level.unit})")
    axes[0].set_ylabel("Flight level")
    legend_below(figure, axes)
    return figure


def _draw(ax: Axes, level: LevelScores, transition_fl: float) -> None:
    levels, low, high, floor, same = (
        np.asarray(values.detach().cpu(), dtype=float)
        for values in (level.levels_fl, level.floor_low, level.floor_high, level.floor, level.equal_size)
    )
    if not np.isfinite(same).any():
        say_why_empty(ax, f"No level has {MIN_VALUES} flights and as many samples to compare.")
    ax.fill_betweenx(levels, low, high, color=BAND, linewidth=0, label="flights against flights, 5-95 %")
    ax.plot(floor, levels, color=BLUE, linestyle="--", linewidth=1.4, label="its mean")
    ax.plot(same, levels, color=RED, linewidth=1.8, label="samples against flights")
    ax.set_xlim(left=0)
    ax.set_ylim(levels[0], levels[-1])
    if levels[0] < transition_fl < levels[-1]:
        ax.axhline(transition_fl, color=GREY, linewidth=1.0, linestyle="-.", label="transition")
