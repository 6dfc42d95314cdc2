"""Figure of a latent model's draws: accepted, or rejected by which rule."""

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from descentflow.generation.samples import RejectionReport
from descentflow.reporting.figure_style import BLUE, RED, say_why_empty, tidy

_SURPLUS = "#9ecae1"


def acceptance_figure(report: RejectionReport) -> Figure:
    """Shares of the draws that were kept or rejected, and the share that broke each rule.

    A draw that breaks several rules counts under each of them.

    Args:
        report: Account of a rejection sampling.

    Returns:
        A figure of two panels.

    Example:
        >>> report = RejectionReport(drawn=110, accepted=100, rejected=8, surplus=2, broken={"not_finite": 8})
        >>> len(acceptance_figure(report).axes)
        2
    """
    figure = Figure(figsize=(8.0, 1.9 + 0.36 * len(report.broken)), layout="constrained")
    above, below = figure.subplots(2, 1, height_ratios=[1.3, max(len(report.broken), 1)])
    tidy((above, below))
    _draw_fates(above, report)
    _draw_rules(below, report)
    plausible = f", {report.acceptance:.1%} plausible" if report.drawn else ""
    figure.suptitle(f"{report.accepted:,} samples from {report.drawn:,} draws{plausible}", fontsize=11)
    return figure


def _share(count: int, report: RejectionReport) -> float:
    return 100 * count / report.drawn if report.drawn else 0.0


def _draw_fates(ax: Axes, report: RejectionReport) -> None:
    left = 0.0
    outcomes = (
        ("kept", report.accepted, BLUE, ""),
        ("plausible, not needed", report.surplus, _SURPLUS, ".."),
        ("rejected", report.rejected, RED, "//"),
    )
    for name, count, colour, hatch in outcomes:
        share = _share(count, report)
        label = f"{name} ({count:,})"
        ax.barh([""], [share], left=left, color=colour, hatch=hatch, edgecolor="white", linewidth=0, label=label)
        left += share
    ax.set_xlim(0, 100)
    ax.set_xlabel("Share of draws (%)", fontsize=9)
    ax.legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=3, frameon=False, fontsize=9, borderaxespad=0.2)


def _draw_rules(ax: Axes, report: RejectionReport) -> None:
    if not report.broken:
        ax.set_axis_off()
        say_why_empty(ax, "No draw breaks a rule." if report.drawn else "Nothing was drawn.")
        return
    names = [rule.replace("_", " ").replace("cas", "CAS") for rule in report.broken]
    shares = [_share(count, report) for count in report.broken.values()]
    bars = ax.barh(names, shares, color=RED)
    ax.bar_label(bars, [f" {count:,} ({s:.2g} %)" for count, s in zip(report.broken.values(), shares, strict=True)])
    ax.invert_yaxis()
    ax.set_xlim(0, 1.3 * max([*shares, 0.1]))
    ax.set_xlabel("Share of draws that break the rule (%)", fontsize=9)
