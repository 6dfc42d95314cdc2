"""The map of where flights and simulator differ, drawn wide with numbers or narrow with signs."""

from collections.abc import Mapping, Sequence
from textwrap import fill

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from descentflow.diagnosis.findings.costs_found import LevelMeans
from descentflow.diagnosis.findings.findings import Curve
from descentflow.diagnosis.report.trade_units import at_level, in_trade, trade_number
from descentflow.measurements.quantity_registry import label_of
from descentflow.reporting.figure_style import say_why_empty
from descentflow.reporting.svg_figures import with_tip

COLOUR_END = 12.0
"""Standard errors at which the colours of the map end."""
CHANCE = 2.0
"""Standard errors that chance often gives."""
LETTERS = 46
"""In a line above a row of a narrow map."""
DARK = 0.55
"""Share of the colours from which letters are white."""


def draw_map(curves: Mapping[str, Curve], profile: Sequence[LevelMeans], width_in: float, *, narrow: bool) -> Figure:
    """A row of cells for each quantity, from low levels to high ones.

    Args:
        curves: Of quantities with a number for each level.
        profile: What the simulator flies on average by level.
        width_in: Width of the figure, inches.
        narrow: Names above their rows and signs in the cells; else names beside them and numbers.

    Example:
        >>> curve = Curve([157.5, 172.5], before=[0.05, 0.03], after=[0.0, 0.01], error=[0.01, 0.01])
        >>> figure = draw_map({"rate": curve}, [], 3.5, narrow=True)
        >>> [text.get_text() for text in figure.axes[0].texts]
        ['+', '+', 'rate of descent (%): +3.0 to +5.1']
    """
    levels = sorted({fl for curve in curves.values() for fl in curve.level_fl if fl is not None})
    lines = max((_above(q, c, profile).count("\n") + 1 for q, c in curves.items()), default=1)
    step = 1.15 + 0.5 * lines if narrow else 1.0
    figure = Figure(figsize=(width_in, 0.42 * step * len(curves) + 0.9), layout="constrained")
    ax = figure.subplots()
    if not curves:
        ax.set_axis_off()
        say_why_empty(ax, "No quantity is compared level by level.")
        return figure
    for row, (quantity, curve) in enumerate(curves.items()):
        _draw_row(ax, -step * row, quantity, curve, (levels, profile, narrow))
    ax.set_xlim(-0.5, len(levels) - 0.5)
    ax.set_ylim(-step * (len(curves) - 1) - 0.5, step - 0.5 if narrow else 0.5)
    every = -(-len(levels) // (5 if narrow else 8))
    ax.set_xticks(range(0, len(levels), every), [f"FL{levels[i]:.0f}" for i in range(0, len(levels), every)])
    names = [fill(f"{label_of(q)}{_unit(q, c, profile)}", 34) for q, c in curves.items()]
    ax.set_yticks([] if narrow else [-step * row for row in range(len(curves))], [] if narrow else names)
    ax.tick_params(labelsize=9, length=0)
    ax.spines[:].set_visible(False)
    return figure


def _draw_row(
    ax: Axes,
    y: float,
    quantity: str,
    curve: Curve,
    map_of: tuple[Sequence[float], Sequence[LevelMeans], bool],
) -> None:
    levels, profile, narrow = map_of
    for fl, before, error in zip(curve.level_fl, curve.before, curve.error, strict=True):
        if fl is None:
            continue
        x, standing = levels.index(fl), before / error
        value, unit = in_trade(quantity, before, fl, fl, at_level(profile, fl))
        number = trade_number(value, unit, signed=True)
        tip = f"{label_of(quantity)}, FL{fl:.0f}: {number}, {abs(standing):.1f} standard errors"
        share = 0.5 + 0.5 * max(-1.0, min(standing / COLOUR_END, 1.0))
        # Within what chance often gives a cell stays pale.
        colour = mpl.colormaps["RdBu_r"](share) if abs(standing) > CHANCE else (0.96, 0.96, 0.96, 1.0)
        cell = Rectangle((x - 0.48, y - 0.46), 0.96, 0.92, facecolor=colour, edgecolor="#c8c8c8", linewidth=0.4)
        ax.add_patch(cell)
        with_tip(cell, tip)
        if abs(standing) <= CHANCE:
            continue
        text = ("+" if before > 0 else "\N{MINUS SIGN}") if narrow else number.removesuffix(f" {unit}")
        white = abs(share - 0.5) > DARK / 2
        ax.text(x, y, text, ha="center", va="center", fontsize=9, color="white" if white else "black")
    if narrow:
        ax.text(-0.48, y + 0.56, _above(quantity, curve, profile), ha="left", va="bottom", fontsize=9)


def _above(quantity: str, curve: Curve, profile: Sequence[LevelMeans]) -> str:
    """Name of a narrow row, with the range of what is more than chance."""
    cells = zip(curve.level_fl, curve.before, curve.error, strict=True)
    told = [
        in_trade(quantity, before, fl, fl, at_level(profile, fl))
        for fl, before, error in cells
        if fl is not None and abs(before / error) > CHANCE
    ]
    name = f"{label_of(quantity)}{_unit(quantity, curve, profile)}"
    if not told:
        return fill(f"{name}: as chance gives", LETTERS)
    ends = (trade_number(x, told[0][1], signed=True) for x in (min(told)[0], max(told)[0]))
    low, high = (end.removesuffix(f" {told[0][1]}") for end in ends)
    return fill(f"{name}: {low}" if low == high else f"{name}: {low} to {high}", LETTERS)


def _unit(quantity: str, curve: Curve, profile: Sequence[LevelMeans]) -> str:
    first = next((fl for fl in curve.level_fl if fl is not None), 0.0)
    _, unit = in_trade(quantity, 0.0, first, first, at_level(profile, first))
    return "" if unit == "1" else f" ({unit})"
