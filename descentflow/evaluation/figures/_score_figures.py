"""Figures of an evaluation's scores: draws rejected, distances by level, and what the classifier uses."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from descentflow.evaluation.metrics.classifier import QUANTITIES as FEATURES
from descentflow.evaluation.metrics.classifier import Detection
from descentflow.evaluation.metrics.distances import MIN_VALUES
from descentflow.evaluation.metrics.score_registry import QUANTITIES, statistics_of
from descentflow.evaluation.metrics.score_table import LevelScores, ScoreTable
from descentflow.evaluation.metrics.statistic_kinds import LevelStatistic
from descentflow.generation.samples import RejectionReport
from descentflow.reporting.figure_style import BAND, BLUE, GREY, RED, legend_below, panels, say_why_empty

_SURPLUS = "#9ecae1"


def acceptance_figure(report: RejectionReport) -> Figure:
    """Shares of the draws that were kept or rejected, and the share that broke each rule.

    A draw that breaks several rules counts under each of them.

    Args:
        report: Account of a rejection sampling.

    Returns:
        A figure of two panels.

    Example:
        >>> report = RejectionReport(drawn=110, accepted=100, rejected=8, surplus=2, broken={"not_finite": 8})
        >>> len(acceptance_figure(report).axes)
        2
    """
    heights = [1.3, max(len(report.broken), 1)]
    figure, ((above,), (below,)) = panels(8.0, 1.9 + 0.36 * len(report.broken), 2, height_ratios=heights)
    _draw_fates(above, report)
    _draw_rules(below, report)
    plausible = f", {report.acceptance:.1%} plausible" if report.drawn else ""
    figure.suptitle(f"{report.accepted:,} samples from {report.drawn:,} draws{plausible}", fontsize=11)
    return figure


def _share(count: int, report: RejectionReport) -> float:
    return 100 * count / report.drawn if report.drawn else 0.0


def _draw_fates(ax: Axes, report: RejectionReport) -> None:
    left = 0.0
    outcomes = (
        ("kept", report.accepted, BLUE, ""),
        ("plausible, not needed", report.surplus, _SURPLUS, ".."),
        ("rejected", report.rejected, RED, "//"),
    )
    for name, count, colour, hatch in outcomes:
        share = _share(count, report)
        label = f"{name} ({count:,})"
        ax.barh([""], [share], left=left, color=colour, hatch=hatch, edgecolor="white", linewidth=0, label=label)
        left += share
    ax.set_xlim(0, 100)
    ax.set_xlabel("Share of draws (%)", fontsize=9)
    ax.legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=3, frameon=False, fontsize=9, borderaxespad=0.2)


def _draw_rules(ax: Axes, report: RejectionReport) -> None:
    if not report.broken:
        ax.set_axis_off()
        say_why_empty(ax, "No draw breaks a rule." if report.drawn else "Nothing was drawn.")
        return
    names = [rule.replace("_", " ").replace("cas", "CAS") for rule in report.broken]
    shares = [_share(count, report) for count in report.broken.values()]
    bars = ax.barh(names, shares, color=RED)
    ax.bar_label(bars, [f" {count:,} ({s:.2g} %)" for count, s in zip(report.broken.values(), shares, strict=True)])
    ax.invert_yaxis()
    ax.set_xlim(0, 1.3 * max([*shares, 0.1]))
    ax.set_xlabel("Share of draws that break the rule (%)", fontsize=9)


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
        >>> evaluation = evaluate("best.ckpt", "descents.parquet", n=300, n_splits=2)
        >>> len(level_scores_figure(evaluation.scores, transition_fl=290.0).axes)
        4
    """
    by_name = {(level.quantity, level.statistic): level for level in table.levels}
    drawn = [statistic for statistic in statistics_of(LevelStatistic) if statistic.in_figure]
    pairs = [(quantity, statistic) for quantity in QUANTITIES if quantity.by_level for statistic in drawn]
    figure, (axes,) = panels(2.75 * len(pairs), 5.0, 1, len(pairs), sharey=True)
    for ax, (quantity, statistic) in zip(axes, pairs, strict=True):
        level = by_name[quantity.name, statistic.name]
        _draw(ax, level, transition_fl)
        ax.set_xlabel(f"{statistic.short}, {quantity.short} ({level.unit})")
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


def classifier_figure(detection: Detection) -> Figure:
    """Draw how much the AUC loses when a quantity is exchanged between flights and samples, band by band.

    Args:
        detection: With importance, from :func:`descentflow.evaluation.metrics.classifier.detect`.

    Returns:
        A figure of a panel for each quantity, which share the flight level.

    Example:
        >>> from descentflow.evaluation.metrics.classifier import Importance
        >>> bands = [Importance(q, low, low + 100, 0.05) for q in ("CAS", "rate") for low in (150, 250)]
        >>> whole = [Importance(q, 150, 350, 0.1) for q in ("CAS", "rate")]
        >>> import torch
        >>> figure = classifier_figure(Detection(torch.tensor([0.6, 0.7]), (*whole, *bands)))
        >>> [axes.get_title() for axes in figure.axes]
        ['CAS: 0.10 in all', 'rate: 0.10 in all']
    """
    n = len(FEATURES)
    whole, bands = detection.importance[:n], detection.importance[n:]
    figure, (axes,) = panels(7.0, 4.4, 1, n, sharex=True, sharey=True)
    for ax, total in zip(axes, whole, strict=True):
        own = [band for band in bands if band.quantity == total.quantity]
        width = (own[-1].high_fl - own[0].low_fl) / len(own)
        middles = [(band.low_fl + band.high_fl) / 2 for band in own]
        ax.barh(middles, [band.loss for band in own], height=0.8 * width, color=BLUE)
        ax.axvline(0, color=GREY, linewidth=0.8)
        ax.set_title(f"{total.quantity}: {total.loss:.2f} in all", fontsize=10)
        ax.set_xlabel("AUC lost when exchanged")
    low, high = detection.interval
    axes[0].set_ylabel("Flight level")
    figure.suptitle(f"Samples separated from flights: AUC {detection.auc:.2f} [{low:.2f}, {high:.2f}]", fontsize=11)
    return figure
