"""Figures of descents, and the page of what each filter of the cleaning kept and dropped of some flights."""

import itertools
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import polars as pl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from descentflow.core.files import write_whole
from descentflow.reporting.figure_file import write_figure
from descentflow.reporting.figure_style import BLUE, MODELS, legend_below, panels, say_why_empty
from descentflow.reporting.pages import rendered
from descentflow.surveillance.cleaning.level_flight import BAND_FT
from descentflow.surveillance.cleaning.thresholds import Cleaning
from descentflow.surveillance.rows.air_data import cas_of_mach_kt
from descentflow.surveillance.rows.drop_report import DropReport

REASON_LOOKS = {
    "not_descending": ("#b0b0b0", "."),
    "transient": ("#e69f00", "."),
    "constant_rate": ("#009e73", "s"),
    "not_below_earlier_row": ("#56b4e9", "."),
    "second_descent": ("#8a6d3b", "v"),
    "too_few_levels": ("#6a3d9a", "."),
    "cleared_speed": ("#f0a3ff", "D"),
    "IAS_contradicts_Mach": ("#d55e00", "P"),
}
"""Colour and marker of each rule; of the others by how their names begin, see :func:`look`."""
PANELS = ("pressure altitude, FL", "vertical rate, ft/min", "IAS, kt")


def look(reason: str | None) -> tuple[str, str, float]:
    """Colour, marker and size of rows dropped for one reason."""
    if reason is None:
        return BLUE, ".", 14.0
    if reason.startswith("spike_"):
        return "#ff0000", "x", 30.0
    if reason.startswith("stale_"):
        return "#a000a0", "+", 36.0
    colour, marker = REASON_LOOKS.get(reason, ("#000000", "*"))
    return colour, marker, 14.0


def cleaning_figure(flights: Sequence[pl.DataFrame], slowest_fpm: float = Cleaning().slowest_fpm) -> Figure:
    """Altitude, rate and IAS of some flights against time, every row coloured by the rule that dropped it.

    The thin line next to the IAS is the CAS of Mach number and altitude, which should agree with it. The dotted line is
    the slowest rate of a descent.
    """
    figure, grid = panels(5.2 * len(flights), 8.0, 3, len(flights), sharex="col")
    for column, rows in enumerate(flights):
        _draw(list(grid[:, column]), rows.sort("timestamp"), slowest_fpm)
    for ax, label in zip(grid[:, 0], PANELS, strict=True):
        ax.set_ylabel(label)
    legend_below(figure, grid.flat, columns=2 * len(flights))
    return figure


def _draw(axes: Sequence[Axes], rows: pl.DataFrame, slowest_fpm: float) -> None:
    minutes = ((rows["timestamp"] - rows["timestamp"][0]).dt.total_microseconds() / 60e6).to_numpy()
    altitude_ft = rows["altitude"].to_numpy()
    channels = (altitude_ft / 100, rows["vertical_rate"].to_numpy(), rows["IAS"].to_numpy())
    axes[2].plot(minutes, cas_of_mach_kt(rows["Mach"].to_numpy(), altitude_ft), color="#9a9a9a", linewidth=0.7)
    reasons = rows["reason"].to_list()
    # Kept rows first, so that the few dropped ones lie on top of them.
    for reason in [None, *sorted({r for r in reasons if r is not None})]:
        of = np.array([r == reason for r in reasons])
        if not of.any():
            continue
        colour, marker, size = look(reason)
        name = "kept" if reason is None else reason.replace("_", " ")
        for ax, values in zip(axes, channels, strict=True):
            ax.scatter(minutes[of], values[of], c=colour, marker=marker, s=size, linewidths=0.9, label=name)
    axes[1].axhline(-slowest_fpm, color="#5a5a5a", linewidth=1.0, linestyle=":")
    # A spike must not squeeze all else into a line.
    rates = channels[1][np.isfinite(channels[1])]
    if len(rates):
        axes[1].set_ylim(max(rates.min() - 200, -6500.0), min(rates.max() + 200, 5000.0))
    axes[0].set_title(f"{rows['flight_id'][0]}  {rows['typecode'][0]}", fontsize=10)
    axes[2].set_xlabel("minutes")


FLIGHTS_PER_FIGURE = 3
"""Flights in a figure."""
DPI = 90


def write_page(folder: Path, dropped_rows: pl.DataFrame, report: DropReport, slowest_fpm: float) -> int:
    """Write figures of flights and `index.html`, each whole; the page last, when everything that it shows is there."""
    folder.mkdir(exist_ok=True)
    flights = dropped_rows.partition_by("flight_id", maintain_order=True)
    groups = [flights[first : first + FLIGHTS_PER_FIGURE] for first in range(0, len(flights), FLIGHTS_PER_FIGURE)]
    shown = []
    for number, some in enumerate(groups, 1):
        picture = folder / f"flights-{number:02d}.png"
        write_figure(cleaning_figure(some, slowest_fpm), picture, DPI)
        shown.append((picture.name, [[str(flight["flight_id"][0]), _counts(flight)] for flight in some]))
    text = rendered("surveillance/cleaning_page.html.j2", flights=shown, report=str(report))
    write_whole(folder / "index.html", text)
    return len(flights)


def _counts(flight: pl.DataFrame) -> str:
    """Number of rows kept, and dropped for each reason."""
    counts = flight["reason"].fill_null("kept").value_counts().sort("count", "reason", descending=[True, False])
    return ", ".join(f"{reason.replace('_', ' ')} {number}" for reason, number in counts.iter_rows())


MAX_DRAWN_FLIGHTS = 100
"""Flights that are drawn, at random."""
DESCENT_PANELS = {"IAS": "IAS (kt)", "vertical_rate": "Vertical rate (ft/min)"}


def descents_figure(descents: pl.DataFrame) -> Figure:
    """Draw up to 100 flights."""
    names = descents["flight_id"].unique().sort().to_list()
    drawn = np.random.default_rng(0).permutation(names)[:MAX_DRAWN_FLIGHTS].tolist()
    figure, (axes,) = panels(8.4, 4.2, 1, 2, sharey=True)
    for flight in descents.filter(pl.col("flight_id").is_in(drawn)).partition_by("flight_id"):
        for ax, name in zip(axes, DESCENT_PANELS, strict=True):
            ax.plot(flight[name].to_numpy(), flight["level_fl"].to_numpy(), color=BLUE, linewidth=0.7, alpha=0.35)
    for ax, label in zip(axes, DESCENT_PANELS.values(), strict=True):
        ax.set_xlabel(label)
    axes[0].set_ylabel("Flight level")
    figure.suptitle(f"{len(drawn):,} of {len(names):,} descents", fontsize=12, fontweight="bold")
    return figure


def level_flight_figure(sides: pl.DataFrame) -> Figure:
    """Seconds of a flight that are level by altitude, a bar for each set of flights.

    Args:
        sides: Of :func:`~descentflow.surveillance.cleaning.level_flight.side_by_side`.
    """
    figure, ((ax,),) = panels(6.4, 3.6)
    parts = sides.partition_by("side", maintain_order=True)
    height = 0.8 * BAND_FT / max(len(parts), 1)
    colours = itertools.cycle([BLUE, *(colour for colour, _ in MODELS)])
    for place, (side, colour) in enumerate(zip(parts, colours, strict=False)):
        name, flights, share = side.select("side", "flights", "continuous").row(0)
        bottom = side["low_ft"].to_numpy() + 0.1 * BAND_FT + (place + 0.5) * height
        label = f"{name} ({flights:,}): {share:.0%} without level flight"
        ax.barh(bottom / 1000, side["level_s"].to_numpy(), height / 1000, color=colour, label=label)
    if not parts:
        say_why_empty(ax, "no flight descends by 5,000 ft")
    ax.set_xlabel("Level flight of a descent (s)")
    ax.set_ylabel("Pressure altitude (1,000 ft)")
    ax.set_ylim(bottom=0)
    legend_below(figure, [ax], columns=1)
    return figure
