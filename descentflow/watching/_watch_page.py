"""Page of a watch: the difference day by day, the evidence, the alarm, and what cannot be seen."""

from typing import TYPE_CHECKING, Any

import numpy as np
import polars as pl

from descentflow.reporting.pages import drawing, rendered
from descentflow.watching.change_evidence import SHAPES, SIZES, YEAR, DayMeans, Evidence
from descentflow.watching.day_record import WATCHED, means_of
from descentflow.watching.watch_result import Watch, standing

if TYPE_CHECKING:
    from matplotlib.figure import Figure


WEEK = 7
"""Days within which a change is said to be seen."""


def page(watch: Watch, counted: pl.DataFrame, weighed: Evidence | None) -> str:
    """The whole page.

    Args:
        watch: What the run found.
        counted: Days that count, in order.
        weighed: Evidence after each; None where there is none.
    """
    days = means_of(counted)
    shown = watch.alarm["shown_by"] if watch.alarm else []
    figures = []
    if weighed is not None:
        figures.append(("Evidence of a change, day by day.", drawing(_evidence_figure(watch, weighed))))
    for q, (label, _, _) in enumerate(WATCHED.values()):
        if np.isfinite(days.mean[:, q]).any():
            figures.append((f"{label}, day by day.", drawing(_day_figure(watch, counted, days, q))))
    return rendered(
        "watching/watch.html.j2",
        watch=watch,
        standing=standing(watch)[:1].upper() + standing(watch)[1:],
        shown=[[one["label"], f"{one['change']:+.3g} {one['unit']}", f"{100 * one['weight']:.0f} %"] for one in shown],
        figures=figures,
        hidden=hidden(days, watch.settings.reference_days, watch.settings.false_alarms),
        first=counted["day"][0] if len(counted) else "",
        last=counted["day"][-1] if len(counted) else "",
        flights=f"{int(counted['flights'].sum()):,}" if len(counted) else "0",
        left_out=list(watch.left_out.items()),
    )


def hidden(days: DayMeans, reference: int, false_alarms: float) -> list[list[str]]:
    r"""Steps that would be seen within a week in about half of the cases; smaller ones are not.

    After k days the logarithm of the evidence of a step Δ grows by about
    :math:`\Delta^2 k R / (2 v (k + R))`, R the days of the reference and v the variance of a day's mean; it must reach
    that of the threshold and of the weight of one day, quantity, shape and size.

    Args:
        days: Means of days.
        reference: Days of the reference.
        false_alarms: Rate of false alarms a year.
    """
    rows = []
    needed = float(np.log(len(WATCHED) * len(SHAPES) * len(SIZES) * YEAR / false_alarms)) + 2.0
    for q, (label, unit, scale) in enumerate(WATCHED.values()):
        known = days.mean[:reference, q]
        known = known[np.isfinite(known)]
        if len(known) > 2:
            step = float(known.std(ddof=1)) * (2 * needed * (WEEK + len(known)) / (WEEK * len(known))) ** 0.5
            rows.append([label, f"{scale * step:.2g} {unit}"])
    return rows


def _evidence_figure(watch: Watch, weighed: Evidence) -> "Figure":
    """Logarithm of the evidence by day, with the threshold."""
    figure, ax = _axes(watch, "evidence of a change", "ln of the evidence")
    ax.plot(weighed.log_e, color="#0072b2")
    threshold = -np.log(watch.settings.false_alarms)
    ax.axhline(threshold, color="#d55e00", linestyle="--")
    ax.annotate("alarm", (0, threshold), color="#d55e00", fontsize=9, va="bottom")
    top = max(2 * threshold, min(float(weighed.log_e.max()), 10 * threshold))
    ax.set_ylim(min(-1.0, float(weighed.log_e.min())), top)
    return figure


def _day_figure(watch: Watch, counted: pl.DataFrame, days: DayMeans, q: int) -> "Figure":
    """A day's mean difference with its 90 % interval, the reference shaded, the change marked."""
    label, unit, scale = list(WATCHED.values())[q]
    figure, ax = _axes(watch, label, unit)
    half = 1.645 * scale * np.sqrt(days.within[:, q])
    middle = scale * days.mean[:, q]
    ax.errorbar(np.arange(len(counted)), middle, half, fmt="o", markersize=2.5, linewidth=0.7, color="#0072b2")
    if watch.alarm and watch.alarm["change"]["day"] in counted["day"]:
        ax.axvline(counted["day"].to_list().index(watch.alarm["change"]["day"]) - 0.5, color="#d55e00", linestyle="--")
    return figure


def _axes(watch: Watch, title: str, up: str) -> tuple["Figure", Any]:
    """Figure and axes of days, the reference shaded."""
    from matplotlib.figure import Figure

    from descentflow.reporting.figure_style import tidy

    figure = Figure(figsize=(3.4, 2.6), layout="constrained")
    ax = figure.subplots()
    ax.axvspan(-0.5, watch.settings.reference_days - 0.5, color="#eeeeee")
    ax.set_title(title, fontsize=9, wrap=True)
    first = watch.days.filter(pl.col("day") >= (watch.settings.since or ""))["day"][0]
    ax.set_xlabel(f"day, counted from {first}", fontsize=9)
    ax.set_ylabel(up, fontsize=9)
    tidy([ax])
    return figure, ax
