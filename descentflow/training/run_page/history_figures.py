"""Figures of a training: loss by epoch, and scores beside their noise floors by epoch."""

from matplotlib.figure import Figure

from descentflow.evaluation.metrics.score_registry import STATISTICS, level_parts
from descentflow.reporting.figure_style import BLACK, BLUE, RED, legend_below, tidy
from descentflow.training.run_page.run_history import RunHistory

WIDE_IN, NARROW_IN = 8.5, 3.55
"""Widths at which text of 9 points is as large as the page's small print."""
LOSSES = {
    "train/nll": ("training flights", BLUE, "--", "o"),
    "val/nll": ("validation flights", RED, "-", "s"),
    "val/bound": ("validation, with its error", BLACK, ":", "^"),
}
"""Series -> what it is called, colour, dashes, marker."""
SHOWN = ("wasserstein", "ks")
"""Statistics that are drawn by epoch: of these the paper's tables are made."""


def loss_figure(history: RunHistory, monitor: str, *, narrow: bool = False) -> Figure:
    """Negative log-likelihood by epoch, with the epoch that was kept.

    Args:
        history: With one of :data:`LOSSES`.
        monitor: Name of the series that decided which epoch was the best.
        narrow: For screens of 400 pixels.

    Example:
        >>> import numpy as np
        >>> series = {"val/nll": (np.array([1.0, 2.0]), np.array([5.0, 4.0]))}
        >>> loss_figure(RunHistory(series), "val/nll").axes[0].get_xlabel()
        'Epoch'
    """
    figure = Figure(figsize=(NARROW_IN, 3.2) if narrow else (WIDE_IN, 3.6), layout="constrained")
    ax = figure.subplots()
    tidy([ax])
    for name, (label, colour, dashes, marker) in LOSSES.items():
        if name in history.series:
            epochs, values = history.series[name]
            # A marker where there are too few epochs for a line to be told by its dashes.
            shown = marker if len(epochs) < 5 else ""
            ax.plot(epochs, values, color=colour, linestyle=dashes, linewidth=1.6, marker=shown, label=label)
    best = history.best(monitor)
    if best is not None:
        ax.plot([best[0]], [best[1]], "o", color=BLACK, markerfacecolor="white", markersize=8, label="kept epoch")
    ax.set_xlabel("Epoch")
    ax.set_ylabel("Negative log-likelihood\n(nats per flight)", fontsize=9)
    legend_below(figure, [ax], 1 if narrow else 4)
    return figure


def scores_figure(history: RunHistory, *, narrow: bool = False) -> Figure:
    """Scores of validation flights at matched size beside their noise floors, by epoch.

    Args:
        history: With scores and floors, see :meth:`.run_history.RunHistory.scored`.
        narrow: Panels below each other.

    Example:
        >>> import numpy as np
        >>> names = [f"val/score/cas_below_transition/ks_{kind}" for kind in ("equal_size", "floor")]
        >>> series = {name: (np.array([1.0]), np.array([0.2])) for name in names}
        >>> scores_figure(RunHistory(series)).axes[0].get_title().splitlines()
        ['CAS below', 'KS (1)']
    """
    parts, pairs = level_parts(), history.scored()
    panels = [
        (part, statistic, name)
        for statistic in SHOWN
        for part in parts
        if (name := f"val/score/{part}/{statistic}_equal_size") in pairs
    ]
    # A row for each statistic.
    columns = 1 if narrow else max(sum(statistic == panels[0][1] for _, statistic, _ in panels), 1)
    rows = -(-len(panels) // columns)
    size = (NARROW_IN, 2.0 * rows + 0.5) if narrow else (10.5, 2.3 * rows + 0.5)
    figure = Figure(figsize=size, layout="constrained")
    axes = list(figure.subplots(rows, columns, squeeze=False, sharex=True).flat)
    tidy(axes)
    for ax, (part, statistic, name) in zip(axes, panels, strict=False):
        one = STATISTICS[statistic]
        unit = one.unit_of(parts[part].quantity)
        ax.set_title(f"{parts[part].short}\n{one.short} ({unit})", fontsize=9)
        epochs, values = history.series[name]
        ax.plot(epochs, values, color=RED, marker="o", markersize=4, label="samples against flights")
        epochs, values = history.series[pairs[name]]
        label = "noise floor: flights against flights"
        ax.plot(epochs, values, color=BLUE, linestyle="--", marker="s", markersize=3, label=label)
        ax.set_ylim(0, 1.15 * max(ax.get_ylim()[1], 1e-9))
    for ax in axes[len(panels) :]:
        ax.set_visible(False)
    for ax in axes[max(len(panels) - columns, 0) : len(panels)]:
        ax.set_xlabel("Epoch", fontsize=9)
    legend_below(figure, axes, 1 if narrow else 2)
    return figure
