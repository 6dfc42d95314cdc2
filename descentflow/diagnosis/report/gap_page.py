"""`gap.html`: one self-contained page that a reader who is no specialist can follow."""

from descentflow.diagnosis.findings.findings import Findings
from descentflow.diagnosis.findings.gap_found import WouldSplit
from descentflow.diagnosis.report.cause_section import cause_section, parameters_table
from descentflow.diagnosis.report.cost_section import cost_section
from descentflow.diagnosis.report.inputs_section import inputs_section
from descentflow.diagnosis.report.next_steps import next_steps
from descentflow.diagnosis.report.text import sentences
from descentflow.diagnosis.report.trade_units import in_trade, level_range, trade_number
from descentflow.diagnosis.report.where_section import CHANCE, curves_section, where_section
from descentflow.diagnosis.report.words import flights_name, limit_flights, limit_words, simulator_name
from descentflow.measurements.quantity_registry import label_of
from descentflow.reporting.html_elements import (
    Html,
    answer,
    blocks,
    bold,
    bullets,
    code,
    details,
    joined,
    paragraph,
    stacked_table,
)
from descentflow.reporting.html_page import HtmlPage

VERDICTS = {
    "none": "no gap",
    "effect": "a gap with a known cause",
    "partial": "a gap with a cause that explains part of it",
    "unknown": "a gap whose cause is not in the catalogue",
}
"""Verdict -> how the page's title ends."""
OF_SCORES = (
    "Here the causes are put into the simulator's flights, above under What it costs they are taken off the real ones. "
    "Half of the real flights says the sizes and the other half is scored, so these are scores of flights that nothing "
    "was fitted to. A score compares whole flights as they are: those of a fleet that happens to fly faster, or to "
    "begin elsewhere, may score worse with a right cause in them, where two differences had made up for each other."
)
"""Note below the table of scores, for it need not agree with the costs."""
BOXES = {"none": "good", "effect": "", "partial": "warn", "unknown": "warn"}
"""Verdict -> colour of the box with the answer."""


def page(found: Findings) -> str:
    """The whole page, figures inside.

    Args:
        found: What it tells.

    Example:
        >>> from descentflow.diagnosis.diagnose import diagnose
        >>> from descentflow.effects import EFFECTS
        >>> report = diagnose("descents.parquet", "A320", catalogue={"mass": EFFECTS["mass"]})
        >>> page(report).count("<h2")  # sections
        8
    """
    verdict = "a gap too small to matter" if found.is_small else VERDICTS[found.verdict]
    title = f"{simulator_name(found)} against {flights_name(found)}: {verdict}"
    whole = HtmlPage(title, [answer(sentences(found), BOXES[found.verdict])])
    whole.section("What it costs", *cost_section(found))
    whole.section("Which cause, and how sure", *cause_section(found))
    steps = next_steps(found)
    whole.section(
        "What to do next", bullets(map(_with_commands, steps)) if steps else "Nothing: there is no gap to close."
    )
    whole.section("Where they differ", *where_section(found))
    whole.section("Before and after", *curves_section(found))
    whole.section("What is left, and what could not be told", *_left(found))
    whole.section("How far it shrinks, round by round", *_rounds(found))
    whole.section("How this was made", *inputs_section(found), *_numbers(found))
    return whole.render()


def _with_commands(step: str) -> Html:
    """A step as the page writes it: what stands between backticks is to be typed."""
    return joined(*(code(part) if k % 2 else part for k, part in enumerate(step.split("`"))))


def _left(found: Findings) -> list[Html]:
    left = found.remaining.largest
    value, unit = in_trade(left.quantity, left.difference, left.level_low_fl, left.level_high_fl, found.details.profile)
    after = " after the causes" if found.causes else ""
    text = (
        f"The largest difference{after} is {trade_number(value, unit, signed=True)} in the {label_of(left.quantity)}, "
        f"{level_range(left.level_low_fl, left.level_high_fl)}: {left.in_negligible_shifts:.1f} times what would not "
        f"matter{_beside_chance(found)}."
    )
    parts = [paragraph(text)]
    if found.flights_worth_a_look and found.verdict in ("unknown", "partial"):
        rows = [
            [
                f.flight,
                label_of(f.quantity),
                level_range(f.low_fl, f.high_fl),
                trade_number(f.excess, f.unit, signed=True),
            ]
            for f in found.flights_worth_a_look
        ]
        parts.append(
            stacked_table(["flights worth a look", "quantity", "levels", "beyond the rest"], rows, align="lllr")
        )
    if found.would_split:
        parts.append(bullets(_split(found, row) for row in found.would_split))
    if found.details.detection_limits:
        parts.append(_limits(found))
    return parts


def _beside_chance(found: Findings) -> str:
    """Ratio of the largest difference that is left to its standard error; nothing where that is not known."""
    left = found.remaining.largest
    curve = found.details.curves.get(left.quantity)
    if curve is None:
        return ""
    inside = [fl is None or left.level_low_fl <= fl <= left.level_high_fl for fl in curve.level_fl]
    errors = [error for error, here in zip(curve.error, inside, strict=True) if here]
    if len(errors) != 1 or errors[0] <= 0.0:
        return ""
    standing = abs(left.difference) / errors[0]
    return ", and no more than chance often gives" if standing <= CHANCE else f", and {standing:.1f} standard errors"


def _split(found: Findings, row: WouldSplit) -> Html:
    names = ", ".join(found.details.label(name) for name in row.between)
    tell = joined("; told by: ", bold(", ".join(row.channels))) if row.channels else Html("")
    return joined(f"{names}: {row.why}", tell)


def _limits(found: Findings) -> Html:
    rows = [
        [
            found.details.label(limit.effect),
            limit_words(limit),
            limit_flights(limit),
        ]
        for limit in found.details.detection_limits
    ]
    lead = "The smallest sizes that these flights and channels would name in 80 of 100 cases:"
    return details(
        "How small an effect would have been found",
        paragraph(lead),
        stacked_table(["effect", "size", "flights that have it"], rows, align="lll"),
    )


def _rounds(found: Findings) -> list[Html]:
    """Scores before and after, and the round before this one."""
    parts = []
    if found.previous is not None:
        p = found.previous
        text = (
            f"The diagnosis before, {p.report}, named {', '.join(map(found.details.label, p.causes)) or 'nothing'} and "
            f"predicted a closure of {p.predicted}; {p.achieved} were reached. {p.text}"
        )
        parts.append(paragraph(text))
    if found.scores:
        rows = [
            [
                score.name,
                trade_number(score.before, score.unit),
                "-" if score.after is None else trade_number(score.after, score.unit),
                "-" if score.floor is None else trade_number(score.floor, score.unit),
            ]
            for score in found.scores
        ]
        parts.append(
            stacked_table(["simulator's flights against the real ones", "before", "after", "noise floor"], rows)
        )
        parts.append(paragraph(OF_SCORES))
    return parts or [paragraph("This is the first round, and the simulator's flights were not scored.")]


def _numbers(found: Findings) -> list[Html]:
    """Numbers for specialists."""
    d, rest = found.details, found.details.discrepancy
    text = (
        f"p-value {found.p_value:.2g} from {d.n_permutations:,} permutations of whole aircraft. Logarithm of the "
        f"evidence: the named causes gain {rest.explained:.0f}, an unknown cause beside them {rest.rest:.0f}. Means "
        f"of what differs, in standard deviations between flights: gap {found.gap_before:.3f}, with the causes "
        f"{found.gap_after:.3f}, noise floor {found.floor:.3f}. Sensitivities at a mass of {d.mass_kg:,.0f} kg; "
        f"transition at FL{d.transition_fl:.0f}."
    )
    parts = [paragraph(text)]
    if found.causes:
        parts.append(parameters_table(found.causes))
    return [details("Numbers for specialists", blocks(parts))]
