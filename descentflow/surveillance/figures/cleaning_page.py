"""The page of `descentflow prepare --figures`: some flights with the rows that were kept and dropped."""

from pathlib import Path

import polars as pl

from descentflow.reporting.html_elements import preformatted, table
from descentflow.reporting.html_figures import figure_beside
from descentflow.reporting.html_page import HtmlPage
from descentflow.surveillance.figures.cleaning_figure import cleaning_figure
from descentflow.surveillance.rows.drop_report import DropReport

PER_FIGURE = 3
"""Flights in a figure."""
DPI = 90
INTRODUCTION = (
    "Every dot is a row that was read; its colour names the filter that dropped it, blue rows were kept. The thin grey "
    "line beside the IAS is the CAS of Mach number and pressure altitude; the dotted line is the slowest rate of a "
    "descent. For each filter there is the flight of which it dropped most rows, and besides these some random flights."
)


def write_page(folder: Path, dropped_rows: pl.DataFrame, report: DropReport) -> int:
    """Write figures of flights and `index.html`, each whole; the page last, when everything that it shows is there.

    Args:
        folder: Made if it does not exist.
        dropped_rows: As :func:`~descentflow.surveillance.cleaning.drop_reasons.some_flights`.
        report: Shown below the figures.

    Returns:
        Number of flights shown.

    Example:
        >>> from descentflow.surveillance.prepare import prepare
        >>> descents = prepare("rows.parquet", shown=1)
        >>> write_page(Path("figures"), descents.dropped_rows, descents.report)
        4
    """
    folder.mkdir(exist_ok=True)
    page = HtmlPage("What cleaning kept and dropped", lead=[INTRODUCTION])
    flights = dropped_rows.partition_by("flight_id", maintain_order=True)
    for number, first in enumerate(range(0, len(flights), PER_FIGURE), 1):
        some = flights[first : first + PER_FIGURE]
        picture = figure_beside(
            folder / f"flights-{number:02d}.png",
            cleaning_figure(some),
            f"Altitude, vertical rate and IAS of {', '.join(_name(flight) for flight in some)} against time",
            dpi=DPI,
        )
        counts = table(["flight", "rows"], [[_name(flight), _counts(flight)] for flight in some], align="l")
        last = first + len(some)
        heading = f"Flights {first + 1} to {last}" if len(some) > 1 else f"Flight {last}"
        page.section(heading, picture, counts)
    page.section("All rows", preformatted(str(report)))
    page.write(folder / "index.html")
    return len(flights)


def _name(flight: pl.DataFrame) -> str:
    return str(flight["flight_id"][0])


def _counts(flight: pl.DataFrame) -> str:
    """Number of rows kept, and dropped for each reason."""
    counts = flight["reason"].fill_null("kept").value_counts().sort("count", "reason", descending=[True, False])
    return ", ".join(f"{reason.replace('_', ' ')} {number}" for reason, number in counts.iter_rows())
