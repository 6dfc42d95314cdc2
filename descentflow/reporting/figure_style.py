"""Colours and axes that all figures share: readable at 100 dpi, and by readers who do not tell all colours apart."""

from collections.abc import Iterable
from textwrap import fill
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

BLACK, BLUE, RED, GREY = "#000000", "#0072b2", "#d55e00", "#8c8c8c"
"""Nominal BADA, held-out flights, samples, single descents (Okabe and Ito's palette)."""
BAND = "#bcd7ea"
"""Colour of the band in which scores of equal distributions lie."""
MODELS = (
    ("#d55e00", "--"),
    ("#009e73", "-."),
    ("#cc79a7", ":"),
    ("#e69f00", (0, (5, 1, 1, 1, 1, 1))),
)
"""Colour and dashes of each model in turn, so that no model is known by its colour alone."""


def model_style(position: int) -> dict[str, Any]:
    """Line style of the model at this position; styles repeat after the fourth.

    Example:
        >>> model_style(0)["color"], model_style(4) == model_style(0)
        ('#d55e00', True)
    """
    colour, dashes = MODELS[position % len(MODELS)]
    return {"color": colour, "linestyle": dashes, "linewidth": 1.8}


def tidy(axes: Iterable[Axes]) -> None:
    """A light grid behind the data and no frame above or to the right.

    Example:
        >>> ax = Figure().subplots()
        >>> tidy([ax])
        >>> ax.spines["top"].get_visible()
        False
    """
    for ax in axes:
        ax.grid(color="#e0e0e0", linewidth=0.6)
        ax.set_axisbelow(True)
        ax.spines[["top", "right"]].set_visible(False)
        ax.tick_params(labelsize=9)


def panels(width_in: float, height_in: float, rows: int = 1, columns: int = 1, **shared: Any) -> tuple[Figure, Any]:
    """A figure and its tidy panels (rows, columns).

    Args:
        width_in: Width of the figure in inches.
        height_in: Height of it.
        rows: Of panels.
        columns: Of panels.
        shared: Options of matplotlib's `Figure.subplots`, which axes are shared among them.

    Example:
        >>> figure, ((left, right),) = panels(6.0, 3.0, 1, 2, sharey=True)
        >>> len(figure.axes)
        2
    """
    figure = Figure(figsize=(width_in, height_in), layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False, **shared)
    tidy(axes.flat)
    return figure, axes


def say_why_empty(ax: Axes, why: str) -> None:
    """Write in a panel that has nothing to show why that is so; an empty one looks like a fault.

    Example:
        >>> ax = Figure().subplots()
        >>> say_why_empty(ax, "no draw was rejected")
        >>> ax.texts[0].get_text()
        'no draw was rejected'
    """
    ax.text(
        0.5, 0.5, fill(why, 30), transform=ax.transAxes, ha="center", va="center", fontsize=9, color="#555555"
    )  # fmt: skip


def legend_below(figure: Figure, axes: Iterable[Axes], columns: int = 5) -> None:
    """One legend below all panels, each name once.

    Example:
        >>> figure = Figure()
        >>> panels = figure.subplots(1, 2)
        >>> lines = [ax.plot([0, 1], label="flights") for ax in panels]
        >>> legend_below(figure, panels)
        >>> [text.get_text() for text in figure.legends[0].get_texts()]
        ['flights']
    """
    named = {name: handle for ax in axes for handle, name in zip(*ax.get_legend_handles_labels(), strict=True)}
    if named:
        columns = min(len(named), columns)
        figure.legend(
            list(named.values()), list(named), loc="outside lower center", ncols=columns, frameon=False, fontsize=9
        )
