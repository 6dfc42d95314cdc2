"""Distributions of time to bottom, and of CAS and rate at one level (paper, figures 8 and 9)."""

import math
from collections.abc import Mapping
from typing import Any

import torch
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from torch import Tensor

from descentflow.core.errors import DataError
from descentflow.core.units import FPM_MPS, KT_MPS
from descentflow.evaluation.metrics.descent_set import DescentSet
from descentflow.evaluation.metrics.distances import MIN_VALUES
from descentflow.reporting.figure_style import BLACK, BLUE, legend_below, model_style, panels, say_why_empty

_POINTS = 400
_MARGIN_BANDWIDTHS = 4.0


def cuts_figure(
    real: DescentSet,
    samples: Mapping[str, DescentSet],
    nominal: DescentSet,
    level_fl: float,
    *,
    title: str = "",
) -> Figure:
    """Density and distribution function of time to bottom, CAS and rate.

    Densities of all sets are smoothed alike, by the bandwidth that the flights deserve, so that a difference between
    curves is one between sets. Vertical lines show the means, and nominal BADA's one value.

    Args:
        real: Held-out flights.
        samples: Name of each model and its samples.
        nominal: The nominal BADA descent; an empty set for none.
        level_fl: Where CAS and rate are taken, for instance the transition; the grid's nearest level is drawn.
        title: Written above all.

    Returns:
        A figure of two rows (density, distribution function) and three columns.

    Raises:
        DataError: If a set lies on another grid.

    Example:
        >>> from descentflow.evaluation.evaluate import evaluate
        >>> evaluation = evaluate("best.ckpt", "descents.parquet", n=200, n_splits=1)
        >>> figure = cuts_figure(evaluation.real, {"gaussian": evaluation.samples}, evaluation.nominal, level_fl=287.0)
        >>> figure.axes[4].get_xlabel()
        'CAS at FL287 (kt)'
    """
    sets = {"held out": real, **samples, "nominal BADA": nominal}
    for name, descents in sets.items():
        if not torch.equal(descents.levels_fl, real.levels_fl):
            raise DataError(f"{name} on another grid", expected="one grid for all", mend="use the checkpoint's grid")
    position = int((real.levels_fl - level_fl).abs().argmin())
    level = int(real.levels_fl[position])
    figure, axes = panels(11.0, 6.2, 2, 3, sharex="col")
    names = ("Time to bottom (s)", f"CAS at FL{level} (kt)", f"Rate at FL{level} (ft/min)")
    cuts = {name: _cut(descents, position) for name, descents in sets.items()}
    for column, name in enumerate(names):
        _draw_column(axes[:, column], {key: values[column] for key, values in cuts.items()})
        axes[1, column].set_xlabel(name)
    axes[0, 0].set_ylabel("Density (1/s, 1/kt, 1/(ft/min))")
    axes[1, 0].set_ylabel("Distribution function (1)")
    legend_below(figure, axes.flat)
    if title:
        figure.suptitle(title, fontsize=12, fontweight="bold")
    return figure


def _cut(descents: DescentSet, position: int) -> tuple[Tensor, Tensor, Tensor]:
    there = descents.mask[:, position]
    cas = descents.cas_mps[there, position] / KT_MPS
    return descents.time_to_bottom_s().abs(), cas, descents.rate_mps[there, position] / FPM_MPS


def _draw_column(axes: list[Axes], values: Mapping[str, Tensor]) -> None:
    """Density above, distribution function below, each set in its style."""
    real = values["held out"].double()
    if len(real) < MIN_VALUES:
        for ax in axes:
            say_why_empty(ax, f"{len(real)} held-out flights were seen here: {MIN_VALUES} are needed.")
        return
    width = bandwidth(real)
    for position, (name, drawn) in enumerate(values.items()):
        if not len(drawn):
            continue
        style = _style(name, position - 1)
        if name != "nominal BADA" and len(drawn) >= MIN_VALUES:
            points = _support(drawn.double(), width)
            axes[0].plot(points, density(drawn.double(), points, width), label=name, **style)
            axes[1].ecdf(drawn.double().numpy(), label=name, **style)
        for ax in axes:
            mean = {**style, "linewidth": 1.6 if name == "nominal BADA" else 1.0}
            ax.axvline(float(drawn.mean()), label=name if name == "nominal BADA" else None, **mean)
    axes[0].set_ylim(bottom=0)
    axes[1].set_ylim(0, 1)


def _style(name: str, position: int) -> dict[str, Any]:
    if name == "held out":
        return {"color": BLUE, "linestyle": "-", "linewidth": 2.0}
    return {"color": BLACK, "linestyle": (0, (6, 3))} if name == "nominal BADA" else model_style(position)


def bandwidth(values: Tensor) -> float:
    """Silverman's rule ``0.9 min(s, IQR / 1.34) n^(-1/5)``, which smooths several modes less than the plain one.

    Args:
        values: (n,), n at least 2.

    Returns:
        In the unit of the values; above zero even where all values are equal.

    Example:
        >>> round(bandwidth(torch.arange(32.0)), 2)  # in kt if the values are
        4.22
    """
    quartiles = values.quantile(torch.tensor([0.25, 0.75], dtype=values.dtype))
    spreads = [float(values.std()), float(quartiles.diff()) / 1.34]
    spread = min((s for s in spreads if s > 0), default=max(abs(float(values[0])), 1.0) * 1e-3)
    return 0.9 * spread / math.pow(len(values), 0.2)


def density(values: Tensor, points: Tensor, width: float) -> Tensor:
    """Gaussian kernel density (p,) of values (n,) at points (p,).

    Example:
        >>> density(torch.zeros(5), torch.tensor([0.0, 1.0]), width=1.0)  # the standard normal
        tensor([0.3989, 0.2420])
    """
    kernels = torch.exp(-0.5 * ((points[:, None] - values) / width) ** 2)
    return kernels.mean(1) / (width * math.sqrt(2 * math.pi))


def _support(values: Tensor, width: float) -> Tensor:
    margin = _MARGIN_BANDWIDTHS * width
    return torch.linspace(float(values.min()) - margin, float(values.max()) + margin, _POINTS, dtype=torch.float64)
