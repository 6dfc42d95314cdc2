"""The page's sections on where flights and simulator differ, before and after the causes."""

from descentflow.diagnosis.findings.findings import Findings
from descentflow.diagnosis.findings.gap_found import GapCell
from descentflow.diagnosis.findings.plain_values import percent
from descentflow.diagnosis.report.text import small_difference
from descentflow.diagnosis.report.trade_units import at_level, in_trade, level_range, trade_number
from descentflow.diagnosis.report.words import spoken
from descentflow.measurements.quantity_registry import label_of
from descentflow.reporting.html_elements import Html, details, paragraph, stacked_table
from descentflow.reporting.number_text import number
from descentflow.reporting.svg_figures import drawn_for_both

SHOWN_CELLS = 10
"""Cells of the table of where, largest share first."""
SHOWN_CURVES = 4
"""Quantities drawn before and after, the rate first."""
CHANCE = 2.0
"""Standard errors that chance often gives."""


def where_section(found: Findings) -> list[Html]:
    """Map, cells and numbers of whole flights, and the simulator's own loss by stage.

    Example:
        >>> from descentflow.diagnosis.diagnose import diagnose
        >>> from descentflow.effects import EFFECTS
        >>> report = diagnose("descents.parquet", "A320", catalogue={"mass": EFFECTS["mass"]})
        >>> [part[:7] for part in where_section(report)][:2]
        ['<figure', '<div cl']
    """
    from descentflow.diagnosis.report.gap_figures import where_figure  # matplotlib loads where figures are drawn

    d = found.details
    caption = (
        "Real flights minus simulator, from low levels (left) to high ones. Numbers, or signs on a narrow screen, "
        "stand where it is more than chance often gives (two standard errors); the darker, the surer."
    )
    return [
        drawn_for_both(
            lambda narrow: where_figure(d.curves, d.profile, narrow=narrow), "where", largest_in_words(found), caption
        ),
        *_below_rounding(found),
        _cells(found),
        *_whole_flights(found),
        *_stages(found),
    ]


def largest_in_words(found: Findings) -> str:
    """Largest differences in words, for readers who do not see the map.

    Example:
        >>> from descentflow.diagnosis.diagnose import diagnose
        >>> from descentflow.effects import EFFECTS
        >>> largest_in_words(diagnose("descents.parquet", "A320", catalogue={"mass": EFFECTS["mass"]}))[:43]
        'Largest differences by altitude: rate of de'
    """
    told, alike = [], []
    for quantity, curve in found.details.curves.items():
        if curve.level_fl[0] is None:
            continue
        k = max(range(len(curve.before)), key=lambda i: abs(curve.before[i] / curve.error[i]))
        fl = curve.level_fl[k] or 0.0
        if abs(curve.before[k] / curve.error[k]) <= CHANCE:
            alike.append(label_of(quantity))
            continue
        value, unit = in_trade(quantity, curve.before[k], fl, fl, at_level(found.details.profile, fl))
        told.append(f"{label_of(quantity)} {trade_number(value, unit, signed=True)} at FL{fl:.0f}")
    text = f"Largest differences by altitude: {'; '.join(told) or 'none beyond chance'}."
    return f"{text} Within chance: {spoken(alike)}." if alike else text


def _cells(found: Findings) -> Html:
    rows = [_cell(found, cell) for cell in found.where if cell.share > 0][:SHOWN_CELLS]
    if not rows:
        return paragraph("No level differs by more than chance and by enough to matter.")
    head = ["quantity", "levels", "transition", "flights", "flights minus simulator", "share of the gap"]
    return stacked_table(head, rows, align="llllr")


def _cell(found: Findings, cell: GapCell) -> list[str]:
    value, unit = in_trade(cell.quantity, cell.difference, cell.level_low_fl, cell.level_high_fl, found.details.profile)
    return [
        label_of(cell.quantity),
        level_range(cell.level_low_fl, cell.level_high_fl),
        cell.regime,
        cell.slice,
        f"{trade_number(value, unit, signed=True)}{_in_scatter(value, unit)}",
        percent(cell.share),
    ]


def _in_scatter(value: float, unit: str) -> str:
    """Note on a cell whose mean is alike: the gap is one of distributions."""
    return ": it scatters otherwise" if trade_number(abs(value), unit) == trade_number(0.0, unit) else ""


def _below_rounding(found: Findings) -> list[Html]:
    """Each quantity of a gap that does not matter."""
    if not found.is_small:
        return []
    rows = [
        [label_of(row.quantity), level_range(row.level_low_fl, row.level_high_fl), small_difference(found, row)]
        for row in found.below_rounding
    ]
    lead = (
        "Reports are rounded, the vertical rate to 32 ft/min, IAS to 1 kt, TAS and groundspeed to 2 kt, Mach number to "
        "0.004 and altitudes to 25 ft. What that leaves open in one flight (its standard uncertainty) is more than the "
        "difference at every level; largest of each quantity:"
    )
    return [paragraph(lead), stacked_table(["quantity", "levels", "difference of uncertainty"], rows, align="lll")]


def _whole_flights(found: Findings) -> list[Html]:
    """Differences of what is one number of a whole flight, where they are more than chance."""
    rows = []
    for quantity, curve in found.details.curves.items():
        standing = curve.before[0] / curve.error[0]
        if curve.level_fl[0] is None and abs(standing) > CHANCE:
            before, unit = in_trade(quantity, curve.before[0], 0.0, 0.0, [])
            after, _ = in_trade(quantity, curve.after[0], 0.0, 0.0, [])
            row = [label_of(quantity), trade_number(before, unit, signed=True), trade_number(after, unit, signed=True)]
            rows.append([*row, f"{abs(standing):.0f}"])
    head = ["of whole flights", "flights minus simulator", "with the causes", "standard errors"]
    return [stacked_table(head if found.causes else [*head[:2], *head[3:]],
                  rows if found.causes else [[*row[:2], row[3]] for row in rows])] if rows else []  # fmt: skip


def _stages(found: Findings) -> list[Html]:
    if not found.stages:
        return []
    rows = [[stage.name, number(stage.seconds), percent(stage.share)] for stage in found.stages]
    lead = (
        "What the simulator loses on the way from these flights to its own samples, stage by stage, in seconds for "
        "each 1,500 ft:"
    )
    stages = stacked_table(["stage", "seconds", "share"], rows)
    return [details("At which stage the simulator loses most", paragraph(lead), stages)]


def curves_section(found: Findings) -> list[Html]:
    """Differences against altitude, before and after.

    Example:
        >>> from descentflow.diagnosis.diagnose import diagnose
        >>> from descentflow.effects import EFFECTS
        >>> report = diagnose("descents.parquet", "A320", catalogue={"mass": EFFECTS["mass"]})
        >>> [part[:7] for part in curves_section(report)]
        ['<figure']
    """
    from descentflow.diagnosis.report.gap_figures import curves_figure  # matplotlib loads where figures are drawn

    d = found.details
    shown = _shown(found)
    if not shown:
        return [paragraph("No quantity by level is compared.")]
    drawn = drawn_for_both(
        lambda narrow: curves_figure(d.curves, shown, d.profile, narrow=narrow, after=bool(found.causes)),
        "curves",
        _curves_in_words(found, shown),
    )
    return [drawn] if found.causes else [paragraph("Nothing is put into the simulator: there is no after."), drawn]


def _curves_in_words(found: Findings, shown: list[str]) -> str:
    told = []
    for quantity in shown:
        curve = found.details.curves[quantity]
        sure = [
            sum(abs(v / e) > CHANCE for v, e in zip(values, curve.error, strict=True))
            for values in (curve.before, curve.after)
        ]
        after = f" before and {sure[1]} after" if found.causes else ""
        told.append(f"{label_of(quantity)} at {sure[0]} of {len(curve.error)} levels{after}")
    return f"Beyond what chance gives: {'; '.join(told)}."


def _shown(found: Findings) -> list[str]:
    """Quantities of bands with the largest differences in standard errors, the rate first."""
    curves = found.details.curves
    banded = [q for q, c in curves.items() if c.level_fl[0] is not None]
    size = {q: max(abs(b / e) for b, e in zip(curves[q].before, curves[q].error, strict=True)) for q in banded}
    largest = sorted(banded, key=lambda q: -size[q])[: SHOWN_CURVES - 1]
    return ["rate", *[q for q in largest if q != "rate"]][:SHOWN_CURVES] if "rate" in banded else largest
