"""Figures of the sweeps: explained variance, completed gappy flights, sizes of the flow (paper, appendices A to C)."""

from collections.abc import Mapping, Sequence

import polars as pl
from matplotlib.figure import Figure
from torch import Tensor

from descentflow.reporting.figure_style import BLACK, GREY, MODELS, legend_below, panels
from studies.paper.study_plan import PAPER_STATISTICS

STATISTICS = {name: f"{one.label} of rate" for name, one in PAPER_STATISTICS.items()}


def variance_figure(scores: pl.DataFrame) -> Figure:
    """Box plots of the scores of rate against the share of variance explained (paper, appendix B).

    Args:
        scores: Columns ``typecode share fold statistic unit score``; a value of each box is a type and fold, the mean
            of above and below the transition.

    Example:
        >>> row = {"typecode": "A320", "share": 0.8, "statistic": "ks", "unit": "1"}
        >>> scores = pl.DataFrame([row | {"fold": k, "score": 0.1 + 0.01 * k} for k in range(5)])
        >>> [ax.get_ylabel() for ax in variance_figure(scores).axes][0]
        'KS distance of rate'
    """
    figure, (axes,) = panels(11.5, 3.8, 1, len(STATISTICS))
    shares = sorted(scores["share"].unique())
    for ax, (statistic, name) in zip(axes, STATISTICS.items(), strict=True):
        chosen = scores.filter(pl.col("statistic") == statistic, pl.col("score").is_not_nan())
        each = chosen.group_by("share", "typecode", "fold").agg(pl.col("score").mean())
        values = [each.filter(share=share)["score"].to_list() for share in shares]
        drawn = ax.boxplot(values, widths=0.6, patch_artist=True, flierprops={"marker": ".", "markersize": 3})
        for box, line in zip(drawn["boxes"], drawn["medians"], strict=True):
            box.set(facecolor="#c9d7e6", edgecolor=BLACK, linewidth=0.8)
            line.set(color=BLACK, linewidth=1.8)
        ax.plot(
            range(1, len(shares) + 1), [sum(v) / len(v) if v else float("nan") for v in values], "x", color=MODELS[0][0]
        )
        ax.set_xticks(range(1, len(shares) + 1), [f"{100 * share:.0f}" for share in shares])
        unit = chosen["unit"][0] if len(chosen) else "1"
        ax.set(xlabel="Variance explained (%)", ylabel=name + ("" if unit == "1" else f" ({unit})"))
        ax.set_ylim(bottom=0)
    return figure


def completed_figure(
    levels_fl: Tensor, seen: Mapping[str, tuple[Tensor, Tensor]], completed: Mapping[str, Mapping[str, Tensor]]
) -> Figure:
    """Gappy flights and what each method makes of the levels that they lack (paper, appendix A).

    Args:
        levels_fl: (L,) ascending.
        seen: Quantity and unit -> values (n, L) and mask (n, L) of a few flights.
        completed: Quantity -> method -> whole profiles (n, L).

    Example:
        >>> levels, whole = torch.arange(100, 300), torch.full((2, 200), 280.0)
        >>> seen = {"CAS (kt)": (whole, torch.rand(2, 200) > 0.3)}
        >>> len(completed_figure(levels, seen, {"CAS (kt)": {"probabilistic PCA": whole}}).axes)
        1
    """
    figure, (axes,) = panels(5.2 * len(seen), 4.6, 1, len(seen), sharey=True)
    for ax, (quantity, (values, mask)) in zip(axes, seen.items(), strict=True):
        for place, (method, whole) in enumerate(completed[quantity].items()):
            for k in range(len(values)):
                style = {"color": MODELS[place][0], "linestyle": MODELS[place][1], "linewidth": 1.3}
                missing = [float("nan") if m else float(v) for v, m in zip(whole[k], mask[k], strict=True)]
                ax.plot(missing, levels_fl, label=method if k == 0 else None, **style)
        for k in range(len(values)):
            own = [float(v) if m else float("nan") for v, m in zip(values[k], mask[k], strict=True)]
            ax.plot(own, levels_fl, color=BLACK, linewidth=1.4, label="observed" if k == 0 else None)
        ax.set_xlabel(quantity)
    axes[0].set_ylabel("Flight level")
    legend_below(figure, axes)
    return figure


def flow_sizes_figure(gains: Mapping[int, Mapping[int, Sequence[float]]]) -> Figure:
    """Held-out NLL of flows of several sizes minus that of the paper's size, a dot per type and a line of means.

    Args:
        gains: Number of flows -> hidden units per weight -> differences of the types, nats.

    Example:
        >>> flow_sizes_figure({5: {2: [0.0, 0.0], 4: [-0.1, 0.05]}}).axes[0].get_xlabel()
        'Hidden units per weight'
    """
    figure, ((ax,),) = panels(7.5, 3.8)
    places = {h: k for k, h in enumerate(sorted({h for by_hidden in gains.values() for h in by_hidden}))}
    for position, (flows, by_hidden) in enumerate(gains.items()):
        shift = 0.12 * (position - (len(gains) - 1) / 2)
        colour, dashes = MODELS[position % len(MODELS)]
        at = [places[h] + shift for h in by_hidden]
        means = [sum(values) / len(values) for values in by_hidden.values()]
        ax.plot(at, means, color=colour, linestyle=dashes, marker="o", label=f"{flows} flows")
        for x, values in zip(at, by_hidden.values(), strict=True):
            ax.plot([x] * len(values), values, ".", color=colour, alpha=0.45, markersize=4)
    ax.axhline(0, color=GREY, linewidth=1)
    ax.set_xticks(list(places.values()), [str(h) for h in places])
    ax.set(xlabel="Hidden units per weight", ylabel="NLL minus that of the paper's size (nats)")
    legend_below(figure, [ax])
    return figure
