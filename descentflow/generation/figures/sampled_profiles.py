"""Sampled descents as a picture: what `descentflow sample --figure` draws."""

from matplotlib.figure import Figure

from descentflow.core.errors import DataError
from descentflow.generation.figures.quantile_bands import CAS, LINES, RATE, curves_of, draw_bands
from descentflow.reporting.figure_style import legend_below, tidy
from descentflow.representation.decoder.trajectories import Trajectories


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
    panels = {CAS: curves[CAS], RATE: curves[RATE]}
    panels[f"Time left to FL{levels[0]:.0f} (min)"] = (seconds[:, :1] - seconds) / 60
    figure = Figure(figsize=(10.5, 4.9), layout="constrained")
    axes = figure.subplots(1, 3, sharey=True)
    tidy(axes)
    for ax, (name, values) in zip(axes, panels.items(), strict=True):
        draw_bands(ax, levels, values, seed=seed, lines=lines)
        ax.set_xlabel(name)
    axes[0].set_ylabel("Flight level")
    axes[0].set_ylim(levels[0], levels[-1])
    axes[-1].set_xlim(left=0)
    legend_below(figure, axes)
    figure.suptitle(title or f"{len(flown):,} samples", fontsize=12, fontweight="bold")
    return figure
