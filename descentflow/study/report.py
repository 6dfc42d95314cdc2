"""One self-contained HTML page of a study: means over types, the five tables, and each type's figures."""

import base64
import html
from collections.abc import Iterable
from pathlib import Path

import polars as pl

from descentflow.densities.checkpoint import load_model
from descentflow.files import whole_file
from descentflow.study.plan import MODELS, StudyPlan
from descentflow.study.tables import QUANTITIES, STATISTICS, all_scores, means, table

STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; max-width: 1200px; margin: 2em auto; padding: 0 1em; color: #222; }
img { width: 100%; height: auto; } h2 { margin-top: 2em; border-bottom: 1px solid #ccc; }
table { border-collapse: collapse; font-size: 13px; margin: 0.6em 0; }
td, th { padding: 2px 9px; text-align: right; border-bottom: 1px solid #e4e4e4; }
td:first-child, th:first-child, td:nth-child(2), th:nth-child(2) { text-align: left; }
.best { font-weight: bold; } .paper { color: #777; } details { margin: 0.5em 0; }
@media print { body { max-width: none; font-size: 11px; } details { display: block; } h2 { break-after: avoid; } }
"""
FIGURES = {"profiles": "Samples beside held-out flights", "cuts": "Distributions at the transition altitude"}
INTRODUCTION = """
Each model was fitted to the training flights of a type and sampled; initial levels are those of the held-out flights.
<b>floor</b> is the distance between two halves of the held-out flights, <b>equal size</b> that of as many samples from
such a half: a perfect generator has its equal-size distance at the floor, not at zero. Bold: within 5 % of the best
model of the row; in brackets, 90 % intervals over held-out flights.
<b>nominal</b> is BADA's one descent with the coefficients used here; only its mean can be compared.
"""
PUBLISHED = """<p class="paper">Grey: the paper's published figures, from other flights and EUROCONTROL's coefficients.
They are a yardstick of order of magnitude, not a target.</p>"""


def write_report(plan: StudyPlan, folder: Path, published: Path | None = None) -> Path:
    """Write ``report.html`` and the tables as CSV from the files that a finished study left.

    Args:
        plan: The study.
        folder: Its folder.
        published: The paper's scores as CSV, for columns of their own.

    Returns:
        The page.
    """
    scores = all_scores(plan, folder)
    theirs = None if published is None else pl.read_csv(published, infer_schema_length=None)
    parts = ["<h2>Means over types</h2>", _means(means(scores))]
    for quantity, heading in QUANTITIES.items():
        one = table(scores, quantity, theirs)
        with whole_file(folder / f"{quantity}.csv") as temporary:
            one.write_csv(temporary)
        parts += [f"<h2>{heading}</h2>", _table(one, plan.models)]
    parts += ["<h2>Components and clusters</h2>", _components(plan, folder)]
    for typecode in plan.flights:
        parts += [f"<h2>{typecode}</h2>", *_figures(folder / typecode, plan.models)]
    source = "simulated flights" if plan.store is None else html.escape(plan.store)
    title = f"Study of {len(plan.flights)} types: {sum(plan.flights.values()):,} {source}"
    head = f"<!doctype html><html lang=en><meta charset=utf-8><title>{title}</title><style>{STYLE}</style>"
    body = f"<h1>{title}</h1><p>{INTRODUCTION}</p>{PUBLISHED if theirs is not None else ''}{''.join(parts)}</html>"
    with whole_file(folder / "report.html") as temporary:
        temporary.write_text(head + body)
    return folder / "report.html"


def _means(frame: pl.DataFrame) -> str:
    head = ("quantity", "statistic", "model", "types", "score", "equal size", "floor", "median ratio", "nominal")
    rows = [
        (
            QUANTITIES[r["quantity"]],
            f"{STATISTICS[r['statistic']]} ({r['unit']})",
            MODELS[r["model"]],
            str(r["types"]),
            *(_number(r[c]) for c in ("score", "equal_size", "floor", "over_floor", "nominal")),
        )
        for r in frame.iter_rows(named=True)
    ]
    return _rows(head, ([(cell, "") for cell in row] for row in rows))


def _table(frame: pl.DataFrame, models: tuple[str, ...]) -> str:
    papers = [c for c in frame.columns if c.startswith("paper_")]
    head = ["type", "statistic", *(MODELS[m] for m in models), *(f"{MODELS[m]}, equal size" for m in models)]
    head += ["floor", "nominal", *(c.replace("_", ": ") for c in papers)]
    rows = []
    for r in frame.iter_rows(named=True):
        best = (r["best"] or "").split()
        cells = [(r["typecode"], ""), (f"{STATISTICS[r['statistic']]} ({r['unit']})", "")]
        cells += [(_with_interval(r, m), "best" if m in best else "") for m in models]
        cells += [(_number(r[f"{m}_equal_size"]), "") for m in models]
        cells += [(_number(r["floor"]), ""), (_number(r["nominal"]), ""), *((_number(r[c]), "paper") for c in papers)]
        rows.append(cells)
    return _rows(head, rows)


def _components(plan: StudyPlan, folder: Path) -> str:
    """The paper's table 2: components of drag and CAS, and clusters by BIC."""
    rows = []
    for typecode, flights in plan.flights.items():
        loaded = {m: load_model(folder / typecode / m / "model.ckpt") for m in plan.models}
        decoder = next(iter(loaded.values())).representation.decoder
        split = next(iter(loaded.values())).representation.split
        clusters = len(loaded["gmm"].mixture.probs) if "gmm" in loaded else None  # type: ignore[union-attr, arg-type]
        counts = (flights, len(split.train), decoder.drag_basis.n_components, decoder.cas_basis.n_components, clusters)
        span = f"FL{decoder.levels_fl[0]:.0f}-{decoder.levels_fl[-1]:.0f}"
        rows.append([(typecode, ""), (span, ""), *((_number(c), "") for c in counts)])
    return _rows(("type", "grid", "flights", "trained on", "components of drag", "of CAS", "clusters by BIC"), rows)


def _figures(folder: Path, models: tuple[str, ...]) -> Iterable[str]:
    for name in models:
        for figure, heading in FIGURES.items():
            data = base64.b64encode((folder / name / f"{figure}.png").read_bytes()).decode("ascii")
            text = f"{heading}: {MODELS[name]}"
            yield f'<details><summary>{text}</summary><img alt="{text}" src="data:image/png;base64,{data}"></details>'


def _rows(head: Iterable[str], rows: Iterable[Iterable[tuple[str, str]]]) -> str:
    top = "".join(f"<th>{html.escape(c)}</th>" for c in head)
    body = "".join(
        "<tr>" + "".join(f'<td class="{kind}">{html.escape(text)}</td>' for text, kind in row) + "</tr>" for row in rows
    )
    return f"<table><tr>{top}</tr>{body}</table>"


def _with_interval(row: dict[str, float | None], model: str) -> str:
    text, low, high = (_number(row[f"{model}{ending}"]) for ending in ("", "_low", "_high"))
    return text if low == "-" else f"{text} [{low}, {high}]"


def _number(value: float | None) -> str:
    if value is None:
        return "-"
    if isinstance(value, int):
        return f"{value:,}"
    return f"{value:.0f}" if abs(value) >= 100 else f"{value:.3g}"
