"""The answer in words, for the terminal and the top of the page."""

from descentflow.diagnosis.findings.cause_found import Cause
from descentflow.diagnosis.findings.findings import Findings
from descentflow.diagnosis.findings.plain_values import number, percent
from descentflow.measurements.quantity_registry import label_of


def sentences(found: Findings) -> list[str]:
    """Where, what, and how far: three sentences.

    Example:
        >>> from descentflow.diagnosis.diagnose import diagnose
        >>> from descentflow.effects import EFFECTS
        >>> report = diagnose("descents.parquet", "A320", catalogue={"mass": EFFECTS["mass"]})
        >>> sentences(report)[1].split(",")[0]
        'The cause is lighter aircraft.'
    """
    if found.verdict == "none":
        return [
            f"The flights do not differ from the simulator's by more than chance would (p = {found.p_value:.2g}).",
            "No effect is named.",
            f"The gap of {found.gap_before:.3f} spreads is what two samples of one population show "
            f"({found.floor:.3f}).",
        ]
    return [_place(found), *(_unknown(found) if found.verdict == "unknown" else _causes(found))]


def _place(found: Findings) -> str:
    """Where most of the gap lies."""
    cell = next((c for c in found.where if c.share > 0), None)
    place = "no single cell stands out"
    if cell is not None:
        place = f"most of it in the {label_of(cell.quantity)}, FL{cell.level_low_fl:.0f} to FL{cell.level_high_fl:.0f}"
    if found.details.regime == "refit":
        return f"The flights are as the simulator's own were, but not as it assumes (p = {found.p_value:.2g}): {place}."
    return f"The flights differ from the simulator's (p = {found.p_value:.2g}): {place}."


def _unknown(found: Findings) -> list[str]:
    left = found.remaining.largest
    return [
        "No effect of the catalogue explains it, alone or with others: the cause lies outside.",
        f"The largest difference is {number(left.difference)} in the {label_of(left.quantity)}, "
        f"FL{left.level_low_fl:.0f} to FL{left.level_high_fl:.0f}.",
    ]


def _causes(found: Findings) -> list[str]:
    causes = " and ".join(cause.text for cause in found.causes)
    alike = sorted({found.details.label(name) for cause in found.causes for name in cause.group})
    doubt = f", though these data cannot tell it from {', '.join(alike)}" if alike else ""
    closed = found.causes[0].closure.marginal.estimate
    are, them = ("causes are", "them") if len(found.causes) > 1 else ("cause is", "it")
    return [
        f"The {are} {causes}{doubt}.",
        f"With {them} in the simulator the gap shrinks from {found.gap_before:.3f} to {found.gap_after:.3f} spreads, "
        f"where {found.floor:.3f} is the least that can be seen ({percent(closed)} closed).",
    ]


def summary(found: Findings) -> str:
    """For a terminal.

    Example:
        >>> from descentflow.diagnosis.diagnose import diagnose
        >>> from descentflow.effects import EFFECTS
        >>> report = diagnose("descents.parquet", "A320", catalogue={"mass": EFFECTS["mass"]})
        >>> print(summary(report))
        The flights ...
        The cause is ...
        With it in the simulator the gap shrinks from ... to ... spreads, ...
    """
    lines = sentences(found)
    for cause in found.causes:
        lines += [f"  {line}" for line in _sizes(found, cause)]
    lines += [
        f"  would tell more: {', '.join(s.channels)} (between {', '.join(found.details.label(e) for e in s.between)})"
        for s in found.would_split
        if s.channels
    ]
    lines += [f"  {channel}" for channel in found.left_out_channels]
    used = None if found.provenance is None else found.provenance.coefficients
    if used is not None and used.stand_in:
        lines.append(f"  {used}")
    return "\n".join(lines)


def _sizes(found: Findings, cause: Cause) -> list[str]:
    alike = ", ".join(found.details.label(name) for name in cause.group)
    return [str(cause), *([f"  could also be: {alike}"] if alike else [])]
