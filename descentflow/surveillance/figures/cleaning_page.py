"""The page of `descentflow prepare --figures`: some flights with the rows that were kept and dropped."""

from pathlib import Path

import polars as pl

from descentflow.core.files import whole_file
from descentflow.reporting.pages import png, rendered
from descentflow.surveillance.figures.cleaning_figure import cleaning_figure
from descentflow.surveillance.rows.drop_report import DropReport

PER_FIGURE = 3
"""Flights in a figure."""
DPI = 90


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
    flights = dropped_rows.partition_by("flight_id", maintain_order=True)
    groups = [flights[first : first + PER_FIGURE] for first in range(0, len(flights), PER_FIGURE)]
    shown = []
    for number, some in enumerate(groups, 1):
        picture = folder / f"flights-{number:02d}.png"
        with whole_file(picture) as temporary:
            temporary.write_bytes(png(cleaning_figure(some), DPI))
        shown.append((picture.name, [[_name(flight), _counts(flight)] for flight in some]))
    with whole_file(folder / "index.html") as temporary:
        text = rendered("surveillance/figures/cleaning_page.html.j2", flights=shown, report=str(report))
        temporary.write_text(text, encoding="utf-8")
    return len(flights)


def _name(flight: pl.DataFrame) -> str:
    return str(flight["flight_id"][0])


def _counts(flight: pl.DataFrame) -> str:
    """Number of rows kept, and dropped for each reason."""
    counts = flight["reason"].fill_null("kept").value_counts().sort("count", "reason", descending=[True, False])
    return ", ".join(f"{reason.replace('_', ' ')} {number}" for reason, number in counts.iter_rows())
