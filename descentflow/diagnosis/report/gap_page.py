"""`gap.html`: one self-contained page that a reader who is no specialist can follow."""

from descentflow.diagnosis.findings.cause_found import Cause
from descentflow.diagnosis.findings.findings import Findings
from descentflow.diagnosis.findings.gap_found import GapCell, WouldSplit
from descentflow.diagnosis.findings.plain_values import number, percent
from descentflow.diagnosis.report.gap_figures import closure_figure, curves_figure, singles_figure, where_figure
from descentflow.diagnosis.report.text import sentences
from descentflow.measurements.quantity_registry import label_of
from descentflow.reporting.html_elements import Html, bold, box, bullets, joined, lines, paragraph, table
from descentflow.reporting.html_figures import figure
from descentflow.reporting.html_page import HtmlPage

VERDICTS = {
    "none": "No gap",
    "effect": "A gap with a known cause",
    "partial": "A gap with a cause that explains part of it",
    "unknown": "A gap whose cause is not in the catalogue",
}
"""Verdict -> how the page's title begins."""
BOXES = {"none": "good", "effect": "", "partial": "warn", "unknown": "warn"}
"""Verdict -> colour of the box with the answer."""
SHOWN_CELLS = 10
"""Cells of the table of where, largest share first."""
SHOWN_CURVES = 4
"""Quantities drawn before and after, the rate first."""


def page(found: Findings) -> str:
    """The whole page, figures inside.

    Example:
        >>> from descentflow.diagnosis.diagnose import diagnose
        >>> from descentflow.effects import EFFECTS
        >>> report = diagnose("descents.parquet", "A320", catalogue={"mass": EFFECTS["mass"]})
        >>> page(report).count("<h2")  # sections
        7
    """
    whole = HtmlPage(f"Gap: {_title(found)}", [box(" ".join(sentences(found)), kind=BOXES[found.verdict])])
    if found.causes:
        whole.section("What it is", _causes(found))
    whole.section("Where they differ", *_where(found))
    whole.section("Which cause explains it", *_which(found))
    whole.section("Before and after", *_before_and_after(found))
    whole.section("What remains", _remaining(found))
    if found.would_split:
        whole.section(
            "What could not be told, and what would tell it", bullets(_split(found, row) for row in found.would_split)
        )
    else:
        whole.section("What could not be told", "Nothing that these channels leave open.")
    whole.section("How this was made", *_made(found))
    return whole.render()


def _title(found: Findings) -> str:
    return f"{VERDICTS[found.verdict]}: {found.details.typecode} flights against {found.details.simulator}"


def _causes(found: Findings) -> Html:
    rows = [
        [
            lines([bold(cause.label), cause.text]),
            _sizes(cause),
            ", ".join(found.details.label(name) for name in cause.group) or "nothing in the catalogue",
            percent(cause.probability),
            str(cause.closure.marginal),
        ]
        for cause in found.causes
    ]
    head = ["effect", "size (90 % interval)", "could as well be", "does best in resampled fleets", "gap closed"]
    return table(head, rows, align="l")


def _sizes(cause: Cause) -> Html:
    return lines(
        joined(f"{p.label}: ", bold(number(p.estimate)), p.unit_text, p.interval) for p in cause.parameters.values()
    )


def _where(found: Findings) -> list[Html]:
    rows = [_cell(cell) for cell in found.where if cell.share > 0][:SHOWN_CELLS]
    head = ["quantity", "where", "transition", "flights minus simulator", "distance (noise floor)", "share of the gap"]
    none = paragraph("No cell differs by more than chance and by enough to matter.")
    return [
        paragraph(
            "Red: the flights show more than the simulator, blue: less; pale: no more than chance. Each row is "
            "something measured, from low (left) to high (right)."
        ),
        figure(where_figure(found.details.curves), "Map of where flights and simulator differ"),
        table(head, rows, align="lllr") if rows else none,
        *_stages(found),
    ]


def _cell(cell: GapCell) -> list[str]:
    unit = "" if cell.unit == "1" else f" {cell.unit}"
    return [
        label_of(cell.quantity),
        f"FL{cell.level_low_fl:.0f} to FL{cell.level_high_fl:.0f}",
        cell.regime,
        f"{number(cell.difference)}{unit}",
        f"{number(cell.distance)} ({number(cell.floor)})",
        percent(cell.share),
    ]


def _stages(found: Findings) -> list[Html]:
    if not found.stages:
        return []
    rows = [[stage.name, number(stage.seconds), percent(stage.share)] for stage in found.stages]
    lead = (
        "What the simulator loses on the way from these flights to its own samples, stage by stage, in seconds for "
        "each 1,500 ft:"
    )
    return [paragraph(lead), table(["stage", "seconds", "share"], rows)]


def _which(found: Findings) -> list[Html]:
    chosen = [cause.effect for cause in found.causes]
    group = [name for cause in found.causes for name in cause.group]
    rest = found.details.discrepancy
    return [
        paragraph(
            "Every effect of the catalogue was fitted alone, and judged by how well it explains flights that it was "
            "not fitted to. A shift of any shape, without a cause, was judged beside them: it explains "
            f"{number(max(rest.rest, 0.0))} nats beyond what is named ({number(rest.explained)} nats)."
        ),
        figure(
            singles_figure(found.details.singles, chosen, group, found.details.label), "What each effect explains alone"
        ),
    ]


def _before_and_after(found: Findings) -> list[Html]:
    parts = [] if found.causes else [paragraph("Nothing was added to the simulator, so there is only a before.")]
    parts.append(figure(curves_figure(found.details.curves, _shown(found)), "Differences before and after"))
    if not found.causes:
        return parts
    closure = found.causes[0].closure
    names = " + ".join(cause.label for cause in found.causes)
    drawn = closure_figure(
        found.gap_before, found.gap_after, found.floor, found.causes[0].rivals, names, found.details.label
    )
    rows = [
        ["in the distributions", str(closure.marginal)],
        ["at each flight's own speed", str(closure.conditional)],
        ["learnt from slow flights, tried on fast ones (and back)", str(closure.transfer)],
    ]
    note = (
        "A wrong effect can close much of a gap too: that it closes does not prove the cause. The choice rests on how "
        "well flights are explained that no effect was fitted to."
    )
    return [
        *parts,
        figure(drawn, "Gap before and after, and what other effects would close"),
        table(["gap closed", ""], rows),
        paragraph(note, kind="note"),
    ]


def _shown(found: Findings) -> list[str]:
    """Quantities of bands with the largest differences in standard errors, the rate first."""
    curves = found.details.curves
    banded = [q for q, c in curves.items() if c.level_fl[0] is not None]
    size = {q: max(abs(b / e) for b, e in zip(curves[q].before, curves[q].error, strict=True)) for q in banded}
    largest = sorted(banded, key=lambda q: -size[q])[: SHOWN_CURVES - 1]
    return ["rate", *[q for q in largest if q != "rate"]][:SHOWN_CURVES] if "rate" in banded else largest


def _remaining(found: Findings) -> Html:
    left = found.remaining.largest
    return paragraph(
        f"A gap of {found.remaining.gap:.3f} spreads above the noise floor. The largest difference left is "
        f"{number(left.difference)} in the {label_of(left.quantity)}, "
        f"FL{left.level_low_fl:.0f} to FL{left.level_high_fl:.0f} "
        f"({number(left.in_negligible_shifts)} times what would not matter)."
    )


def _split(found: Findings, row: WouldSplit) -> Html:
    names = ", ".join(found.details.label(name) for name in row.between)
    tell = joined("; told by: ", bold(", ".join(row.channels))) if row.channels else Html("")
    return joined(f"{names}: {row.why}", tell)


def _made(found: Findings) -> list[Html]:
    d = found.details
    rows = [[name.replace("_", " "), f"{count:,}"] for name, count in found.dropped.items()]
    note = (
        f"Normal is what {_normal(d.normal_from)} show. {d.test.n_permutations} permutations of whole "
        f"aircraft, seed {d.seed}. Sensitivities at a mass of {d.mass_kg:,.0f} kg. Transition at "
        f"FL{d.transition_fl:.0f}."
    )
    said = [str(channel) for channel in found.left_out_channels]
    used = None if found.provenance is None else found.provenance.coefficients
    said += [] if used is None else [str(used)]
    return [paragraph(note, kind="note"), *([bullets(said)] if said else []), table(["counted", ""], rows)]


def _normal(source: str) -> str:
    return "the simulator's flights" if source == "simulator flights" else f"the simulator's {source}"
