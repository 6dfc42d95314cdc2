"""The page's section on what went in: both sides by name, versions, settings, and what was left out."""

from descentflow.diagnosis.findings.findings import Findings
from descentflow.diagnosis.findings.inputs_found import InputUsed
from descentflow.reporting.html_elements import Html, bullets, details, paragraph, stacked_table, table

NORMAL = {
    "training flights": "what the simulator's own training flights show",
    "samples": "what samples of the simulator show",
    "physics": "what the performance equations say",
    "simulator flights": "what the simulator's flights show",
}
"""Origin of the simulator's side -> its words."""


def inputs_section(found: Findings) -> list[Html]:
    """Inputs, versions, settings and counts.

    Example:
        >>> from descentflow.diagnosis.diagnose import diagnose
        >>> from descentflow.effects import EFFECTS
        >>> report = diagnose("descents.parquet", "A320", catalogue={"mass": EFFECTS["mass"]})
        >>> "Normal is what the performance equations say" in inputs_section(report)[0]
        True
    """
    d = found.details
    parts = [paragraph(f"Normal is {NORMAL.get(d.normal_from, d.normal_from)}. Seed {d.seed}.")]
    made = found.provenance
    if made is not None:
        head = ["side", "name", "what it is", "flights", "aircraft", "days", "types", "descentflow"]
        rows = [_side("real", made.real), _side("simulator", made.simulator)]
        parts.append(stacked_table(head, rows, align="lllrrlll"))
        told = {**made.versions, **made.settings}
        parts.append(table(["version or setting", ""], list(told.items()), align="l"))
        rows = [[name, side.settings.get(name, "-")] for side in (made.real,) for name in side.settings]
        if rows:
            parts.append(details("How the flights were cleaned", table(["setting", ""], rows)))
        if made.coefficients is not None:
            parts.append(paragraph(str(made.coefficients)))
        if made.user_files:
            parts.append(paragraph(f"Effects were taken from {', '.join(made.user_files)}, and its code was run."))
    if found.left_out_channels:
        parts.append(bullets(f"{channel}." for channel in found.left_out_channels))
    counted = [[name.replace("_", " "), f"{count:,}"] for name, count in found.dropped.items()]
    return [*parts, details("Flights and rows counted", table(["counted", ""], counted))]


def _side(name: str, used: InputUsed) -> list[str]:
    days = " to ".join(dict.fromkeys(day for day in (used.first, used.last) if day))
    aircraft = "-" if used.aircraft is None else f"{used.aircraft:,}"
    flights = f"{used.flights:,}" if used.flights else "-"
    inside = [file for file in used.files if file != used.name]
    whole = f"{used.name} (from {', '.join(inside)})" if inside else used.name
    return [
        name,
        whole,
        used.kind,
        flights,
        aircraft,
        days or "-",
        ", ".join(used.typecodes) or "-",
        used.version or "-",
    ]
