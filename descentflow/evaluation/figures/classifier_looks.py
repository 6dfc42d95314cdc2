"""Figure of the classifier's use of quantities: loss of its AUC by quantity and band of levels."""

from matplotlib.figure import Figure

from descentflow.evaluation.metrics.classifier import QUANTITIES, Detection
from descentflow.reporting.figure_style import BLUE, GREY, tidy


def classifier_figure(found: Detection) -> Figure:
    """Draw how much the AUC loses when a quantity is exchanged between flights and samples, band by band.

    Args:
        found: With importance, from :func:`descentflow.evaluation.metrics.classifier.detect`.

    Returns:
        A figure of a panel for each quantity, which share the flight level.

    Example:
        >>> from descentflow.evaluation.metrics.classifier import Importance
        >>> bands = [Importance(q, low, low + 100, 0.05) for q in ("CAS", "rate") for low in (150, 250)]
        >>> whole = [Importance(q, 150, 350, 0.1) for q in ("CAS", "rate")]
        >>> import torch
        >>> figure = classifier_figure(Detection(torch.tensor([0.6, 0.7]), (*whole, *bands)))
        >>> [axes.get_title() for axes in figure.axes]
        ['CAS: 0.10 in all', 'rate: 0.10 in all']
    """
    n = len(QUANTITIES)
    whole, bands = found.importance[:n], found.importance[n:]
    figure = Figure(figsize=(7.0, 4.4), layout="constrained")
    axes = figure.subplots(1, n, sharex=True, sharey=True)
    tidy(axes)
    for ax, total in zip(axes, whole, strict=True):
        own = [band for band in bands if band.quantity == total.quantity]
        width = (own[-1].high_fl - own[0].low_fl) / len(own)
        middles = [(band.low_fl + band.high_fl) / 2 for band in own]
        ax.barh(middles, [band.loss for band in own], height=0.8 * width, color=BLUE)
        ax.axvline(0, color=GREY, linewidth=0.8)
        ax.set_title(f"{total.quantity}: {total.loss:.2f} in all", fontsize=10)
        ax.set_xlabel("AUC lost when exchanged")
    low, high = found.interval
    axes[0].set_ylabel("Flight level")
    figure.suptitle(f"Samples separated from flights: AUC {found.auc:.2f} [{low:.2f}, {high:.2f}]", fontsize=11)
    return figure
