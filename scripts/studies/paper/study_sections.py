"""Sections of the study's page, each from the files that the study left."""

import json
from pathlib import Path

import polars as pl

from descentflow.densities.checkpoint import load_model
from descentflow.densities.component_search import max_components
from descentflow.evaluation.metrics.score_registry import STATISTICS, level_parts
from descentflow.reporting.pages import figure
from descentflow.representation.fpca.basis import number_of_components
from studies.page_elements import Html, bold, cell, number, paragraph, table
from studies.paper.figures.boxes import boxes_figure
from studies.paper.figures.rejection_rates import rejection_rates_figure
from studies.paper.study_plan import MODELS, StudyPlan
from studies.paper.study_tables import WITHIN

PAPER_SHARE = 0.8
"""Of the variance, that components explain in the paper (section 2.2)."""

Row = list[str]


def flights(plan: StudyPlan, folder: Path, theirs: pl.DataFrame | None) -> list[Html]:
    """Flights of each type, their times to the bottom, and BADA's at all masses.

    Args:
        plan: The study.
        folder: Its folder, with ``flights.json`` and ``mass_range.png`` of every type.
        theirs: The paper's table 1, columns ``typecode n_trajectories max_fl``; ``None`` for no columns of it.

    Example:
        >>> from matplotlib.figure import Figure
        >>> plan, folder = StudyPlan({"A320": 120}, models=("gaussian",)), Path("study_flights")
        >>> (folder / "A320" / "gaussian").mkdir(parents=True)
        >>> facts = {"prepared": 118, "bottom_fl": 150, "top_fl": 353, "spanning": 0.2, "from_fl": 340, "bada_s": 600.0}
        >>> facts |= {"time_s": [500.0, 600.0, 700.0], "bada_range_s": [550.0, 650.0], "explained": 0.4}
        >>> _ = (folder / "A320" / "flights.json").write_text(json.dumps(facts))
        >>> Figure().savefig(folder / "A320" / "mass_range.png")
        >>> text, rows, drawing = flights(plan, folder, None)
        >>> "FL150-353" in str(rows)
        True
    """
    rows: list[Row] = []
    for typecode, n in plan.flights.items():
        facts = json.loads((folder / typecode / "flights.json").read_text())
        low, high = facts["bada_range_s"]
        five, half, ninety_five = facts["time_s"]
        rows.append(
            [
                *(typecode, number(n), number(facts["prepared"]), f"FL{facts['bottom_fl']}-{facts['top_fl']}"),
                *(f"{facts['spanning']:.0%}", f"FL{facts['from_fl']}", f"{five:.0f}", f"{half:.0f}"),
                *(f"{ninety_five:.0f}", f"{facts['bada_s']:.0f}", f"{low:.0f} to {high:.0f}"),
                f"{facts['explained']:.0%}",
                *_paper(theirs, typecode, ("n_trajectories", "max_fl")),
            ]
        )
    head = ["type", "flights", "prepared", "grid", "span it", "from", "5 %", "median", "95 %"]
    head += ["BADA", "BADA, all masses", "explained"]
    head += [] if theirs is None else ["paper: flights", "paper: top"]
    text = paragraph(
        "Time in seconds from a flight level that half of the flights reach down to the bottom of the grid: "
        "percentiles of the held-out flights, BADA's at its reference mass, and its range over all masses. ",
        bold("explained"),
        " is the share of flights whose time some mass gives.",
    )
    first = next(iter(plan.flights))
    caption = f"{first}: flights next to BADA at its reference mass, its least and largest mass, and masses between."
    alt = f"Held-out flights of the {first} and BADA at its masses"
    return [text, table(head, rows), figure(folder / first / "mass_range.png", alt, caption)]


def means_over_types(frame: pl.DataFrame, models: tuple[str, ...]) -> list[Html]:
    """Means over types of every score; ``frame`` from :func:`studies.paper.study_tables.means`.

    Example:
        >>> row = {"quantity": "time_to_bottom_of_descent", "statistic": "ks", "unit": "1", "model": "gmm", "types": 13}
        >>> row |= {"score": 0.12, "floor": 0.1, "over_floor": 1.1, "nominal": None}
        >>> "1.10 floors" in str(means_over_types(pl.DataFrame([row]), ("gmm",))[1])
        True
    """
    rows: list[Row] = []
    for part in frame.partition_by("quantity", "statistic", maintain_order=True):
        first = part.row(0, named=True)
        by_model = {r["model"]: r for r in part.iter_rows(named=True)}
        best = min((r["score"] for r in by_model.values() if r["score"] is not None), default=0.0)
        cells: Row = [
            level_parts()[first["quantity"]].short,
            f"{STATISTICS[first['statistic']].short}{_unit(first['unit'])}",
        ]
        cells += [
            cell(number(r["score"]), "best" if (r["score"] or 0) <= WITHIN * best else "", _to_floor(r))
            for r in (by_model[m] for m in models)
        ]
        floors = [r["floor"] for r in by_model.values() if r["floor"] is not None]
        floor = sum(floors) / len(floors) if floors else None
        rows.append([*cells, number(floor), number(first["nominal"]), str(first["types"])])
    text = paragraph(
        "Small: the distance of samples from flights in noise floors, both at one size; the median over types."
    )
    head = ["quantity", "statistic", *(MODELS[m] for m in models), "floor", "BADA", "types"]
    return [text, table(head, rows, align="llr", grouped=True)]


def boxes(scores: pl.DataFrame, plan: StudyPlan) -> Html:
    """Scores over types as boxes (the paper's figure 7); ``scores`` of all types and models.

    Example:
        >>> row = {"quantity": "time_to_bottom_of_descent", "statistic": "ks", "unit": "1", "model": "gaussian"}
        >>> scores = pl.DataFrame([row | {"score": s, "floor": 0.1, "nominal": None} for s in (0.2, 0.3)])
        >>> "Each dot is a type" in str(boxes(scores, StudyPlan({"A320": 120}, models=("gaussian",))))
        True
    """
    drawn = boxes_figure(scores, {name: MODELS[name] for name in plan.models})
    caption = "Each dot is a type; boxes are quartiles over types. Floor: held-out flights against as many others."
    return figure(drawn, "Boxes of each score over types, a box per model", caption)


def likelihoods(plan: StudyPlan, folder: Path) -> list[Html]:
    """Negative log likelihood of the held-out flights, from every type's ``nll.csv``.

    Example:
        >>> plan, folder = StudyPlan({"A320": 120}, models=("gaussian",)), Path("study_nll")
        >>> (folder / "A320" / "gaussian").mkdir(parents=True)
        >>> nll = pl.DataFrame({"model": ["gaussian"], "nll": [5.52], "error": [0.3], "n": [24]})
        >>> nll.write_csv(folder / "A320" / "nll.csv")
        >>> "5.52" in str(likelihoods(plan, folder)[1])
        True
    """
    rows: list[Row] = []
    for typecode in plan.flights:
        frame = pl.read_csv(folder / typecode / "nll.csv")
        best = float(frame["nll"].min())  # type: ignore[arg-type]
        cells = [
            cell(number(nll, 4), "best" if nll == best else "", f"± {error:.2g}")
            for nll, error in zip(frame["nll"], frame["error"], strict=True)
        ]
        rows.append([typecode, number(int(frame["n"][0])), *cells])
    text = paragraph(
        "Negative log density of the held-out flights' standardised weights, in nats per flight, with the standard "
        "error of the mean; smaller is better, and only models of one type can be compared."
    )
    return [text, table(["type", "held-out flights", *(MODELS[m] for m in plan.models)], rows)]


def scores_of_quantity(frame: pl.DataFrame, models: tuple[str, ...]) -> list[Html]:
    """One of the five tables; ``frame`` from :func:`studies.paper.study_tables.table`.

    Example:
        >>> row = {"typecode": "A320", "statistic": "ks", "unit": "1", "gmm": 0.12, "best": "gmm", "floor": 0.1}
        >>> row |= {"gmm_low": 0.1, "gmm_high": 0.15, "gmm_equal_size": 0.2, "nominal": None}
        >>> "[0.1, 0.15]" in str(scores_of_quantity(pl.DataFrame([row]), ("gmm",))[0])
        True
    """
    papers = [c for c in frame.columns if c.startswith("paper_")]
    head = ["type", "statistic", *(MODELS[m] for m in models), "floor", "BADA", *(_paper_column(c) for c in papers)]
    rows: list[Row] = []
    none = frame.filter(pl.all_horizontal(pl.col(m).is_null().all().over("typecode") for m in models))
    left_out = none["typecode"].unique(maintain_order=True).to_list()
    for r in frame.filter(~pl.col("typecode").is_in(left_out)).iter_rows(named=True):
        best = (r["best"] or "").split()
        cells: Row = [r["typecode"], f"{STATISTICS[r['statistic']].short}{_unit(r['unit'])}"]
        cells += [cell(number(r[m]), "best" if m in best else "", _below(r, m)) for m in models]
        cells += [number(r["floor"]), number(r["nominal"]), *(cell(number(r[c]), "reference") for c in papers)]
        rows.append(cells)
    text = [paragraph(f"Without flights there: {', '.join(left_out)}.")] if left_out else []
    return [table(head, rows, align="llr", grouped=True), *text]


def components(plan: StudyPlan, folder: Path, theirs: pl.DataFrame | None) -> list[Html]:
    """The paper's table 2: principal components of drag and CAS, and components of the mixture.

    Example:
        >>> plan, folder = StudyPlan({"A320": 120}, models=("gaussian",)), Path("study_components")
        >>> (folder / "A320" / "gaussian").mkdir(parents=True)
        >>> _ = (folder / "A320" / "gaussian" / "model.ckpt").write_bytes(Path("best.ckpt").read_bytes())
        >>> ">86</td>" in str(components(plan, folder, None)[1])  # flights that it was trained on
        True
    """
    names = ("n_train", "n_alpha", "n_beta", "n_c", "gmm_max_components", "gmm_components_bic")
    rows: list[Row] = []
    for typecode in plan.flights:
        loaded = {m: load_model(folder / typecode / m / "model.ckpt") for m in plan.models}
        parts = next(iter(loaded.values())).representation
        drag, of_cas = parts.decoder.drag_basis.n_components, parts.decoder.cas_basis
        train, cas = len(parts.split.train), number_of_components(of_cas.explained_variance.cumsum(0), PAPER_SHARE)
        mixture = len(loaded["gmm"].mixture.probs) if "gmm" in loaded else None  # type: ignore[union-attr]
        counts = (train, drag, cas, drag + cas, max_components(train, drag + cas), mixture, of_cas.n_components)
        rows.append([typecode, *(number(c) for c in counts), *_paper(theirs, typecode, names)])
    head = ["type", "trained on", "of drag", "of CAS", "together", "mixture: at most", "mixture", "of CAS, modelled"]
    papers = [] if theirs is None else [f"paper: {name}" for name in head[1:-1]]
    text = paragraph(
        "Principal components that explain 80 % of the variance, of drag and of CAS, and components of the Gaussian "
        "mixture, by AIC as ours are fitted and by BIC in the paper, which allows at most one mixture component per 15 "
        "training flights per parameter. The last column has how many components of CAS are modelled."
    )
    return [text, table(head + papers, rows)]


def rejections(plan: StudyPlan, folder: Path) -> Html:
    """Share of draws that were rejected, by type and model, from ``rejections.json``.

    Example:
        >>> plan, folder = StudyPlan({"A320": 120}, models=("gaussian",)), Path("study_rejections")
        >>> (folder / "A320" / "gaussian").mkdir(parents=True)
        >>> _ = (folder / "A320" / "gaussian" / "rejections.json").write_text('{"acceptance": 0.96}')
        >>> "outside the training flights" in str(rejections(plan, folder))
        True
    """
    rates: dict[str, dict[str, float]] = {}
    for typecode in plan.flights:
        facts = {m: json.loads((folder / typecode / m / "rejections.json").read_text()) for m in plan.models}
        rates[typecode] = {MODELS[m]: 1 - facts[m]["acceptance"] for m in plan.models}
    caption = "Share of draws with a drag or CAS outside the training flights' range at some flight level."
    return figure(rejection_rates_figure(rates), "Share of rejected draws of each type and model", caption)


def of_type(folder: Path) -> list[Html]:
    """Figures of one type; ``folder`` is the type's.

    Example:
        >>> from matplotlib.figure import Figure
        >>> folder = Path("A320_figures")
        >>> folder.mkdir()
        >>> for name in ("profiles", "cuts", "mass_range"):
        ...     Figure().savefig(folder / f"{name}.png")
        >>> len(of_type(folder))
        3
    """
    captions = {
        "profiles": "Held-out flights next to samples of each model.",
        "cuts": "Time to bottom, and CAS and rate at the transition altitude (the grid's middle if it has none).",
        "mass_range": "Held-out flights next to BADA at all its masses.",
    }
    return [figure(folder / f"{name}.png", f"{folder.name}: {text}", text) for name, text in captions.items()]


def _paper(theirs: pl.DataFrame | None, typecode: str, names: tuple[str, ...]) -> list[Html]:
    """The paper's numbers of a type; a dash where they are not published."""
    if theirs is None:
        return []
    row = theirs.filter(typecode=typecode)
    return [cell(number(row[0, name]) if len(row) else "-", "reference") for name in names]


def _paper_column(column: str) -> str:
    name = column.removeprefix("paper_")
    return f"paper: {'BADA' if name == 'bada' else {'gmm': 'mixture', 'gaussian': 'Gaussian'}.get(name, name)}"


def _to_floor(row: dict[str, float | None]) -> str:
    ratio = row["over_floor"]
    return "" if ratio is None else f"{ratio:.2f} floors"


def _below(row: dict[str, float | None], model: str) -> str:
    low, high, matched = (number(row[f"{model}{ending}"], 2) for ending in ("_low", "_high", "_equal_size"))
    bounds = ["" if low == "-" else f"[{low}, {high}]", "" if matched == "-" else f"matched {matched}"]
    return " ".join(filter(None, bounds))


def _unit(unit: str) -> str:
    return "" if unit == "1" else f" ({unit})"
