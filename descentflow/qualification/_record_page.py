"""Page and terminal text of a qualification."""

import re
from collections.abc import Sequence
from math import inf
from typing import TYPE_CHECKING

from descentflow.diagnosis.findings.aviation_units import between, level_range, with_unit
from descentflow.diagnosis.findings.plain_values import percent
from descentflow.diagnosis.report.page import listed, simulator_name
from descentflow.diagnosis.report.page_tables import cost_table, inputs_table
from descentflow.qualification.limits import UNITS
from descentflow.qualification.record import Record, Row
from descentflow.reporting.pages import drawing, rendered

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COLOURS = {"inside": "#00695c", "outside": "#b3261e", "not enough flights": "#c45100"}
HEAD = (
    "quantity|levels or time|flights|real minus simulator|limit|flights inside|verdict|to decide|by the air|corrected"
)
SHOWN = 4.0
"""Limits to either side that a figure shows; what is beyond is drawn at its edge."""


def page(record: Record) -> str:
    """The whole page: it prints on four sheets of A4.

    Args:
        record: The record.

    Example:
        >>> from descentflow.qualification.qualify import qualify
        >>> page(qualify("descents.parquet", "A320")).count("<h2")  # sections
        8
    """
    picture = limits_figure(record)
    return rendered(
        "qualification/qualification.html.j2",
        record=record,
        name=simulator_name(record.gap),
        headline=headline(record),
        reasons=_reasons(record),
        tables=_tables(record.rows),
        figure="" if picture is None else drawing(picture),
        sources=list(dict.fromkeys(row.source for row in record.rows)),
        costs=cost_table(record.gap, means=True) if record.gap.costs else [],
        causes=[(record.gap.details.label(step.effect), step.text) for step in record.gap.recipe],
        pedigree=inputs_table(record.gap),
        dropped=[(name.replace("_", " "), f"{count:,}") for name, count in record.gap.dropped.items()],
        prints=[
            (side, used.fingerprint)
            for side, used in (("real", record.gap.provenance.real), ("simulator", record.gap.provenance.simulator))
            if used.fingerprint
        ],
    )


def summary(record: Record) -> str:
    """The answer for a terminal.

    Args:
        record: The record.

    Example:
        >>> from descentflow.qualification.qualify import qualify
        >>> print(summary(qualify("descents.parquet", "A320")).splitlines()[0])
        Nominal BADA of the A320 is inside the limits of part60, by 120 real A320 flights.
    """
    rows = _without_empty_columns([HEAD.split("|"), *(_cells(row) for row in _whole(record.rows))])
    wide = [max(len(cell) for cell in column) for column in zip(*rows, strict=True)]
    table = ["  " + "  ".join(cell.ljust(n) for cell, n in zip(row, wide, strict=True)).rstrip() for row in rows]
    return "\n".join([headline(record), *_reasons(record), *table])


def headline(record: Record) -> str:
    """The verdict in a sentence.

    Example:
        >>> from descentflow.qualification.qualify import qualify
        >>> headline(qualify("descents.parquet", "A320"))
        'Nominal BADA of the A320 is inside the limits of part60, by 120 real A320 flights.'
    """
    name = simulator_name(record.gap)
    name = name[:1].upper() + name[1:]
    flights = f"{record.gap.dropped.get('flights_compared', 0):,} real {record.gap.details.typecode} flights"
    said = {
        "inside": f"is inside the limits of {record.limits}",
        "outside": f"is outside the limits of {record.limits}",
        "not enough flights": f"is neither surely inside nor surely outside the limits of {record.limits}",
        "not judged": f"is measured by {record.limits}, which judges nothing",
    }[record.verdict]
    return f"{name} {said}, by {flights}."


def _reasons(record: Record) -> list[str]:
    """Sentences on rows that are outside or not decided, and what would decide."""
    lines = []
    for verdict, text in (("outside", "Outside"), ("not enough flights", "Not decided")):
        rows = [row for row in record.rows if row.verdict == verdict]
        names = list(dict.fromkeys((row.quantity, row.minutes) for row in rows))
        places = [_place(record, [row for row in rows if (row.quantity, row.minutes) == name]) for name in names]
        lines += [f"{text}: {listed(places)}."] if places else []
    open_rows = [row for row in record.rows if row.verdict == "not enough flights"]
    if record.verdict == "not enough flights":
        # The hardest row decides: one that no number of the real flights would.
        worst = max(open_rows, key=lambda row: inf if row.more_flights is None else row.more_flights)
        lines.append(f"To decide all: {worst.decides}.")
    return lines


def _place(record: Record, rows: Sequence[Row]) -> str:
    """Quantity, and in how many of its bands, or after what time."""
    label = UNITS[rows[0].quantity][0].partition(" at the flight")[0]
    if rows[0].minutes is not None or rows[0].quantity == "top_of_descent":
        return f"{label} {_where(rows[0])}"
    whole = _whole(record.rows)
    bands = [row for row in record.rows if row.quantity == rows[0].quantity and row not in whole]
    count = sum(row not in whole for row in rows)
    return f"{label} in {count} of {len(bands)} bands" if count else f"{label} over all levels"


def _where(row: Row) -> str:
    return level_range(row.low_fl, row.high_fl) if row.minutes is None else f"after {row.minutes:g} min"


def _tables(rows: Sequence[Row]) -> list[tuple[str, list[str], list[list[str]]]]:
    """Caption, head and rows for each quantity."""
    tables = []
    for quantity in dict.fromkeys(row.quantity for row in rows):
        own = [row for row in rows if row.quantity == quantity]
        by_level = len(own) > 1 and own[-1].minutes is None
        lines = [_cells(row, whole="all levels" if by_level and row is own[-1] else None)[1:] for row in own]
        # The caption has the unit.
        lines = [[re.sub(rf" {own[0].unit}(?= \(|$)", "", cell) for cell in line] for line in lines]
        head, *shown = _without_empty_columns([HEAD.split("|")[1:], *lines])
        label, unit = UNITS[quantity]
        tables.append((f"{label[:1].upper()}{label[1:]} ({unit})", head, shown))
    return tables


def _without_empty_columns(rows: Sequence[Sequence[str]]) -> list[list[str]]:
    """Head and rows."""
    shown = [column for column in zip(*rows, strict=True) if set(column[1:]) != {"-"}]
    return [list(row) for row in zip(*shown, strict=True)]


def _whole(rows: Sequence[Row]) -> list[Row]:
    """Rows of all levels, and predictions."""
    last = {row.quantity: row for row in rows if row.minutes is None}
    return [row for row in rows if row.minutes is not None or row is last[row.quantity]]


def _cells(row: Row, *, whole: str | None = None) -> list[str]:
    unit = row.unit
    return [
        UNITS[row.quantity][0],
        _where(row) if whole is None else whole,
        f"{row.flights:,}",
        "none is seen" if row.difference is None else between(row.difference, unit),
        "-" if row.limit is None else f"± {with_unit(row.limit, unit)}",
        "-" if row.share_inside is None else _share(row),
        row.verdict,
        row.decides or "-",
        "-" if row.by_air is None else with_unit(row.by_air, unit, signed=True),
        "-" if row.corrected is None else between(row.corrected, unit),
    ]


def _share(row: Row) -> str:
    assert row.share_inside is not None
    ends = row.share_inside.ends
    return percent(row.share_inside.estimate) + (f" ({percent(ends[0])} to {percent(ends[1])})" if ends else "")


def limits_figure(record: Record) -> "Figure | None":
    """Mean differences with 90 % intervals against altitude, in units of the limit, a panel for each quantity.

    Example:
        >>> from descentflow.qualification.qualify import qualify
        >>> len(limits_figure(qualify("descents.parquet", "A320")).axes)  # a type has no airspeed of its own
        1
    """
    # matplotlib loads where figures are drawn.
    from matplotlib.figure import Figure

    from descentflow.reporting.figure_style import tidy

    whole = _whole(record.rows)
    by_level = [row for row in record.rows if row.minutes is None and row.limit and row not in whole]
    names = list(dict.fromkeys(row.quantity for row in by_level))
    if not names:
        return None
    figure = Figure(figsize=(3.4 * len(names), 3.2), layout="constrained")
    for ax, name in zip(figure.subplots(1, len(names), sharey=True, squeeze=False)[0], names, strict=True):
        ax.axvspan(-1, 1, color="#e3ecf4")
        for row in (row for row in by_level if row.quantity == name and row.difference is not None):
            assert row.limit is not None
            assert row.difference is not None
            level = (row.low_fl + row.high_fl) / 2
            ends = row.difference.ends or (row.difference.estimate,) * 2
            low, at, high = (
                min(max(x / row.limit, -SHOWN), SHOWN) for x in (ends[0], row.difference.estimate, ends[1])
            )
            ax.plot([low, high], [level, level], color=COLOURS[row.verdict], linewidth=1.6)
            ax.plot([at], [level], "o", color=COLOURS[row.verdict], markersize=4)
        ax.set_title(UNITS[name][0].partition(" at the flight")[0], fontsize=9)
        ax.set_xlabel("real minus simulator, in limits", fontsize=9)
    figure.axes[0].set_ylabel("flight level", fontsize=9)
    tidy(figure.axes)
    return figure
