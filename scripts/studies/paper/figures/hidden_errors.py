"""Error on hidden levels by method and pattern of gaps."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.figure import Figure

from descentflow.reporting.figure_style import MODELS, tidy
from studies.paper.hidden_levels import METHODS, HiddenError


def gappy_figure(found: Mapping[str, Sequence[HiddenError]], units: Mapping[str, str]) -> Figure:
    """Bars of the root mean square error: a panel per quantity, a group per pattern of gaps, a bar per method.

    Args:
        found: Quantity (``drag``, ``CAS``) -> errors of every method and pattern.
        units: Quantity -> its unit.

    Example:
        >>> errors = [HiddenError(method, "top", 3.0, n_flights=40, n_levels=900) for method in METHODS]
        >>> len(gappy_figure({"CAS": errors}, {"CAS": "kt"}).axes)
        1
    """
    figure = Figure(figsize=(9.0, 3.6), layout="constrained")
    axes = figure.subplots(1, len(found), squeeze=False)[0]
    for ax, (quantity, errors) in zip(axes, found.items(), strict=True):
        patterns = list(dict.fromkeys(e.pattern for e in errors))
        for place, method in enumerate(METHODS):
            heights = [next(e.rmse for e in errors if (e.method, e.pattern) == (method, p)) for p in patterns]
            at = np.arange(len(patterns)) + 0.2 * (place - 1.5)
            bars = ax.bar(at, heights, 0.19, label=method, color=MODELS[place][0])
            ax.bar_label(bars, fmt="%.3g", fontsize=8)
        ax.set_xticks(np.arange(len(patterns)), [f"hidden: {p}" for p in patterns])
        ax.set(ylabel=f"{quantity}: rmse on hidden levels ({units[quantity]})")
    tidy(axes)
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=4, frameon=False, fontsize=9)
    return figure
