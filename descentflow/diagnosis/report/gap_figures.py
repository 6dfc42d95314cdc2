"""Figures of a diagnosis: the map of where, what each effect explains alone, before and after."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from descentflow.diagnosis.findings.cause_found import RivalClosure
from descentflow.diagnosis.findings.findings import Curve, SingleEffect
from descentflow.measurements.quantity_registry import label_of
from descentflow.reporting.figure_style import BLUE, GREY, RED, legend_below, tidy

COLOUR_END = 12.0
"""Standard errors at which the colours of the map end."""


def where_figure(curves: Mapping[str, Curve]) -> Figure:
    """Map of where flights and simulator differ: quantity against altitude, coloured by standard errors.

    Args:
        curves: By quantity, as a report's details hold them.

    Example:
        >>> from descentflow.diagnosis.findings.findings import Curve
        >>> curve = Curve([157.5, 172.5], before=[0.05, 0.03], after=[0.0, 0.01], error=[0.01, 0.01])
        >>> where_figure({"rate": curve, "level": Curve([None], [3.0], [0.0], [2.0])}).savefig("where.png")
    """
    banded = [q for q, c in curves.items() if c.level_fl[0] is not None]
    single = [q for q, c in curves.items() if c.level_fl[0] is None]
    figure = Figure(figsize=(9.5, 0.42 * (len(banded) + 0.62 * len(single)) + 2.0), layout="constrained")
    upper, lower = figure.subplots(2, 1, height_ratios=[max(len(banded), 1), max(0.62 * len(single), 0.6)])
    levels = sorted({x for q in banded for x in curves[q].level_fl if x is not None})
    table = np.full((len(banded), len(levels)), np.nan)
    for i, q in enumerate(banded):
        for level, value, error in zip(curves[q].level_fl, curves[q].before, curves[q].error, strict=True):
            if level is not None:
                table[i, levels.index(level)] = value / error
    image = upper.imshow(
        np.clip(table, -COLOUR_END, COLOUR_END), cmap="RdBu_r", vmin=-COLOUR_END, vmax=COLOUR_END, aspect="auto"
    )
    upper.set_yticks(range(len(banded)), [label_of(q) for q in banded], fontsize=9)
    every = -(-len(levels) // 7)
    upper.set_xticks(range(0, len(levels), every), [f"FL{levels[i]:.0f}" for i in range(0, len(levels), every)])
    upper.tick_params(labelsize=9)
    bar = figure.colorbar(image, ax=upper, pad=0.01)
    bar.set_label("difference in\nstandard errors", fontsize=9)
    values = [curves[q].before[0] / curves[q].error[0] for q in single]
    lower.barh(
        range(len(single)), np.clip(values, -COLOUR_END, COLOUR_END), color=[RED if v > 0 else BLUE for v in values]
    )
    lower.axvspan(-2, 2, color="#eeeeee", zorder=0)
    lower.set_yticks(range(len(single)), [label_of(q) for q in single], fontsize=9)
    lower.invert_yaxis()
    lower.set_xlim(-COLOUR_END, COLOUR_END)
    lower.set_xlabel("difference in standard errors (grey: what chance often gives)", fontsize=9)
    tidy([lower])
    return figure


def singles_figure(
    singles: Sequence[SingleEffect], chosen: Sequence[str], group: Sequence[str], label: Callable[[str], str]
) -> Figure:
    """Held-out gain of every effect alone, with two standard errors.

    Args:
        singles: Best first.
        chosen: Effects that are named.
        group: Effects that these data cannot tell from them.
        label: Name of an effect for readers.

    Example:
        >>> from descentflow.diagnosis.findings.findings import SingleEffect
        >>> singles = [SingleEffect("drag_polar", 210.0, 15.0, {}), SingleEffect("mass", 190.0, 15.0, {})]
        >>> singles_figure(singles, ["drag_polar"], ["mass"], str.upper).savefig("singles.png")
    """
    rows = list(reversed(singles))
    figure = Figure(figsize=(8.5, 0.34 * len(rows) + 1.4), layout="constrained")
    ax = figure.subplots()
    colours = [RED if r.effect in chosen else "#e69f00" if r.effect in group else GREY for r in rows]
    gains = [max(r.score_gain, 0.0) for r in rows]
    ax.barh(range(len(rows)), gains, color=colours, xerr=[2 * r.error for r in rows], ecolor="#444444")
    ax.set_yticks(range(len(rows)), [label(r.effect) for r in rows], fontsize=9)
    ax.set_xlabel("how much better flights that it was not fitted to are explained (nats)", fontsize=9)
    ax.set_xscale("symlog", linthresh=10)
    ax.set_xlim(left=0)
    kinds = [("named", RED), ("cannot be told from it", "#e69f00"), ("others, each alone", GREY)]
    ax.legend(handles=[Patch(color=c, label=label) for label, c in kinds], frameon=False, fontsize=9, loc="lower right")
    tidy([ax])
    return figure


def curves_figure(curves: Mapping[str, Curve], shown: Sequence[str]) -> Figure:
    """Difference of means against altitude, before and after the causes are added, with what chance gives.

    Args:
        curves: By quantity, see :func:`where_figure`.
        shown: Quantities to draw, at most four.

    Example:
        >>> from descentflow.diagnosis.findings.findings import Curve
        >>> curve = Curve([157.5, 172.5], before=[0.05, 0.03], after=[0.0, 0.01], error=[0.01, 0.01])
        >>> curves_figure({"rate": curve}, ["rate"]).savefig("curves.png")
    """
    count = max(len(shown), 1)
    figure = Figure(figsize=(2.9 * count + 0.8, 4.2), layout="constrained")
    axes = np.atleast_1d(figure.subplots(1, count, sharey=True))
    for ax, q in zip(axes, shown, strict=False):
        curve = curves[q]
        levels = np.array(curve.level_fl, dtype=float)
        error = 2 * np.array(curve.error)
        ax.fill_betweenx(levels, -error, error, color="#e4e4e4", label="what chance gives (95 %)")
        ax.plot(curve.before, levels, color=RED, marker="o", markersize=3, label="before")
        ax.plot(curve.after, levels, color=BLUE, marker="s", markersize=3, linestyle="--", label="after")
        ax.axvline(0, color="#444444", linewidth=0.8)
        ax.set_title(label_of(q), fontsize=9)
        ax.xaxis.set_major_locator(MaxNLocator(4))
    axes[0].set_ylabel("flight level")
    tidy(axes)
    legend_below(figure, axes)
    return figure


def closure_figure(
    before: float, after: float, floor: float, rivals: Sequence[RivalClosure], names: str, label: Callable[[str], str]
) -> Figure:
    """Gap before and after beside the floor, and what each other effect would close.

    Args:
        before: Gap before.
        after: Gap with the causes.
        floor: Least gap that could be seen.
        rivals: What every other effect would close.
        names: The causes.
        label: Name of an effect for readers.

    Example:
        >>> from descentflow.diagnosis.findings.cause_found import RivalClosure
        >>> closure_figure(0.67, 0.2, 0.08, [RivalClosure("mass", 0.3)], "drag polar", str).savefig("closure.png")
    """
    figure = Figure(figsize=(10.0, 0.26 * len(rivals) + 2.2), layout="constrained")
    left, right = figure.subplots(1, 2, width_ratios=[1, 1.5])
    left.bar([0, 1], [before, after], color=[RED, BLUE], width=0.6)
    left.axhline(floor, color="#444444", linestyle=":", label="noise floor: two samples of one population")
    left.set_xticks([0, 1], ["before", f"with {names}"], fontsize=9)
    left.set_ylabel("gap (spreads between flights)", fontsize=9)
    # Room for the legend above the higher bar.
    left.set_ylim(top=1.2 * max(before, after, floor, 1e-6))
    left.legend(frameon=False, fontsize=8, loc="upper left")
    rows = [(label(r.effect), r.closure) for r in reversed(rivals) if r.closure is not None]
    right.barh(range(len(rows)), [max(100 * closure, -20.0) for _, closure in rows], color=GREY)
    right.set_yticks(range(len(rows)), [name for name, _ in rows], fontsize=8)
    right.set_xlim(-22, 105)
    right.set_xlabel("share of the gap that another effect in its place would close (%)", fontsize=9)
    tidy([left, right])
    return figure
