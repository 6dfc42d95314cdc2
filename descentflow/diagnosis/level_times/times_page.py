"""`level_times.html`: the comparison of times as one page, and the files beside it."""

import json
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from descentflow.core.files import whole_file
from descentflow.diagnosis.level_times.leg_statistics import LegDifference
from descentflow.diagnosis.level_times.times_found import LACKING, ORIGIN, TimesFound
from descentflow.reporting.figure_style import BLACK, BLUE, tidy
from descentflow.reporting.html_elements import Html, answer, bullets, joined, paragraph, stacked_table
from descentflow.reporting.html_page import HtmlPage
from descentflow.reporting.number_text import number
from descentflow.reporting.svg_figures import drawn_for_both

FILES = ("level_times.csv", "level_times.json", "level_times.html")
"""What is written."""


def write_times(found: TimesFound, folder: str | Path) -> None:
    """Write `level_times.csv`, `level_times.json` and `level_times.html`, each whole or not at all.

    Example:
        >>> leg = LegDifference("FL200 to FL150", 40, 1000, 161.0, 155.0, 6.0, 2.0, 9.5, 6.5, 3.1, 0.004)
        >>> write_times(TimesFound("best.ckpt", "40 flights of A320", (leg,)), "times")
        >>> sorted(path.name for path in Path("times").iterdir())
        ['level_times.csv', 'level_times.html', 'level_times.json']
    """
    target = Path(folder)
    target.mkdir(parents=True, exist_ok=True)
    with whole_file(target / "level_times.csv") as temporary:
        found.to_polars().write_csv(temporary)
    with whole_file(target / "level_times.json") as temporary:
        temporary.write_text(json.dumps(found.as_dict(), indent=1, allow_nan=False))
    times_page(found).write(target / "level_times.html")


def times_page(found: TimesFound) -> HtmlPage:
    """The page, figure inside.

    Example:
        >>> leg = LegDifference("FL200 to FL150", 40, 1000, 161.0, 155.0, 6.0, 2.0, 9.5, 6.5, 3.1, 0.004)
        >>> page = times_page(TimesFound("best.ckpt", "40 flights of A320", (leg,))).render()
        >>> page.count("<h2"), "FL200 to FL150" in page
        (2, True)
    """
    title = f"Times between flight levels: {found.simulator}"
    page = HtmlPage(title, [answer([found.answer], "warn" if found.differs else "good")])
    told = "; ".join(
        f"{leg.leg} {leg.difference_s:+.1f} s ({leg.low_s:+.1f} to {leg.high_s:+.1f})" for leg in found.legs
    )
    figure = drawn_for_both(
        lambda narrow: differences_figure(found.legs, narrow=narrow),
        "differences",
        f"Flights minus simulator, with 90 % intervals: {told}.",
        "Seconds that the flights take longer than the simulator, with 90 % intervals.",
    )
    rows = [
        [
            leg.leg,
            f"{number(leg.mean_real_s)} s",
            f"{number(leg.mean_simulated_s)} s",
            f"{leg.difference_s:+.1f} s",
            f"{leg.low_s:+.1f} to {leg.high_s:+.1f} s",
            "-" if np.isnan(leg.wasserstein_s) else f"{number(leg.wasserstein_s)} s",
            "-" if np.isnan(leg.floor_s) else f"{number(leg.floor_s)} s",
            f"{leg.p_value:.2g}",
            f"{leg.n_real:,}",
        ]
        for leg in found.legs
    ]
    head = ["leg", "flights", "simulator", "difference", "90 % interval", "Wasserstein", "noise floor", "p-value", "n"]
    parts: list[Html] = [figure, stacked_table(head, rows)]
    if found.left_out:
        parts.append(bullets(found.left_out))
    page.section("Differences", *parts)
    lacking = [paragraph("These flights lack:"), bullets(LACKING), paragraph(ORIGIN)]
    if found.unresolved:
        lacking.append(paragraph(joined(found.unresolved)))
    page.section("What these flights cannot tell", *lacking)
    return page


def differences_figure(legs: tuple[LegDifference, ...], *, narrow: bool = False) -> Figure:
    """Differences with their intervals, a row a leg, from the top of the descent down.

    Example:
        >>> leg = LegDifference("FL200 to FL150", 40, 1000, 161.0, 155.0, 6.0, 2.0, 9.5, 6.5, 3.1, 0.004)
        >>> differences_figure((leg,)).axes[0].get_xlabel()
        'Flights minus simulator (s)'
    """
    figure = Figure(figsize=(3.55 if narrow else 8.0, 0.9 + 0.42 * len(legs)), layout="constrained")
    ax = figure.subplots()
    tidy([ax])
    for row, leg in enumerate(legs):
        ax.plot([leg.low_s, leg.high_s], [row, row], color=BLUE, linewidth=2.0)
        ax.plot([leg.difference_s], [row], "o", color=BLUE)
    ax.axvline(0, color=BLACK, linewidth=0.9, linestyle=":")
    ax.set_yticks(range(len(legs)), [leg.leg for leg in legs])
    ax.set_ylim(-0.6, len(legs) - 0.4)
    ax.set_xlabel("Flights minus simulator (s)")
    return figure
