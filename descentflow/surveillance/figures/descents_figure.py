"""Prepared descents as a picture: indicated airspeed and vertical rate against flight level."""

import numpy as np
import polars as pl
from matplotlib.figure import Figure

from descentflow.reporting.figure_style import BLUE, tidy

LINES = 100
"""Flights that are drawn, at random."""
PANELS = {"IAS": "IAS (kt)", "vertical_rate": "Vertical rate (ft/min)"}


def descents_figure(descents: pl.DataFrame, *, seed: int = 0) -> Figure:
    """Draw up to 100 flights.

    Args:
        descents: Prepared descents, a row for each flight and level.
        seed: Of the flights that are drawn.

    Example:
        >>> figure = descents_figure(pl.read_parquet("descents.parquet"))
        >>> [ax.get_xlabel() for ax in figure.axes], len(figure.axes[0].lines)
        (['IAS (kt)', 'Vertical rate (ft/min)'], 100)
    """
    names = descents["flight_id"].unique().sort().to_list()
    drawn = np.random.default_rng(seed).permutation(names)[:LINES].tolist()
    figure = Figure(figsize=(8.4, 4.2), layout="constrained")
    axes = figure.subplots(1, 2, sharey=True)
    tidy(axes)
    for flight in descents.filter(pl.col("flight_id").is_in(drawn)).partition_by("flight_id"):
        for ax, name in zip(axes, PANELS, strict=True):
            ax.plot(flight[name].to_numpy(), flight["level_fl"].to_numpy(), color=BLUE, linewidth=0.7, alpha=0.35)
    for ax, label in zip(axes, PANELS.values(), strict=True):
        ax.set_xlabel(label)
    axes[0].set_ylabel("Flight level")
    figure.suptitle(f"{len(drawn):,} of {len(names):,} descents", fontsize=12, fontweight="bold")
    return figure
