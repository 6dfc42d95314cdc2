"""Held-out and sampled descents side by side (paper, figures 4 to 6)."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import torch
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from torch import Tensor

from descentflow.core.errors import DataError
from descentflow.core.units import KT_MPS
from descentflow.evaluation.metrics.descent_set import DescentSet
from descentflow.reporting.figure_style import BLACK, BLUE, GREY, RED, legend_below, panels

_QUANTITIES = ("Drag (kN)", "CAS (kt)", "Time since entry (min)")
_MARGIN = 0.1
"""Share of the flights' range that is shown beyond it."""
Fields = tuple[Tensor, Tensor, Tensor]
"""Drag (kN), CAS (kt) and time since entry (min)."""


def profiles_figure(
    real: DescentSet,
    samples: Mapping[str, DescentSet],
    nominal: DescentSet,
    *,
    n_lines: int = 60,
    title: str = "",
) -> Figure:
    """Drag, CAS and time against flight level: held-out flights, then the samples of each model.

    Thin lines are single descents, broken where a level is missing. Means are taken at each level over the descents
    observed there; of time, over the descents that span the grid, for others start their clock elsewhere. The axes
    show the range of the flights and of the nominal descent: samples far beyond leave the panel.

    Args:
        real: Held-out flights, at least one.
        samples: Name of each model and its samples; one column each, in this order.
        nominal: The nominal BADA descent.
        n_lines: Single descents drawn in a column, picked at random.
        title: Written above all, for instance the type.

    Returns:
        A figure of three rows and a column for the flights and for each model.

    Raises:
        DataError: If there is no flight.

    Example:
        >>> from descentflow.evaluation.evaluate import evaluate
        >>> judged = evaluate("best.ckpt", "descents.parquet", n=200, n_splits=1)
        >>> figure = profiles_figure(judged.real, {"gaussian": judged.samples}, judged.nominal, title="A320")
        >>> figure.axes[0].get_title()
        'held out (n = 24)'
    """
    if not bool(real.mask.any()):
        raise DataError("no held-out flight to draw", expected="at least one", mend="split more flights")
    columns = {f"held out (n = {len(real):,})": real}
    columns |= {f"{name} (n = {len(drawn):,})": drawn for name, drawn in samples.items()}
    figure, axes = panels(2.2 + 2.7 * len(columns), 8.4, 3, len(columns), sharex="row", sharey=True)
    plain = (nominal.levels_fl, *(values[0] for values in _fields(nominal)))
    means = (real.levels_fl, *_means(real))
    for column, (name, descents) in enumerate(columns.items()):
        axes[0, column].set_title(name, fontsize=10)
        for ax, curves in zip(axes[:, column], _curves(descents, n_lines), strict=True):
            ax.plot(curves, np.asarray(descents.levels_fl), color=GREY, linewidth=0.6, alpha=0.45)
        _draw(axes[:, column], *plain, color=BLACK, linewidth=1.6, label="nominal BADA")
        _draw(axes[:, column], *means, color=BLUE, linestyle="--", linewidth=1.8, label="mean of held out")
        if column:
            own = (descents.levels_fl, *_means(descents))
            _draw(axes[:, column], *own, color=RED, linestyle=":", linewidth=2.2, label="mean of samples")
    _label(axes, real, nominal)
    legend_below(figure, axes.flat)
    if title:
        figure.suptitle(title, fontsize=12, fontweight="bold")
    return figure


def _fields(descents: DescentSet) -> Fields:
    """Each (n, L), NaN where not observed."""
    fields = descents.drag_n / 1000, descents.cas_mps / KT_MPS, since_entry_s(descents) / 60
    drag, cas, time = (torch.where(descents.mask, values.double(), torch.nan) for values in fields)
    return drag, cas, time


def since_entry_s(descents: DescentSet) -> Tensor:
    """Seconds (n, L) since each descent's highest observed level; masked values are meaningless.

    Example:
        >>> from descentflow.generation.sample import sample
        >>> flown = DescentSet.of_trajectories(sample("best.ckpt", 5, entry_fl=330).trajectories)
        >>> at_entry = int((flown.levels_fl == 330).nonzero())
        >>> since_entry_s(flown)[:, at_entry]
        tensor([0., 0., 0., 0., 0.], dtype=torch.float64)
    """
    positions = torch.arange(len(descents.levels_fl), device=descents.mask.device)
    entry = torch.where(descents.mask, positions, 0).amax(1, keepdim=True)
    return descents.time_s - descents.time_s.gather(1, entry)


def _curves(descents: DescentSet, n_lines: int) -> tuple[np.ndarray, ...]:
    """The picked descents as columns, for one call of ``plot``."""
    picked = torch.randperm(len(descents), generator=torch.Generator().manual_seed(0))[:n_lines]
    return tuple(values.T.numpy() for values in _fields(descents.subset(picked)))


def _means(descents: DescentSet) -> Fields:
    """Each (L,), NaN where nothing is observed."""
    drag, cas, time = _fields(descents)
    return drag.nanmean(0), cas.nanmean(0), time[descents.spans_grid()].nanmean(0)


def _draw(axes: np.ndarray, levels_fl: Tensor, *curves: Tensor, **style: Any) -> None:
    for ax, curve in zip(axes, curves, strict=True):
        ax.plot(curve, levels_fl, **style)


def _label(axes: np.ndarray, real: DescentSet, nominal: DescentSet) -> None:
    for row, name in enumerate(_QUANTITIES):
        shown = [_fields(descents)[row] for descents in (real, nominal)]
        _limit(axes[row, 0], torch.cat([values.flatten() for values in shown]))
        axes[row, 0].set_ylabel("Flight level")
        for ax in axes[row]:
            ax.set_xlabel(name)
    axes[0, 0].set_ylim(float(real.levels_fl[0]), float(real.levels_fl[-1]))


def _limit(ax: Axes, values: Tensor) -> None:
    """Fit the axis to the finite values, with a margin."""
    values = values[values.isfinite()]
    low, high = float(values.min()), float(values.max())
    margin = _MARGIN * (high - low) or 1.0
    ax.set_xlim(low - margin, high + margin)
