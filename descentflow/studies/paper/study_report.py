"""One self-contained HTML page of a study: means over types, the five tables, figures, components, each type."""

import html
import json
from dataclasses import dataclass
from pathlib import Path

import polars as pl

from descentflow.core.errors import DataError
from descentflow.core.files import whole_file
from descentflow.densities.checkpoint import load_model
from descentflow.densities.em import most_clusters
from descentflow.studies.paper.figures.boxes import boxes_figure
from descentflow.studies.paper.figures.rejection_rates import rejection_rates_figure
from descentflow.studies.paper.study_page import Cell, number, page, picture, picture_of, png, rows
from descentflow.studies.paper.study_plan import MODELS, StudyPlan
from descentflow.studies.paper.study_tables import QUANTITIES, WITHIN, all_scores, means, table
from descentflow.studies.paper.sweep_report import sweep_sections

INTRODUCTION = """
<p>Each model was fitted to the training flights of a type and sampled; initial levels are those of the held-out
flights. A <b>score</b> is the distance between all samples and all held-out flights; in brackets its 90 % interval
over held-out flights. <b>Floor</b> is the distance between two halves of the held-out flights and <b>half</b> that of
as many samples from such a half: a perfect generator has its half at the floor, not at zero. <b>Bold</b>: within 5 %
of the best model of the row. <b>KS</b> is the Kolmogorov-Smirnov distance, <b>mean</b> the error of the mean, both
averaged over levels for CAS and rate. <b>BADA</b> is the one nominal descent with the coefficients used here: only its
mean can be compared.</p>"""
PUBLISHED = """<p class="paper">Grey: the paper's published figures, from other flights and EUROCONTROL's
coefficients. They are a yardstick of order of magnitude, not a target.</p>"""
STATISTIC = {"ks": "KS", "wasserstein": "Wasserstein", "mae": "mean"}
SHORT = {
    "time_to_bottom_of_descent": "time to bottom",
    "cas_above_transition": "CAS above transition",
    "cas_below_transition": "CAS below",
    "rocd_above_transition": "rate above transition",
    "rocd_below_transition": "rate below",
}


@dataclass(frozen=True)
class Published:
    """The paper's figures: scores (its five tables) and types (its tables 1 and 2); either may be missing."""

    scores: pl.DataFrame | None = None
    types: pl.DataFrame | None = None


def read_published(path: Path | None) -> Published:
    """Read ``published_scores.csv`` and ``published_types.csv`` of a folder, or one CSV of scores.

    Raises:
        DataError: If the path holds neither.
    """
    if path is None:
        return Published()
    scores, types = (path / "published_scores.csv", path / "published_types.csv") if path.is_dir() else (path, None)
    found = [None if p is None or not p.exists() else pl.read_csv(p, infer_schema_length=None) for p in (scores, types)]
    if all(frame is None for frame in found):
        raise DataError(
            f"no published figures at {path}", expected="published_scores.csv", mend="give its folder or the file"
        )
    return Published(*found)


def write_report(plan: StudyPlan, folder: Path, published: Path | None = None) -> Path:
    """Write ``report.html`` and the tables as CSV from the files that a finished study left.

    Args:
        plan: The study.
        folder: Its folder.
        published: The paper's figures, for columns of their own; see :func:`read_published`.

    Returns:
        The page.
    """
    scores, theirs = all_scores(plan, folder), read_published(published)
    first = next(iter(plan.flights))
    sections = [
        ("Flights and what BADA's mass explains of them", _flights(plan, folder, first, theirs.types)),
        ("Means over types", _means(means(scores), plan.models)),
        ("Scores over types", _boxes(scores, plan)),
        ("Likelihood of held-out flights", _likelihoods(plan, folder)),
    ]
    for quantity, heading in QUANTITIES.items():
        one = table(scores, quantity, theirs.scores)
        with whole_file(folder / f"{quantity}.csv") as temporary:
            one.write_csv(temporary)
        sections.append((heading, _table(one, plan.models)))
    sections.append(("Components and clusters", _components(plan, folder, theirs.types)))
    sections.append(("Rejected draws", _rejections(plan, folder)))
    sections += sweep_sections(plan, folder)
    sections += [(typecode, _type(plan, folder / typecode)) for typecode in plan.flights]
    source = "simulated flights" if plan.store is None else plan.store
    title = f"Study of {len(plan.flights)} types: {sum(plan.flights.values()):,} {source}"
    introduction = _settings(plan) + INTRODUCTION + (PUBLISHED if theirs.scores is not None else "")
    with whole_file(folder / "report.html") as temporary:
        temporary.write_text(page(title, sections, introduction))
    return folder / "report.html"


def _settings(plan: StudyPlan) -> str:
    models = ", ".join(MODELS[name] for name in plan.models)
    source = f"simulated, scenario {plan.scenario}" if plan.store is None else "prepared from a store"
    epochs = "" if plan.max_epochs is None else f" at most {plan.max_epochs} epochs,"
    text = f"Flights: {source}. Models: {models};{epochs} {plan.n_samples:,} samples each, seed {plan.seed}."
    return f"<p>{html.escape(text)}</p>"


def _flights(plan: StudyPlan, folder: Path, first: str, theirs: pl.DataFrame | None) -> str:
    lines: list[list[Cell]] = []
    for typecode, flights in plan.flights.items():
        told = json.loads((folder / typecode / "flights.json").read_text())
        low, high = told["bada_range_s"]
        five, half, ninety_five = told["time_s"]
        lines.append(
            [
                *(typecode, number(flights), number(told["prepared"]), f"FL{told['bottom_fl']}-{told['top_fl']}"),
                *(f"{told['spanning']:.0%}", f"FL{told['from_fl']}", f"{five:.0f}", f"{half:.0f}"),
                *(f"{ninety_five:.0f}", f"{told['bada_s']:.0f}", f"{low:.0f} to {high:.0f}"),
                f"{told['explained']:.0%}",
                *_paper(theirs, typecode, ("n_trajectories", "max_fl")),
            ]
        )
    head = ["type", "flights", "prepared", "grid", "span it", "from", "5 %", "half", "95 %"]
    head += ["BADA", "BADA, all masses", "explained"]
    head += [] if theirs is None else ["paper: flights", "paper: top"]
    text = (
        "<p>Time in seconds from a level that half of the flights reach down to the bottom of the grid: percentiles of "
        "the held-out flights, BADA's at its reference mass, and its range over all masses. <b>explained</b> is the "
        "share of flights whose time some mass gives.</p>"
    )
    caption = f"{first}: flights beside BADA at its reference mass, its least and largest mass, and masses between."
    return text + rows(head, lines) + picture(folder / first / "mass_range.png", caption)


def _means(frame: pl.DataFrame, models: tuple[str, ...]) -> str:
    lines: list[list[Cell]] = []
    for part in frame.partition_by("quantity", "statistic", maintain_order=True):
        first = part.row(0, named=True)
        found = {r["model"]: r for r in part.iter_rows(named=True)}
        best = min((r["score"] for r in found.values() if r["score"] is not None), default=0.0)
        cells: list[Cell] = [SHORT[first["quantity"]], f"{STATISTIC[first['statistic']]}{_unit(first['unit'])}"]
        cells += [
            (number(r["score"]), "best" if (r["score"] or 0) <= WITHIN * best else "", _to_floor(r))
            for r in (found[m] for m in models)
        ]
        floors = [r["floor"] for r in found.values() if r["floor"] is not None]
        floor = sum(floors) / len(floors) if floors else None
        lines.append([*cells, number(floor), number(first["nominal"]), str(first["types"])])
    text = "<p>Small: the distance of half the flights from as many samples, in floors; the median over types.</p>"
    head = ["quantity", "statistic", *(MODELS[m] for m in models), "floor", "BADA", "types"]
    return text + rows(head, lines, words=2)


def _to_floor(row: dict[str, float | None]) -> str:
    ratio = row["over_floor"]
    return "" if ratio is None else f"half {ratio:.2f} floors"


def _boxes(scores: pl.DataFrame, plan: StudyPlan) -> str:
    figure = boxes_figure(scores, {name: MODELS[name] for name in plan.models})
    caption = "Each dot is a type; boxes are quartiles over types. Floor: two halves of the held-out flights."
    return picture_of(png(figure), caption)


def _likelihoods(plan: StudyPlan, folder: Path) -> str:
    lines: list[list[Cell]] = []
    for typecode in plan.flights:
        frame = pl.read_csv(folder / typecode / "nll.csv")
        best = float(frame["nll"].min())  # type: ignore[arg-type]
        cells: list[Cell] = [
            (number(nll, 4), "best" if nll == best else "", f"± {error:.2g}")
            for nll, error in zip(frame["nll"], frame["error"], strict=True)
        ]
        lines.append([typecode, number(int(frame["n"][0])), *cells])
    text = (
        "<p>Negative log density of the held-out flights' standardised weights, nats a flight, with the standard error "
    )
    text += "of the mean; less is better, and only models of one type can be compared.</p>"
    return text + rows(["type", "held-out flights", *(MODELS[m] for m in plan.models)], lines)


def _table(frame: pl.DataFrame, models: tuple[str, ...]) -> str:
    papers = [c for c in frame.columns if c.startswith("paper_")]
    head = ["type", "statistic", *(MODELS[m] for m in models), "floor", "BADA", *(_papers(c) for c in papers)]
    lines: list[list[Cell]] = []
    none = frame.filter(pl.all_horizontal(pl.col(m).is_null().all().over("typecode") for m in models))
    left_out = none["typecode"].unique(maintain_order=True).to_list()
    for r in frame.filter(~pl.col("typecode").is_in(left_out)).iter_rows(named=True):
        best = (r["best"] or "").split()
        cells: list[Cell] = [r["typecode"], f"{STATISTIC[r['statistic']]}{_unit(r['unit'])}"]
        cells += [(number(r[m]), "best" if m in best else "", _below(r, m)) for m in models]
        cells += [number(r["floor"]), number(r["nominal"]), *((number(r[c]), "paper") for c in papers)]
        lines.append(cells)
    text = f"<p>Without flights there: {html.escape(', '.join(left_out))}.</p>" if left_out else ""
    return rows(head, lines, words=2) + text


def _papers(column: str) -> str:
    name = column.removeprefix("paper_")
    return f"paper: {'BADA' if name == 'bada' else {'gmm': 'mixture', 'gaussian': 'Gaussian'}.get(name, name)}"


def _below(row: dict[str, float | None], model: str) -> str:
    low, high, half = (number(row[f"{model}{ending}"], 2) for ending in ("_low", "_high", "_equal_size"))
    return " ".join(filter(None, ["" if low == "-" else f"[{low}, {high}]", "" if half == "-" else f"half {half}"]))


def _components(plan: StudyPlan, folder: Path, theirs: pl.DataFrame | None) -> str:
    """The paper's table 2: components of drag and CAS, and clusters by BIC."""
    names = ("n_train", "n_alpha", "n_beta", "n_c", "gmm_max_components", "gmm_components_bic")
    lines: list[list[Cell]] = []
    for typecode in plan.flights:
        loaded = {m: load_model(folder / typecode / m / "model.ckpt") for m in plan.models}
        parts = next(iter(loaded.values())).representation
        drag, cas = parts.decoder.drag_basis.n_components, parts.decoder.cas_basis.n_components
        train = len(parts.split.train)
        clusters = len(loaded["gmm"].mixture.probs) if "gmm" in loaded else None  # type: ignore[union-attr, arg-type]
        counts = (train, drag, cas, drag + cas, most_clusters(train, drag + cas), clusters)
        lines.append([typecode, *(number(c) for c in counts), *_paper(theirs, typecode, names)])
    head = ["type", "trained on", "of drag", "of CAS", "together", "most clusters", "clusters by BIC"]
    papers = [] if theirs is None else [f"paper: {name}" for name in head[1:]]
    text = (
        "<p>Components that explain the variance asked for, and clusters of the mixture by BIC; the paper allows one "
    )
    text += "cluster for every 15 training flights a parameter.</p>"
    return text + rows(head + papers, lines)


def _paper(theirs: pl.DataFrame | None, typecode: str, names: tuple[str, ...]) -> list[Cell]:
    """The paper's numbers of a type, in grey; nothing where they are not given."""
    if theirs is None:
        return []
    row = theirs.filter(typecode=typecode)
    return [(number(row[0, name]) if len(row) else "-", "paper") for name in names]


def _rejections(plan: StudyPlan, folder: Path) -> str:
    rates: dict[str, dict[str, float]] = {}
    for typecode in plan.flights:
        told = {m: json.loads((folder / typecode / m / "rejections.json").read_text()) for m in plan.models}
        rates[typecode] = {MODELS[m]: 1 - told[m]["acceptance"] for m in plan.models}
    caption = "Share of draws with a drag or CAS outside the training flights' range at some level."
    return picture_of(png(rejection_rates_figure(rates)), caption)


def _type(plan: StudyPlan, folder: Path) -> str:
    captions = {
        "profiles": "Held-out flights beside samples of each model.",
        "cuts": "Time to bottom, and CAS and rate at the transition altitude (the grid's middle if it has none).",
        "mass_range": "Held-out flights beside BADA at all its masses.",
    }
    return "".join(picture(folder / f"{name}.png", caption) for name, caption in captions.items())


def _unit(unit: str) -> str:
    return "" if unit == "1" else f" ({unit})"
