"""The page of plots of `descentflow prepare --figures`: a few flights, kept and dropped stretches."""

import html
from pathlib import Path

import polars as pl

from descentflow.core.files import whole_file
from descentflow.surveillance.figures.cleaning_figure import cleaning_figure
from descentflow.surveillance.rows.drop_report import DropReport

ABREAST = 3
"""Flights in a figure."""
INTRODUCTION = """Every dot is a row that was read; its colour says which rule dropped it, blue was kept. The thin grey
line beside the IAS is the CAS of Mach number and pressure altitude; the dotted one is the slowest rate of a descent.
For each rule there is the flight that it hit most, and besides these some flights taken at random."""


def write_page(folder: Path, dropped_rows: pl.DataFrame, report: DropReport) -> int:
    """Write figures of flights and `index.html`, each whole; the page last, when all it shows is there.

    Args:
        folder: Made if it does not exist.
        dropped_rows: As :func:`~descentflow.surveillance.cleaning.drop_reasons.some_flights`.
        report: Shown below the figures.

    Returns:
        Number of flights shown.
    """
    folder.mkdir(exist_ok=True)
    flights = dropped_rows.partition_by("flight_id", maintain_order=True)
    sections = []
    for number, first in enumerate(range(0, len(flights), ABREAST), 1):
        some = flights[first : first + ABREAST]
        name = f"flights-{number:02d}.png"
        with whole_file(folder / name) as temporary:
            cleaning_figure(some).savefig(temporary, dpi=90, metadata={"Software": None})
        rows = "".join(_row(flight) for flight in some)
        sections.append(f'<img src="{name}" alt="Flights of figure {number}"><table>{rows}</table>')
    with whole_file(folder / "index.html") as temporary:
        temporary.write_text(
            '<!doctype html><html lang="en"><head><meta charset="utf-8"><title>What cleaning kept</title><style>'
            "body { font: 15px/1.5 system-ui, sans-serif; max-width: 1400px; margin: 2em auto; padding: 0 1em }"
            "img { max-width: 100% } td { padding-right: 1em; font-size: 13px }</style></head><body>"
            f"<h1>What cleaning kept and dropped</h1><p>{INTRODUCTION}</p>{''.join(sections)}"
            f"<h2>All rows</h2><pre>{html.escape(str(report))}</pre></body></html>\n",
            encoding="utf-8",
        )
    return len(flights)


def _row(flight: pl.DataFrame) -> str:
    """A flight's name and its rows by reason."""
    counts = flight["reason"].fill_null("kept").value_counts().sort("count", "reason", descending=[True, False])
    words = ", ".join(f"{reason.replace('_', ' ')} {number}" for reason, number in counts.iter_rows())
    return f"<tr><td>{html.escape(flight['flight_id'][0])}</td><td>{html.escape(words)}</td></tr>"
