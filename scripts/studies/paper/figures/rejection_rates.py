"""Shares of draws that were rejected as implausible, by type and model (paper, section 4.2)."""

from collections.abc import Mapping

from matplotlib.figure import Figure

from descentflow.reporting.figure_style import MODELS, panels


def rejection_rates_figure(rates: Mapping[str, Mapping[str, float]]) -> Figure:
    """Bars of the share of draws that were rejected: a group per type, a bar per model.

    Args:
        rates: Type -> model's name -> share of its draws that were not plausible.

    Example:
        >>> figure = rejection_rates_figure({"B738": {"Gaussian": 0.05, "Masked affine flow": 0.04}})
        >>> len(figure.axes[0].patches)
        2
    """
    models = list(dict.fromkeys(name for by_model in rates.values() for name in by_model))
    figure, ((ax,),) = panels(max(7.5, 2.2 + 0.75 * len(rates)), 3.4)
    width = 0.8 / len(models)
    for place, model in enumerate(models):
        at = [group + (place - (len(models) - 1) / 2) * width for group in range(len(rates))]
        heights = [100 * by_model.get(model, float("nan")) for by_model in rates.values()]
        ax.bar(at, heights, 0.9 * width, color=MODELS[place % len(MODELS)][0], label=model)
    ax.set_xticks(range(len(rates)), list(rates))
    ax.set_ylabel("Draws rejected (%)")
    figure.legend(loc="outside lower center", ncols=len(models), frameon=False, fontsize=9)
    return figure
