"""Profiles against flight level as quantile bands with single descents before them: `descentflow sample --figure`."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from descentflow.core.errors import DataError
from descentflow.core.units import FPM_MPS, KT_MPS
from descentflow.reporting.figure_style import GREY, RED, legend_below, panels
from descentflow.representation.decoder.trajectories import Trajectories

FEWEST_FOR_A_BAND = 20
"""Descents at a level from which it has a band: of fewer, a quantile of 5 % lies beyond all of them."""
LINES = 30
"""Single descents that are drawn: more of them hide the bands, fewer do not show how one goes."""
OUTER, INNER = "#f6d9c6", "#e9a87c"
"""5 to 95 %, and 25 to 75 %: also on paper without colour one is lighter than the other."""
CAS, RATE = "CAS (kt)", "Vertical rate (ft/min)"


def curves_of(flown: Trajectories) -> dict[str, np.ndarray]:
    """CAS, vertical rate, and seconds since each descent's entry, NaN above it.

    Example:
        >>> from descentflow.generation.sample import sample
        >>> curves = curves_of(sample("best.ckpt", 5, entry_fl=330).trajectories)
        >>> list(curves), curves["CAS (kt)"].shape[0]
        (['CAS (kt)', 'Vertical rate (ft/min)', 'time_s'], 5)
    """
    seen = flown.mask.cpu().numpy()
    tensors = {CAS: flown.cas_mps / KT_MPS, RATE: flown.rate_mps / FPM_MPS, "time_s": flown.time_s}
    return {name: np.where(seen, values.detach().cpu().double().numpy(), np.nan) for name, values in tensors.items()}


def draw_bands(ax: Axes, levels_fl: np.ndarray, values: np.ndarray, *, seed: int = 0, lines: int = LINES) -> None:
    """Bands of 5 to 95 % and 25 to 75 %, the median, and some of the descents.

    Args:
        ax: Panel whose vertical axis is the flight level.
        levels_fl: (L,).
        values: (n, L), NaN where a descent is not.
        seed: Of the descents that are picked.
        lines: How many are picked.

    Example:
        >>> from matplotlib.figure import Figure
        >>> ax = Figure().subplots()
        >>> draw_bands(ax, np.array([150.0, 160.0]), np.random.default_rng(0).normal(280, 10, (50, 2)))
        >>> ax.get_legend_handles_labels()[1]
        ['5 to 95 % of samples', '25 to 75 %', 'single samples', 'median']
    """
    there = np.isfinite(values).sum(0) >= FEWEST_FOR_A_BAND
    if there.any():
        low, lower, middle, upper, high = np.nanquantile(values[:, there], [0.05, 0.25, 0.5, 0.75, 0.95], axis=0)
        levels = levels_fl[there]
        ax.fill_betweenx(levels, low, high, color=OUTER, linewidth=0, label="5 to 95 % of samples")
        ax.fill_betweenx(levels, lower, upper, color=INNER, linewidth=0, label="25 to 75 %")
    picked = np.random.default_rng(seed).permutation(len(values))[:lines]
    for number, sample in enumerate(picked):
        label = "single samples" if number == 0 else None
        ax.plot(values[sample], levels_fl, color=GREY, linewidth=0.5, alpha=0.6, label=label)
    if there.any():
        ax.plot(middle, levels, color=RED, linestyle="--", linewidth=2.0, label="median")


def samples_figure(flown: Trajectories, *, title: str = "", seed: int = 0, lines: int = LINES) -> Figure:
    """CAS, vertical rate and time left against flight level, as quantile bands with some of the samples.

    Times count to the lowest level, which all samples reach, for they enter at levels of their own. A level that fewer
    than 20 samples pass has no band.

    Args:
        flown: Samples, at least one.
        title: Written above all.
        seed: Of the samples that are drawn as lines.
        lines: How many are.

    Raises:
        DataError: If there is no sample.

    Example:
        >>> from descentflow.generation.sample import sample
        >>> figure = samples_figure(sample("best.ckpt", 100).trajectories, title="A320")
        >>> [ax.get_xlabel() for ax in figure.axes]
        ['CAS (kt)', 'Vertical rate (ft/min)', 'Time left to FL150 (min)']
    """
    if len(flown) == 0:
        raise DataError("no sample to draw", expected="at least one", mend="sample more")
    curves = curves_of(flown)
    seconds = curves.pop("time_s")
    levels = flown.levels_fl.cpu().double().numpy()
    shown = {CAS: curves[CAS], RATE: curves[RATE]}
    shown[f"Time left to FL{levels[0]:.0f} (min)"] = (seconds[:, :1] - seconds) / 60
    figure, (axes,) = panels(10.5, 4.9, 1, 3, sharey=True)
    for ax, (name, values) in zip(axes, shown.items(), strict=True):
        draw_bands(ax, levels, values, seed=seed, lines=lines)
        ax.set_xlabel(name)
    axes[0].set_ylabel("Flight level")
    axes[0].set_ylim(levels[0], levels[-1])
    axes[-1].set_xlim(left=0)
    legend_below(figure, axes)
    figure.suptitle(title or f"{len(flown):,} samples", fontsize=12, fontweight="bold")
    return figure
