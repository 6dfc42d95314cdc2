"""Figures of a diagnosis: what it costs, the map of where, before and after, what each effect explains alone.

Each is drawn wide or narrow (for screens of 400 pixels), explains its marks in a tip, and tells nothing by colour
alone: markers, lines and numbers differ too.
"""

from collections.abc import Callable, Mapping, Sequence
from textwrap import fill

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from matplotlib.ticker import MaxNLocator

from descentflow.diagnosis.findings.costs_found import Cost, LevelMeans, Measured
from descentflow.diagnosis.findings.findings import Curve, SingleEffect
from descentflow.diagnosis.report.difference_map import draw_map
from descentflow.diagnosis.report.trade_units import at_level, in_trade, level_range, trade_number
from descentflow.measurements.quantity_registry import label_of
from descentflow.reporting.figure_style import BLUE, GREY, RED, legend_below, say_why_empty, tidy
from descentflow.reporting.svg_figures import with_tip

WIDE_IN, NARROW_IN = 10.5, 3.55
"""Widths at which text of 9 points is as large as the page's small print."""
SMALL = 9
DRAWN_COSTS = ("time", "time_at_speed", "ground_distance", "air_distance", "rate")
"""Costs that are drawn, of both distances the one over ground."""
PANELS = 4


def costs_figure(costs: Sequence[Cost], *, narrow: bool = False) -> Figure:
    """Time, distance and rate over all levels and their thirds: before, after, and the noise floor.

    Args:
        costs: As a report holds them.
        narrow: Panels below each other.

    Example:
        >>> cost = Cost("time", "time", "s", 150.0, 370.0, 520.0, 545.0, Measured(25.0, 22.0, 28.0), None, 3.0)
        >>> costs_figure([cost]).axes[0].get_title()
        'time (s)'
    """
    names = [name for name in DRAWN_COSTS if any(c.name == name for c in costs)]
    names = [name for name in names if name != "air_distance" or "ground_distance" not in names][:PANELS]
    rows = list(dict.fromkeys((c.low_fl, c.high_fl) for c in costs))
    # The whole above, its parts from the top down.
    rows = [*sorted(rows[1:]), *rows[:1]]
    height = 0.42 * len(rows) + 0.9
    if narrow:
        figure = Figure(figsize=(NARROW_IN, len(names) * height + 0.6), layout="constrained")
        axes = np.atleast_1d(figure.subplots(len(names), 1))
    else:
        figure = Figure(figsize=(WIDE_IN, height + 0.5), layout="constrained")
        axes = np.atleast_1d(figure.subplots(1, len(names), sharey=True))
    for ax, name in zip(axes, names, strict=True):
        of_name = {(c.low_fl, c.high_fl): c for c in costs if c.name == name}
        for y, row in enumerate(rows):
            if row in of_name:
                _cost_row(ax, y, of_name[row])
        ax.axvline(0, color="#444444", linewidth=0.8)
        ax.set_yticks(range(len(rows)), [level_range(*row) for row in rows])
        ax.set_ylim(-0.6, len(rows) - 0.4)
        some = next(iter(of_name.values()))
        ax.set_title(f"{some.label} ({some.unit})", fontsize=SMALL)
        ax.xaxis.set_major_locator(MaxNLocator(5))
        if not narrow or ax is axes[-1]:
            ax.set_xlabel("real flights minus simulator", fontsize=SMALL)
    tidy(axes)
    legend_below(figure, axes, 1 if narrow else 4)
    return figure


def _cost_row(ax: Axes, y: float, cost: Cost) -> None:
    ax.add_patch(Rectangle((-cost.floor, y - 0.36), 2 * cost.floor, 0.72, color="#dddddd", label="noise floor"))
    kinds = [("before", cost.before, RED, "o", "-", 0.14)]
    if cost.after is not None:
        kinds.append(("with the causes in the simulator", cost.after, BLUE, "s", "--", -0.14))
    for name, value, colour, marker, line, up in kinds:
        if value.low is not None and value.high is not None:
            ax.plot([value.low, value.high], [y + up] * 2, color=colour, linestyle=line, linewidth=1.6)
        (point,) = ax.plot(
            [value.estimate], [y + up], marker, color=colour, markersize=6, label=name,
            markerfacecolor=colour if marker == "o" else "white", linestyle="none",
        )  # fmt: skip
        with_tip(point, f"{cost.label}, {level_range(cost.low_fl, cost.high_fl)}, {name}: {_tip(value, cost.unit)}")


def _tip(value: Measured, unit: str) -> str:
    text = trade_number(value.estimate, unit, signed=True)
    return text if value.low is None or value.high is None else f"{text} ({value.low:+.3g} to {value.high:+.3g})"


def where_figure(curves: Mapping[str, Curve], profile: Sequence[LevelMeans] = (), *, narrow: bool = False) -> Figure:
    """Map of where flights and simulator differ: quantity against altitude, each cell with its number.

    Numbers stand where a difference is more than chance often gives (two standard errors): flights minus simulator, in
    units of the trade. On a narrow map signs stand for them.

    Args:
        curves: By quantity, as a report's details hold them.
        profile: What the simulator flies on average by level, as a report's details hold it.
        narrow: Names above their rows, signs instead of numbers.

    Example:
        >>> curve = Curve([157.5, 172.5], before=[0.05, 0.03], after=[0.0, 0.01], error=[0.01, 0.01])
        >>> figure = where_figure({"rate": curve, "level": Curve([None], [3.0], [0.0], [2.0])})
        >>> [text.get_text() for text in figure.axes[0].texts]
        ['+5.1', '+3.0']
        >>> figure.savefig("where.png")
    """
    banded = {q: c for q, c in curves.items() if c.level_fl[0] is not None}
    return draw_map(banded, profile, NARROW_IN if narrow else WIDE_IN, narrow=narrow)


def curves_figure(
    curves: Mapping[str, Curve],
    shown: Sequence[str],
    profile: Sequence[LevelMeans] = (),
    *,
    narrow: bool = False,
    after: bool = True,
) -> Figure:
    """Difference of means against altitude, before and after the causes are added, with what chance gives.

    Args:
        curves: By quantity, see :func:`where_figure`.
        shown: Quantities to draw, at most four.
        profile: What the simulator flies on average by level.
        narrow: Two panels in a row.
        after: Whether there are causes to add; without any only what is before is drawn.

    Example:
        >>> curve = Curve([157.5, 172.5], before=[0.05, 0.03], after=[0.0, 0.01], error=[0.01, 0.01])
        >>> curves_figure({"rate": curve}, ["rate"]).savefig("curves.png")
    """
    count = max(len(shown), 1)
    columns = min(2, count) if narrow else count
    rows = -(-count // columns)
    size = (NARROW_IN, 2.9 * rows + 0.7) if narrow else (min(2.9 * count + 0.8, WIDE_IN), 4.4)
    figure = Figure(figsize=size, layout="constrained")
    axes = np.atleast_1d(figure.subplots(rows, columns, sharey=True)).ravel()
    for ax in axes[count:]:
        ax.set_visible(False)
    for k, (ax, q) in enumerate(zip(axes, shown, strict=False)):
        _curve(ax, q, curves[q], profile, 18 if narrow else 28, with_after=after)
        if k % columns == 0:
            ax.set_ylabel("flight level", fontsize=SMALL)
    if not shown:
        say_why_empty(axes[0], "No quantity is compared level by level.")
    tidy(axes[:count])
    legend_below(figure, axes[:count], 1 if narrow else 3)
    return figure


def _curve(
    ax: Axes, quantity: str, curve: Curve, profile: Sequence[LevelMeans], letters: int, *, with_after: bool
) -> None:
    levels = np.array(curve.level_fl, dtype=float)

    def told(values: Sequence[float]) -> tuple[list[float], str]:
        pairs = [in_trade(quantity, v, fl, fl, at_level(profile, fl)) for v, fl in zip(values, levels, strict=True)]
        return [value for value, _ in pairs], pairs[0][1]

    (before, unit), (after, _) = told(curve.before), told(curve.after)
    chance, _ = told([2 * e for e in curve.error])
    ax.fill_betweenx(levels, -np.array(chance), chance, color="#dddddd", label="what chance gives (95 %)")
    lines = (("before", before, RED, "o", "-"), ("after", after, BLUE, "s", "--"))
    for name, values, colour, marker, line in lines if with_after else lines[:1]:
        ax.plot(values, levels, color=colour, linestyle=line, linewidth=1.5)
        for k, (value, fl) in enumerate(zip(values, levels, strict=True)):
            # A line of one point, so that each has its own tip.
            (point,) = ax.plot([value], [fl], marker, color=colour, markersize=4, label=name if k == 0 else None)
            point.set_markerfacecolor(colour if marker == "o" else "white")
            with_tip(point, f"{label_of(quantity)}, FL{fl:.0f}, {name}: {trade_number(value, unit, signed=True)}")
    ax.axvline(0, color="#444444", linewidth=0.8)
    after_unit = "" if unit == "1" else f" ({unit})"
    ax.set_title(fill(f"{label_of(quantity)}{after_unit}", letters), fontsize=SMALL)
    ax.xaxis.set_major_locator(MaxNLocator(3))


def singles_figure(
    singles: Sequence[SingleEffect],
    chosen: Sequence[str],
    group: Sequence[str],
    label: Callable[[str], str],
    *,
    narrow: bool = False,
) -> Figure:
    """Evidence of every effect alone over no effect.

    Args:
        singles: Best first.
        chosen: Effects that are named.
        group: Effects that these data cannot tell from them.
        label: Name of an effect for readers.
        narrow: Less room for names.

    Example:
        >>> singles = [SingleEffect("drag_polar", 210.0, {}), SingleEffect("mass", 190.0, {})]
        >>> singles_figure(singles, ["drag_polar"], ["mass"], str.upper).savefig("singles.png")
    """
    rows = list(reversed(singles))
    height = 0.36 * len(rows) + (1.9 if narrow else 1.2)
    figure = Figure(figsize=(NARROW_IN if narrow else 0.8 * WIDE_IN, height), layout="constrained")
    ax = figure.subplots()
    kinds = {
        "named": (RED, "o", [r.effect in chosen for r in rows]),
        "cannot be told from it": ("#b07800", "D", [r.effect in group and r.effect not in chosen for r in rows]),
        "others": (GREY, "x", [r.effect not in chosen and r.effect not in group for r in rows]),
    }
    for kind, (colour, marker, mine) in kinds.items():
        for y in np.flatnonzero(mine).tolist():
            row = rows[y]
            gain = max(row.gain_nats, 0.0)
            ax.plot([0, gain], [y, y], color=colour, linewidth=1.2)
            (point,) = ax.plot([gain], [y], marker, color=colour, markersize=7, linestyle="none", label=kind)
            with_tip(point, f"{label(row.effect)} alone ({kind}): {row.gain_nats:.0f}")
    if not rows:
        say_why_empty(ax, "No effect was tried.")
    ax.set_yticks(range(len(rows)), [fill(label(r.effect), 18 if narrow else 40) for r in rows])
    about = "evidence over no effect (natural logarithm)"
    ax.set_xlabel(fill(about, 36 if narrow else 90), fontsize=SMALL)
    ax.set_xscale("symlog", linthresh=10)
    ax.xaxis.set_major_formatter("{x:,.0f}")
    ax.set_xlim(0, 1.6 * max([20.0, *(r.gain_nats for r in rows)]))
    tidy([ax])
    legend_below(figure, [ax], 1 if narrow else 3)
    return figure
