"""Figures of a study of withheld effects: what was named for what was injected, and how well."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from descentflow.reporting.figure_style import BAND, BLACK, BLUE, GREY, RED, say_why_empty, tidy

Scored = Mapping[str, Any]


def confusion_figure(confusion: Mapping[str, Scored]) -> Figure:
    """Injected cause against effect named first, one panel for each set of channels; numbers are sets.

    Args:
        confusion: Name of the panel to ``rows``, ``columns`` and ``table``.

    Returns:
        A figure.

    Example:
        >>> names = ["none", "mass", "turn", "kept_thrust", "unknown"]
        >>> table = [[4, 0, 0, 0, 0], [0, 3, 0, 0, 1], [0, 0, 0, 0, 2], [0, 0, 0, 0, 2]]
        >>> one = {"rows": names[:4], "columns": names, "table": table, "outside": 2}
        >>> len(confusion_figure({"all channels": one}).axes)
        1
    """
    figure = Figure(figsize=(7.2 * len(confusion), 6.8), layout="constrained")
    panels = np.atleast_1d(figure.subplots(1, len(confusion)))
    for ax, (name, one) in zip(panels, confusion.items(), strict=True):
        table = np.array(one["table"], dtype=float)
        total = table.sum(1, keepdims=True)
        shares = np.divide(table, total, out=np.zeros_like(table), where=total > 0)
        ax.imshow(shares, cmap="Blues", vmin=0, vmax=1.4)
        for (row, column), count in np.ndenumerate(table):
            if count:
                ax.text(column, row, f"{count:.0f}", ha="center", va="center", fontsize=8)
        ax.set_xticks(range(len(one["columns"])), one["columns"], rotation=90, fontsize=8)
        ax.set_yticks(range(len(one["rows"])), one["rows"], fontsize=8)
        ax.set_xlabel("named first")
        ax.set_ylabel("injected")
        ax.set_title(name, fontsize=10)
        outside = len(one["rows"]) - one["outside"] - 0.5
        ax.axhline(outside, color=RED, linewidth=1)
        ax.text(-0.4, outside + 0.1, "outside the catalogue", va="top", fontsize=7, color=RED)
    return figure


def p_value_figure(false_alarms: Scored) -> Figure:
    """Distribution of the p-values of sets in which nothing was injected, beside the uniform one.

    Example:
        >>> p_value_figure({"p_values": [0.2, 0.5, 0.9], "uniform_p": 0.8}).axes[0].get_title()
        'KS against uniform: p = 0.8'
    """
    figure = Figure(figsize=(4.8, 4.2), layout="constrained")
    ax = figure.subplots()
    values = np.sort(np.array(false_alarms["p_values"], dtype=float))
    n = len(values)
    grid = np.linspace(0, 1, 101)
    if n:
        # Kolmogorov's 95 % band about the uniform distribution.
        ax.fill_between(
            grid, (grid - 1.358 / n**0.5).clip(0), (grid + 1.358 / n**0.5).clip(max=1), color=BAND, label="95 %"
        )
        ax.step([0, *values, 1], [0, *np.arange(1, n + 1) / n, 1], where="post", color=BLUE, label=f"{n} null sets")
    else:
        say_why_empty(ax, "No set without an effect was diagnosed.")
    ax.plot([0, 1], [0, 1], color=BLACK, linestyle="--", linewidth=1, label="uniform")
    ax.set_xlabel("p-value")
    ax.set_ylabel("share of null sets below")
    p = false_alarms["uniform_p"]
    ax.set_title("" if p is None else f"KS against uniform: p = {p:.2g}", fontsize=10)
    ax.legend(frameon=False, fontsize=8, loc="lower right")
    tidy([ax])
    return figure


def strata_figure(rows: Sequence[Scored]) -> Figure:
    """Detection, right answers and abstention by what makes a set easy or hard, with 95 % intervals.

    Example:
        >>> share = {"share": 0.9, "low": 0.7, "high": 1.0}
        >>> row = {"kind": "single", "by": "size", "value": "half", "n": 24}
        >>> figure = strata_figure([row | {"detected": share, "first": share, "in_group": share}])
        >>> figure.axes[0].get_title()
        'one effect'
    """
    shown = {
        "single": ("detected", "first", "in_group"),
        "double": ("detected", "exact"),
        "outside": ("detected", "unknown"),
    }
    figure = Figure(figsize=(12.5, 4.6), layout="constrained")
    panels = figure.subplots(1, 3)
    marks = {
        "detected": (GREY, "o"),
        "first": (BLUE, "s"),
        "in_group": (RED, "^"),
        "exact": (BLUE, "s"),
        "unknown": (BLUE, "s"),
    }
    for ax, (kind, measures) in zip(panels, shown.items(), strict=True):
        of = [row for row in rows if row["kind"] == kind]
        for k, row in enumerate(of):
            for j, measure in enumerate(measures):
                one = row[measure]
                if one["share"] is None:
                    continue
                y = -k + 0.22 * (j - 1)
                colour, mark = marks[measure]
                ax.plot([one["low"], one["high"]], [y, y], color=colour, linewidth=1.2)
                ax.plot(one["share"], y, mark, color=colour, markersize=5, label=measure if k == 0 else None)
        ax.set_yticks([-k for k in range(len(of))], [f"{r['by']}: {r['value']} ({r['n']})" for r in of], fontsize=8)
        ax.set_xlim(-0.02, 1.02)
        ax.set_title(
            {"single": "one effect", "double": "two effects", "outside": "outside the catalogue"}[kind], fontsize=10
        )
        ax.set_xlabel("share of sets")
        if of:
            ax.legend(frameon=False, fontsize=8, loc="upper left")
        else:
            say_why_empty(ax, "No such set was diagnosed.")
    tidy(panels)
    return figure


def sizes_figure(estimates: Sequence[Scored], columns: int = 5) -> Figure:
    """Estimated against injected sizes with their 90 % intervals, a panel for each parameter.

    Example:
        >>> row = {"cause": "mass", "parameter": "factor", "unit": "1", "covered": True}
        >>> figure = sizes_figure([row | {"true": 0.9, "estimate": 0.91, "low": 0.88, "high": 0.94}])
        >>> figure.axes[0].get_title().split()
        ['mass', 'factor', '(1)']
    """
    names = sorted({(e["cause"], e["parameter"]) for e in estimates})
    rows = max(-(-len(names) // columns), 1)
    figure = Figure(figsize=(2.6 * columns, 2.5 * rows), layout="constrained")
    panels = figure.subplots(rows, columns, squeeze=False).ravel()
    for ax in panels[len(names) :]:
        ax.set_visible(False)
    if not names:
        panels[0].set_visible(True)
        say_why_empty(panels[0], "No injected effect was named with an interval.")
    for ax, (cause, parameter) in zip(panels, names, strict=False):
        of = [e for e in estimates if (e["cause"], e["parameter"]) == (cause, parameter)]
        true = np.array([e["true"] for e in of])
        for e in of:
            colour = BLUE if e["covered"] else RED
            ax.plot([e["true"]] * 2, [e["low"], e["high"]], color=colour, linewidth=1)
            ax.plot(e["true"], e["estimate"], "o", color=colour, markersize=3)
        ends = np.array([true.min(), true.max()])
        ax.plot(ends, ends, color=BLACK, linestyle="--", linewidth=0.8)
        ax.set_title(f"{cause}\n{parameter} ({of[0]['unit']})", fontsize=8)
    tidy(panels)
    figure.supxlabel("injected", fontsize=9)
    figure.supylabel("estimated", fontsize=9)
    return figure


def closure_figure(rows: Sequence[Scored]) -> Figure:
    """Share of the gap that the right effect removes, beside the best of the wrong ones.

    Example:
        >>> figure = closure_figure([{"cause": "mass", "marginal": 0.9, "conditional": 0.8, "best_rival": 0.3}])
        >>> len(figure.axes[0].lines)
        4
    """
    figure = Figure(figsize=(7.5, 4.6), layout="constrained")
    ax = figure.subplots()
    causes = sorted({row["cause"] for row in rows})
    marks = (("marginal", BLUE, "o", -0.2), ("conditional", BLACK, "s", 0.0), ("best_rival", RED, "x", 0.2))
    for kind, colour, mark, shift in marks:
        points = [(row[kind], -causes.index(row["cause"]) - shift) for row in rows if row[kind] is not None]
        if points:
            ax.plot(*zip(*points, strict=True), mark, color=colour, markersize=4, label=kind.replace("_", " "))
    ax.axvline(1.0, color=GREY, linewidth=0.8)
    ax.set_yticks([-k for k in range(len(causes))], causes, fontsize=8)
    ax.set_xlim(-0.3, 1.3)
    ax.set_xlabel("closure: share of the gap above its floor that is removed")
    if rows:
        ax.legend(frameon=False, fontsize=8, loc="lower left")
    else:
        say_why_empty(ax, "No injected effect was named.")
    tidy([ax])
    return figure


def windows_figure(rows: Sequence[Scored]) -> Figure:
    """Windows injected and named, and the levels where the rate differs most, set by set.

    Example:
        >>> row = {"injected": [180.0, 240.0], "found": [170.0, 240.0], "cell": None}
        >>> len(windows_figure([row]).axes)
        1
    """
    figure = Figure(figsize=(max(4.8, 0.45 * len(rows)), 4.2), layout="constrained")
    ax = figure.subplots()
    shown = (("injected", BLACK, 4.0, -0.2), ("found", BLUE, 4.0, 0.0), ("cell", GREY, 1.5, 0.2))
    names = {"injected": "injected", "found": "named", "cell": "where the rate differs most"}
    for key, colour, width, shift in shown:
        label: str | None = names[key]
        for k, row in enumerate(rows):
            if row[key] is not None:
                ax.plot([k + shift] * 2, row[key], color=colour, linewidth=width, solid_capstyle="butt", label=label)
                label = None
    ax.set_xlabel("set")
    ax.set_ylabel("flight level")
    ax.set_xticks([])
    if rows:
        ax.legend(frameon=False, fontsize=8)
    else:
        say_why_empty(ax, "No effect within a window was injected or named.")
    tidy([ax])
    return figure
