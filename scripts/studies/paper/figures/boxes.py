"""Box plots of scores over aircraft types (paper, figure 7)."""

from collections.abc import Mapping, Sequence

import polars as pl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from descentflow.reporting.figure_style import BLACK, GREY, panels
from studies.paper.study_plan import PAPER_STATISTICS

ROWS = {
    "Time to bottom": {"": "time_to_bottom_of_descent"},
    "CAS": {"above": "cas_above_transition", "at or below": "cas_below_transition"},
    "Rate": {"above": "rocd_above_transition", "at or below": "rocd_below_transition"},
}
"""Row of panels -> name of each box of a model -> quantity."""
COLUMNS = PAPER_STATISTICS
_FILLS = {"": "#c9d7e6", "above": "#bcd7ea", "at or below": "#f2c9d0"}


def boxes_figure(scores: pl.DataFrame, models: Mapping[str, str]) -> Figure:
    """Scores of each model over types: quartiles, median, whiskers to 1.5 interquartile ranges, each type as a dot.

    Boxes in pairs are above (blue) and at or below (pink) the transition altitude. ``floor`` is the distance of
    held-out flights from as many others; nominal BADA has only an error of the mean, drawn on a logarithmic axis.

    Args:
        scores: Columns ``quantity statistic unit model score floor nominal``, one row per type, quantity, statistic
            and model.
        models: Model -> its name in the figure, in order.

    Returns:
        A figure of three rows (time, CAS, rate) and three columns (KS, Wasserstein, error of the mean).

    Example:
        >>> row = {"quantity": "time_to_bottom_of_descent", "statistic": "ks", "unit": "1", "model": "gaussian"}
        >>> scores = pl.DataFrame([row | {"score": s, "floor": 0.1, "nominal": None} for s in (0.2, 0.3)])
        >>> len(boxes_figure(scores, {"gaussian": "Gaussian"}).axes)
        9
    """
    figure, axes = panels(11.5, 9.6, len(ROWS), len(COLUMNS))
    for line, (name, parts) in zip(axes, ROWS.items(), strict=True):
        for ax, (statistic, entry) in zip(line, COLUMNS.items(), strict=True):
            chosen = scores.filter(pl.col("statistic") == statistic, pl.col("quantity").is_in(list(parts.values())))
            unit = str(chosen["unit"][0]) if len(chosen) else "1"
            _draw(ax, chosen, parts, models, with_nominal=entry.of_one is not None)
            ax.set_title(f"{name}: {entry.label}" + ("" if unit == "1" else f" ({unit})"), fontsize=10)
    handles = [axes[1, 0].bar([0], [0], color=_FILLS[part]) for part in ("above", "at or below")]
    figure.legend(
        handles,
        ["above transition", "at or below transition"],
        loc="outside lower center",
        ncols=2,
        frameon=False,
        fontsize=9,
    )
    return figure


def box_values(
    chosen: pl.DataFrame, models: Mapping[str, str], *, with_nominal: bool
) -> list[tuple[str, Sequence[float]]]:
    """Name and values over types of each box of one quantity and statistic: models, floor, nominal BADA.

    Args:
        chosen: Scores of one quantity and statistic, a row per type and model, as :func:`boxes_figure` takes them.
        models: Model -> its name in the figure.
        with_nominal: Whether nominal BADA has this statistic.

    Example:
        >>> scores = pl.DataFrame({"model": ["gmm", "gmm"], "score": [0.1, 0.3], "floor": [0.05, 0.06]})
        >>> box_values(scores, {"gmm": "Gaussian mixture"}, with_nominal=False)
        [('Gaussian mixture', [0.1, 0.3]), ('floor', [0.05, 0.06])]
    """
    first = next(iter(models))
    boxes: list[tuple[str, Sequence[float]]] = [
        (name, chosen.filter(pl.col("model") == m)["score"].drop_nulls().to_list()) for m, name in models.items()
    ]
    boxes.append(("floor", chosen.filter(pl.col("model") == first)["floor"].drop_nulls().to_list()))
    if with_nominal:
        boxes.append(("BADA", chosen.filter(pl.col("model") == first)["nominal"].drop_nulls().to_list()))
    return boxes


def _draw(
    ax: Axes, chosen: pl.DataFrame, parts: Mapping[str, str], models: Mapping[str, str], *, with_nominal: bool
) -> None:
    width = 0.62 / len(parts)
    names: list[str] = []
    for place, (part, quantity) in enumerate(parts.items()):
        boxes = box_values(chosen.filter(pl.col("quantity") == quantity), models, with_nominal=with_nominal)
        names = [name for name, _ in boxes]
        for position, (_, values) in enumerate(boxes):
            if not values:
                continue
            at = position + (place - (len(parts) - 1) / 2) * 1.15 * width
            drawn = ax.boxplot(
                [values], positions=[at], widths=width, patch_artist=True, showfliers=False, manage_ticks=False
            )
            drawn["boxes"][0].set(facecolor=_FILLS[part], edgecolor=BLACK, linewidth=0.8)
            drawn["medians"][0].set(color=BLACK, linewidth=1.8)
            ax.plot([at] * len(values), values, ".", color=GREY, markersize=3.5)
    ax.set_xticks(range(len(names)), [name.replace(" ", "\n") for name in names], fontsize=7.5)
    if with_nominal:
        ax.set_yscale("log")
    else:
        ax.set_ylim(bottom=0)
