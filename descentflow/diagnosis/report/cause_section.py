"""The page's section on the causes: their sizes, how sure they are, and what else could have been."""

from descentflow.diagnosis.findings.cause_found import Cause
from descentflow.diagnosis.findings.findings import Findings
from descentflow.diagnosis.findings.plain_values import percent
from descentflow.diagnosis.report.words import how_sure, shown_sizes, spoken
from descentflow.reporting.html_elements import Html, bold, details, lines, paragraph, stacked_table, table
from descentflow.reporting.svg_figures import drawn_for_both

SHOWN_SUBSETS = 5
"""Sets of effects that are listed."""


def cause_section(found: Findings) -> list[Html]:
    """The causes as a table, closure of each and of all, and every effect alone.

    Example:
        >>> from descentflow.diagnosis.diagnose import diagnose
        >>> from descentflow.effects import EFFECTS
        >>> report = diagnose("descents.parquet", "A320", catalogue={"mass": EFFECTS["mass"]})
        >>> "lighter aircraft" in cause_section(report)[0]
        True
    """
    named = [_causes(found), _closure(found)] if found.causes else [paragraph(_no_cause(found))]
    return [*named, _alone(found), *_refused(found), *_others(found)]


def _no_cause(found: Findings) -> str:
    if found.is_small:
        return (
            "What differs is less than the rounding of one flight's reports leaves open: no cause is named for it. "
            "Every effect of the catalogue was tried all the same."
        )
    if found.verdict == "none":
        return "There is no gap to explain. Every effect of the catalogue was tried all the same."
    return "No effect of the catalogue explains the gap, alone or with others."


def _causes(found: Findings) -> Html:
    rows = [
        [
            lines([bold(cause.label), cause.text]),
            lines(size.text for size in shown_sizes(cause)),
            cause.in_flights(whole=True).removeprefix("in ").removesuffix(" of the flights") or "all",
            how_sure(cause),
            ", ".join(found.details.label(name) for name in cause.group) or "nothing in the catalogue",
            "-" if cause.own_closure is None else str(cause.own_closure),
        ]
        for cause in found.causes
    ]
    head = ["cause", "size (90 %)", "flights that have it", "how sure", "could as well be", "closes alone"]
    return stacked_table(head, rows, align="l")


def _closure(found: Findings) -> Html:
    closure = found.causes[0].closure
    all_of = "All together close" if len(found.causes) > 1 else "It closes"
    text = f"{all_of} {closure.marginal} of the gap in the means, measured on the simulator's flights with the causes."
    note = " A wrong effect can close much of a gap too: that a gap closes does not prove the cause."
    return paragraph(text, note)


def _alone(found: Findings) -> Html:
    from descentflow.diagnosis.report.gap_figures import singles_figure  # matplotlib loads where figures are drawn

    chosen = [cause.effect for cause in found.causes]
    group = [name for cause in found.causes for name in cause.group]
    label = found.details.label
    best = [s for s in found.details.singles if s.gain_nats > 0][:3]
    alt = "No effect alone explains flights better than none."
    if best:
        alt = f"Alone, {spoken([label(s.effect) for s in best])} explain the means best, in this order"
        alt += f"; named: {spoken([label(name) for name in chosen])}." if chosen else "; none is named."
    caption = (
        "Every effect of the catalogue alone, by its evidence over no effect. Beside others an effect may gain more "
        "or less."
    )
    return drawn_for_both(
        lambda narrow: singles_figure(found.details.singles, chosen, group, label, narrow=narrow),
        "effects", alt, caption,
    )  # fmt: skip


def _refused(found: Findings) -> list[Html]:
    """Effects that would explain flights, and cannot be what they say."""
    told = [
        f"{found.details.label(s.effect)} ({s.refused})" for s in found.details.singles if s.refused and s.gain_nats > 0
    ]
    if not told:
        return []
    return [
        paragraph(
            f"Would explain the means alone, with sizes that it cannot have, and is not named: {'; '.join(told)}."
        )
    ]


def _others(found: Findings) -> list[Html]:
    parts = []
    if found.details.subsets:
        rows = [
            [spoken([found.details.label(name) for name in s.effects]) or "none", percent(s.weight)]
            for s in found.details.subsets[:SHOWN_SUBSETS]
        ]
        parts.append(details("The best sets of effects", table(["set", "weight"], rows)))
    return parts


def parameters_table(causes: list[Cause]) -> Html:
    """Parameters as the equations have them, for readers who put them into code.

    Example:
        >>> from descentflow.diagnosis.diagnose import diagnose
        >>> from descentflow.effects import EFFECTS
        >>> report = diagnose("descents.parquet", "A320", catalogue={"mass": EFFECTS["mass"]})
        >>> "relative change of the mass" in parameters_table(report.causes)
        True
    """
    rows = [
        [cause.label, p.label, f"{p.estimate:.4g}{p.unit_text}", p.interval.strip()]
        for cause in causes
        for p in cause.parameters.values()
    ]
    return stacked_table(["cause", "parameter, mean over all flights", "estimate", "90 %"], rows, align="llrr")
