"""Figure of what cleaning kept and dropped of a few flights, so that a person can judge its filters."""

from collections.abc import Sequence

import numpy as np
import polars as pl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from descentflow.reporting.figure_style import BLUE, legend_below, tidy
from descentflow.surveillance.rows.air_data import cas_of_mach_kt

LOOKS = {
    "not_descending": ("#b0b0b0", "."),
    "transient": ("#e69f00", "."),
    "constant_rate": ("#009e73", "s"),
    "not_below_earlier_row": ("#56b4e9", "."),
    "second_descent": ("#8a6d3b", "v"),
    "too_few_levels": ("#6a3d9a", "."),
    "banked": ("#cc79a7", "D"),
    "cleared_speed": ("#f0a3ff", "D"),
    "IAS_contradicts_Mach": ("#d55e00", "P"),
}
"""Colour and marker of each rule; of the others by how their names begin, see :func:`look`."""
PANELS = ("pressure altitude, FL", "vertical rate, ft/min", "IAS, kt")


def look(reason: str | None) -> tuple[str, str, float]:
    """Colour, marker and size of rows dropped for one reason.

    Example:
        >>> look("spike_IAS")
        ('#ff0000', 'x', 30.0)
    """
    if reason is None:
        return BLUE, ".", 14.0
    if reason.startswith("spike_"):
        return "#ff0000", "x", 30.0
    if reason.startswith("stale_"):
        return "#a000a0", "+", 36.0
    colour, marker = LOOKS.get(reason, ("#000000", "*"))
    return colour, marker, 14.0


def cleaning_figure(flights: Sequence[pl.DataFrame]) -> Figure:
    """Altitude, rate and IAS of some flights against time, every row coloured by the rule that dropped it.

    The thin line beside the IAS is the CAS of Mach number and altitude, which should agree with it.

    Args:
        flights: For each flight its rows: `flight_id typecode timestamp altitude vertical_rate IAS Mach reason`, the
            reason null where the row was kept.

    Returns:
        A figure of three panels for each flight, side by side.

    Example:
        >>> from descentflow.surveillance.prepare import prepare
        >>> rows = prepare("rows.parquet", shown=2).dropped_rows
        >>> len(cleaning_figure(rows.partition_by("flight_id")[:2]).axes)
        6
    """
    figure = Figure(figsize=(5.2 * len(flights), 8.0), layout="constrained")
    grid = figure.subplots(3, len(flights), sharex="col", squeeze=False)
    for column, rows in enumerate(flights):
        _draw(list(grid[:, column]), rows.sort("timestamp"))
    for ax, label in zip(grid[:, 0], PANELS, strict=True):
        ax.set_ylabel(label)
    tidy(grid.flat)
    legend_below(figure, grid.flat, columns=2 * len(flights))
    return figure


def _draw(axes: Sequence[Axes], rows: pl.DataFrame) -> None:
    minutes = ((rows["timestamp"] - rows["timestamp"][0]).dt.total_microseconds() / 60e6).to_numpy()
    altitude_ft = rows["altitude"].to_numpy()
    channels = (altitude_ft / 100, rows["vertical_rate"].to_numpy(), rows["IAS"].to_numpy())
    axes[2].plot(minutes, cas_of_mach_kt(rows["Mach"].to_numpy(), altitude_ft), color="#9a9a9a", linewidth=0.7)
    reasons = rows["reason"].to_list()
    # Kept rows first, so that the few dropped ones lie on top of them.
    for reason in [None, *sorted({r for r in reasons if r is not None})]:
        of = np.array([r == reason for r in reasons])
        if not of.any():
            continue
        colour, marker, size = look(reason)
        name = "kept" if reason is None else reason.replace("_", " ")
        for ax, values in zip(axes, channels, strict=True):
            ax.scatter(minutes[of], values[of], c=colour, marker=marker, s=size, linewidths=0.9, label=name)
    axes[1].axhline(-500.0, color="#5a5a5a", linewidth=1.0, linestyle=":")
    # A spike must not squeeze all else into a line.
    rates = channels[1][np.isfinite(channels[1])]
    if len(rates):
        axes[1].set_ylim(max(rates.min() - 200, -6500.0), min(rates.max() + 200, 5000.0))
    axes[0].set_title(f"{rows['flight_id'][0]}  {rows['typecode'][0]}", fontsize=10)
    axes[2].set_xlabel("minutes")
