"""`gap.html`: one self-contained page that a reader who is no specialist can follow."""

import base64
from html import escape
from io import BytesIO
from typing import TYPE_CHECKING, Any

from descentflow.diagnosis.report.gap_figures import closure_figure, contest_figure, curves_figure, where_figure
from descentflow.diagnosis.report.text import NAMES, cause_in_words, interval, number, percent, sentences, unit

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from descentflow.diagnosis.report.gap_report import GapReport

STYLE = """
body{font:16px/1.5 system-ui,sans-serif;max-width:60rem;margin:2rem auto;padding:0 1rem;color:#222}
h1{font-size:1.5rem}h2{font-size:1.15rem;margin-top:2.2rem;border-bottom:1px solid #ddd;padding-bottom:.2rem}
.answer{background:#f3f6fa;border-left:.4rem solid #0072b2;padding:.8rem 1.2rem;font-size:1.1rem}
.answer.unknown{border-color:#d55e00}.answer.none{border-color:#009e73}
table{border-collapse:collapse;font-size:.9rem;margin:.6rem 0}
td,th{padding:.25rem .7rem;border-bottom:1px solid #e5e5e5;
text-align:left}th{font-weight:600}td.n{text-align:right;font-variant-numeric:tabular-nums}
img{max-width:100%}.note{color:#555;font-size:.92rem}
"""
VERDICTS = {
    "none": "No gap",
    "effect": "A gap with a known cause",
    "unknown": "A gap whose cause is not in the catalogue",
}
MOST_CELLS = 10


def page(report: "GapReport") -> str:
    """The whole page, figures inside."""
    parts = [_head(report), _where(report), _contest(report), _after(report), _remaining(report), _split(report)]
    body = "\n".join([*parts, _made(report)])
    return (
        f'<!DOCTYPE html><html lang="en"><head><meta charset="utf-8"><title>Gap: {escape(_title(report))}</title>'
        f"<style>{STYLE}</style></head><body>{body}</body></html>"
    )


def _title(report: "GapReport") -> str:
    return f"{VERDICTS[report.verdict]}: {report.details['typecode']} flights against {report.details['simulator']}"


def _head(report: "GapReport") -> str:
    lines = " ".join(escape(s) for s in sentences(report))
    return f'<h1>{escape(_title(report))}</h1><p class="answer {report.verdict}">{lines}</p>{_causes(report)}'


def _causes(report: "GapReport") -> str:
    rows = []
    for cause in report.causes:
        sizes = "<br>".join(
            f"{escape(name.replace('_', ' '))}: <b>{number(p['estimate'])}</b>{escape(unit(p))}{interval(p)}"
            for name, p in cause["parameters"].items()
        )
        alike = ", ".join(cause["group"]).replace("_", " ") or "nothing in the catalogue"
        rows.append(
            [
                f"<b>{escape(cause['effect'].replace('_', ' '))}</b><br>{escape(cause_in_words(cause))}",
                sizes,
                escape(alike),
                percent(cause["probability"]),
                _range(cause["closure"]["marginal"]),
            ]
        )
    if not rows:
        return ""
    head = ["effect", "size (90 % interval)", "could as well be", "does best in resampled fleets", "gap closed"]
    return _table(head, rows)


def _range(closure: dict[str, Any]) -> str:
    if closure.get("low") is None:
        return percent(closure.get("estimate"))
    return f"{percent(closure['estimate'])} ({percent(closure['low'])} to {percent(closure['high'])})"


def _where(report: "GapReport") -> str:
    cells = [c for c in report.where if c["share"] > 0][:MOST_CELLS]
    rows = [
        [
            escape(NAMES.get(c["quantity"], c["quantity"])),
            f"FL{c['level_low_fl']:.0f} to FL{c['level_high_fl']:.0f}",
            escape(c["regime"]),
            f"{number(c['difference'])}{escape(unit(c))}",
            f"{number(c['distance'])} (floor {number(c['floor'])})",
            percent(c["share"]),
        ]
        for c in cells
    ]
    head = ["quantity", "where", "transition", "flights less simulator", "distance", "share of the gap"]
    table = _table(head, rows) if rows else "<p>No cell differs by more than chance and by enough to matter.</p>"
    figure = _image(where_figure(report.details["curves"], NAMES), "Map of where flights and simulator differ")
    return (
        "<h2>Where they differ</h2><p>Red: the flights show more than the simulator, blue: less; pale: no more than "
        f"chance. Each row is something measured, from low (left) to high (right).</p>{figure}{table}{_stages(report)}"
    )


def _stages(report: "GapReport") -> str:
    seconds = report.stages.get("seconds")
    if not seconds:
        return ""
    rows = [[name, number(value), percent(report.stages[name])] for name, value in seconds.items()]
    return (
        "<p>What the simulator loses on the way from these flights to its own samples, stage by stage, in seconds for "
        f"each 1,500 ft:</p>{_table(['stage', 'seconds', 'share'], rows)}"
    )


def _contest(report: "GapReport") -> str:
    chosen = [c["effect"] for c in report.causes]
    group = [name for c in report.causes for name in c["group"]]
    figure = _image(contest_figure(report.details["contest"], chosen, group), "Contest of the effects")
    rest = report.details["discrepancy"]
    return (
        "<h2>Which cause explains it</h2><p>Every effect of the catalogue was fitted alone, and judged by how well it "
        "explains flights that it was not fitted to. A shift of any shape, without a cause, competed too: it explains "
        f"{number(max(rest['rest_nats'], 0.0))} nats beyond what is named ({number(rest['explained_nats'])} nats)."
        f"</p>{figure}"
    )


def _after(report: "GapReport") -> str:
    curves = report.details["curves"]
    banded = [q for q, c in curves.items() if c["level_fl"][0] is not None]
    size = {q: max(abs(b / e) for b, e in zip(curves[q]["before"], curves[q]["error"], strict=True)) for q in banded}
    shown = sorted(banded, key=lambda q: -size[q])[:3]
    shown = ["rate", *[q for q in shown if q != "rate"]][:4] if "rate" in banded else shown
    parts = ["<h2>Before and after</h2>"]
    if not report.causes:
        parts.append("<p>Nothing was added to the simulator, so there is only a before.</p>")
    parts.append(_image(curves_figure(curves, shown, NAMES), "Differences before and after"))
    if report.causes:
        rivals = report.causes[0]["rivals"]
        names = " + ".join(c["effect"].replace("_", " ") for c in report.causes)
        figure = closure_figure(report.gap_before, report.gap_after, report.floor, rivals, names)
        closure = report.causes[0]["closure"]
        rows = [
            ["in the distributions", _range(closure["marginal"])],
            ["at each flight's own speed", _range(closure["conditional"])],
            ["learnt on slow flights, tried on fast ones (and back)", _range(closure["transfer"])],
        ]
        parts.append(_image(figure, "Gap before and after, and what rivals would claim"))
        parts.append(_table(["gap closed", ""], rows))
        parts.append(
            '<p class="note">A wrong effect can close much of a gap too: that it closes does not prove the cause. '
            "The choice rests on the contest above.</p>"
        )
    return "".join(parts)


def _remaining(report: "GapReport") -> str:
    left = report.remaining["largest"]
    name = escape(NAMES.get(left["quantity"], left["quantity"]))
    return (
        f"<h2>What remains</h2><p>A gap of {report.remaining['gap']:.3f} spreads above the floor. The largest "
        f"difference left is {number(left['difference'])} in the {name}, "
        f"FL{left['level_low_fl']:.0f} to FL{left['level_high_fl']:.0f} "
        f"({number(left['in_negligible_shifts'])} times what would not matter).</p>"
    )


def _split(report: "GapReport") -> str:
    if not report.would_split:
        return "<h2>What could not be told</h2><p>Nothing that these channels leave open.</p>"
    items = []
    for row in report.would_split:
        names = escape(", ".join(row["between"]).replace("_", " "))
        tell = f"; told by: <b>{escape(', '.join(row['channels']))}</b>" if row["channels"] else ""
        items.append(f"<li>{names}: {escape(row['why'])}{tell}</li>")
    return f"<h2>What could not be told, and what would tell it</h2><ul>{''.join(items)}</ul>"


def _made(report: "GapReport") -> str:
    d = report.details
    rows = [[escape(k.replace("_", " ")), f"{v:,}"] for k, v in report.dropped.items()]
    return (
        f"<h2>How this was made</h2><p class='note'>Normal is what the simulator's {escape(d['normal_from'])} show. "
        f"{d['test']['n_permutations']} permutations of whole aircraft, seed {d['seed']}. Sensitivities at a mass of "
        f"{d['mass_kg']:,.0f} kg. Transition at FL{d['transition_fl']:.0f}.</p>{_table(['counted', ''], rows)}"
    )


def _table(head: list[str], rows: list[list[str]]) -> str:
    top = "".join(f"<th>{escape(h)}</th>" for h in head)
    body = "".join("<tr>" + "".join(f"<td>{cell}</td>" for cell in row) + "</tr>" for row in rows)
    return f"<table><tr>{top}</tr>{body}</table>"


def _image(figure: "Figure", alt: str) -> str:
    content = BytesIO()
    figure.savefig(content, format="png", dpi=110)
    return (
        f'<p><img alt="{escape(alt)}" src="data:image/png;base64,{base64.b64encode(content.getvalue()).decode()}"></p>'
    )
