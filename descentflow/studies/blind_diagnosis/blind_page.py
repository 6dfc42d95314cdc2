"""One self-contained page of a study's scores."""

import base64
import html
import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from descentflow.core.files import whole_file
from descentflow.studies.blind_diagnosis.figures import blind_figures as figures

STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; max-width: 1150px; margin: 2em auto; padding: 0 1em; color: #222; }
img { max-width: 100%; height: auto; } h2 { margin-top: 2.2em; border-bottom: 1px solid #ccc; }
table { border-collapse: collapse; font-size: 13px; margin: 1em 0; } td, th { padding: 3px 12px 3px 0; text-align: left;
vertical-align: top; border-bottom: 1px solid #eee; } .bad { color: #b00020; font-weight: 600; }
.good { color: #00695c; } code { font-size: 12px; word-break: break-all; }
"""


def write_page(scored: Mapping[str, Any], path: Path) -> None:
    """Write the page, whole or not at all.

    Example:
        >>> write_page(score(*open_key(folder)), folder / "score.html")
    """
    with whole_file(path) as temporary:
        temporary.write_text(page(scored), encoding="utf-8")


def page(scored: Mapping[str, Any]) -> str:
    """The page as text."""
    sections = [
        ("Goals, and what was reached", _goals(scored)),
        (
            "What was named for what was planted",
            _image(figures.confusion_figure(scored["confusion"]), "confusion matrices"),
        ),
        ("False alarms", _false_alarms(scored["false_alarms"])),
        ("By channels, size, flights and simulator", _image(figures.strata_figure(scored["by_stratum"]), "shares")),
        ("Cause by cause", _by_cause(scored["by_cause"])),
        ("Sizes", _sizes(scored["sizes"])),
        ("How far the gap closes", _image(figures.closure_figure(scored["closure"]), "closures")),
        ("Where windows were found", _windows(scored["windows"])),
        ("Each effect withheld from the catalogue, and put back", _withheld(scored["withheld"])),
        ("Simulators refitted to the flights", _refit(scored["refit"])),
    ]
    body = "".join(f"<h2>{title}</h2>{content}" for title, content in sections)
    return (
        '<!doctype html><html lang="en"><head><meta charset="utf-8"><title>Withheld effects</title>'
        f"<style>{STYLE}</style></head><body><h1>Effects hidden in flights, and what the diagnosis made of them</h1>"
        f"{_introduction(scored)}{body}</body></html>"
    )


def _introduction(scored: Mapping[str, Any]) -> str:
    refused = len(scored["refused"])
    pace = ", ".join(f"{seconds:.0f} s for {n} flights" for n, seconds in scored["seconds"].items())
    return (
        f"<p>{scored['diagnosed']} of {scored['jobs']} sealed sets were diagnosed"
        f"{f' ({refused} refused)' if refused else ''}. What they hide was written down and sealed on "
        f"{scored['sealed_at']} by the SHA-256 hash <code>{scored['key_sha256']}</code>, "
        "before any was diagnosed; every diagnosis was hashed before the key was opened, and all hashes were checked "
        "before scoring. The flights are flown in time by the full equation of motion, not by the equations that the "
        f"diagnosis uses. Shares stand with 95 % intervals. Processor time of a diagnosis: {pace}.</p>"
    )


def _goals(scored: Mapping[str, Any]) -> str:
    rows = []
    for goal in scored["goals"]:
        verdict = {True: '<span class="good">met</span>', False: '<span class="bad">missed</span>', None: "not judged"}
        rows.append([html.escape(goal["goal"]), goal["reached_text"], str(goal["n"]), verdict[goal["met"]]])
    return _table(["goal", "reached", "sets", ""], rows)


def _false_alarms(alarms: Mapping[str, Any]) -> str:
    named = "; ".join(", ".join(names) for names in alarms["named"]) or "none"
    text = (
        f"<p>{_share(alarms)} of the sets without an effect raised an alarm. What was named: {html.escape(named)}.</p>"
    )
    return text + _image(figures.p_value_figure(alarms), "distribution of p-values")


def _by_cause(rows: Sequence[Mapping[str, Any]]) -> str:
    measures = ("detected", "first", "in_group", "unknown")
    cells = [
        [
            r["cause"],
            r["channels"],
            r["size"],
            str(r["n"]),
            *(_share(r[measure], interval=False) for measure in measures),
        ]
        for r in rows
    ]
    return _table(["planted", "channels", "size", "sets", "detected", "right first", "in the group", "unknown"], cells)


def _sizes(sizes: Mapping[str, Any]) -> str:
    cells = [
        [r["cause"], r["parameter"], _percent(r["bias"]), _percent(r["spread"]), _share(r["coverage"])]
        for r in sizes["rows"]
    ]
    text = f"<p>90 % intervals cover the planted size in {_share(sizes['coverage'])} of all estimates.</p>"
    head = ["effect", "parameter", "median error", "quartile range", "covered"]
    return text + _image(figures.sizes_figure(sizes["estimates"]), "estimated and planted sizes") + _table(head, cells)


def _windows(rows: Sequence[Mapping[str, Any]]) -> str:
    named = [row["overlap"] for row in rows if row["overlap"] is not None]
    places = [row["cell_in"] for row in rows if row["cell_in"] is not None]
    text = f"{len(named)} of {len(rows)} windows of speed brakes were named"
    if named:
        text += f"; they overlap the planted ones by {_percent(sum(named) / len(named))} of their union on average"
    if places:
        text += f"; {sum(places)} of {len(places)} times the rate differs most where the window is"
    return f"<p>{text}.</p>" + _image(figures.windows_figure(rows), "windows")


def _withheld(rows: Sequence[Mapping[str, Any]]) -> str:
    cells = []
    for row in rows:
        without, put_back = row["without"], row["with"]
        cells.append(
            [
                row["effect"],
                _mark(_answer(without), row["right_without"]),
                _where(without["where"]),
                _mark(_answer(put_back), row["right_with"]),
                _before_and_after(put_back),
                _percent((row["closing"] or {}).get("of_true")),
            ]
        )
    return _table(
        [
            "planted",
            "without it: verdict",
            "where it lies",
            "with it: verdict",
            "gap, before and after",
            "of the true closure",
        ],
        cells,
    )


def _before_and_after(brief: Mapping[str, Any]) -> str:
    ends = f"{_number(brief['gap_before'])} to {_number(brief['gap_after'])}"
    return f"{ends} (floor {_number(brief['floor'])})"


def _refit(rows: Sequence[Mapping[str, Any]]) -> str:
    text = "<p>The simulator learnt from other flights with the same effect: its drag has swallowed what it can.</p>"
    cells = [[r["effect"], _mark(_answer(r), r["right_first"]), _number(r["p_value"])] for r in rows]
    return text + _table(["planted in both", "verdict", "p-value"], cells)


def _answer(brief: Mapping[str, Any]) -> str:
    named = "; ".join(
        name if len(group) == 1 else f"{name} (or {', '.join(g for g in group if g != name)})"
        for name, group in zip(brief["named"], brief["groups"], strict=True)
    )
    return f"{brief['verdict']}{': ' + named if named else ''}"


def _where(cell: Mapping[str, Any] | None) -> str:
    if cell is None:
        return ""
    levels = f"FL{cell['level_low_fl']:.0f}-{cell['level_high_fl']:.0f}" if cell.get("level_low_fl") is not None else ""
    return html.escape(f"{cell['quantity']} {levels}, {_number(cell.get('distance'))} {cell.get('unit') or ''}")


def _mark(text: str, right: bool) -> str:
    return f'<span class="{"good" if right else "bad"}">{html.escape(text)}</span>'


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    titles = "".join(f"<th>{title}</th>" for title in head)
    body = "".join("<tr>" + "".join(f"<td>{cell}</td>" for cell in row) + "</tr>" for row in rows)
    return f"<table><tr>{titles}</tr>{body}</table>"


def _share(one: Mapping[str, Any], *, interval: bool = True) -> str:
    if one["share"] is None:
        return "-"
    ends = f" ({_percent(one['low'])} to {_percent(one['high'])}, n = {one['n']})" if interval else ""
    return f"{_percent(one['share'])}{ends}"


def _percent(value: float | None) -> str:
    return "-" if value is None else f"{100 * value:.0f} %"


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.3g}"


def _image(figure: Figure, about: str) -> str:
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=100, metadata={"Software": None})
    return f'<img alt="{about}" src="data:image/png;base64,{base64.b64encode(buffer.getvalue()).decode("ascii")}">'
