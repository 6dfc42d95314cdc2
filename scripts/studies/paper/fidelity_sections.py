"""Sections of the study's page on how far samples are from flights, at one size for all types."""

from pathlib import Path

import polars as pl

from descentflow.evaluation.metrics.noise_floor import SIZE
from descentflow.evaluation.metrics.score_registry import STATISTICS as REGISTERED
from studies.page_elements import Html, cell, number, paragraph, table
from studies.paper.fidelity_tables import QUANTITIES, STATISTICS, summary, whole_descents
from studies.paper.study_plan import MODELS, StudyPlan

Row = list[str]


def over_floor(frame: pl.DataFrame, plan: StudyPlan) -> list[Html]:
    """Distances over their noise floor; ``frame`` from :func:`studies.paper.fidelity_tables.ratios`.

    Example:
        >>> from studies.paper.fidelity_tables import ratios
        >>> row = {"typecode": "A320", "model": "gmm", "quantity": "cas_above_transition", "statistic": "ks"}
        >>> frame = ratios(pl.DataFrame([row | {"over_floor": 1.23, "excess": 0.1, "n_each": 200}]))
        >>> "1.23" in str(over_floor(frame, StudyPlan({"A320": 1200}, models=("gmm",)))[1])
        True
    """
    keys = [f"{quantity}/{statistic}" for quantity in QUANTITIES for statistic in STATISTICS]
    head = ["model", "type", "flights a side"]
    head += [f"{QUANTITIES[k.split('/')[0]]}, {REGISTERED[k.split('/')[1]].short}" for k in keys]
    rows: list[Row] = []
    summed = summary(frame, plan.flights)
    for model in plan.models:
        for r in summed.filter(pl.col("model") == model).iter_rows(named=True):
            rows.append([MODELS[model], cell(r["of"], "best"), "", *(cell(_ratio(r[k]), "best") for k in keys)])
        for r in frame.filter(pl.col("model") == model).iter_rows(named=True):
            cells = [cell(_ratio(r[k]), "", number(r[f"{k} excess"], 2)) for k in keys]
            rows.append([MODELS[model], r["typecode"], number(r["n_each"]), *cells])
    text = paragraph(
        f"Distance of samples from flights over that of other flights, {SIZE} on each side, or half of the held-out "
        "flights where fewer than twice as many were held out; times to the bottom are of those that span the grid, "
        "which are fewer. 1 is what chance alone gives. Small: the excess over the floor, in standard deviations of "
        "the flights (a share of the flights for KS). Ratios of one size compare between types."
    )
    return [text, table(head, rows, align="llr", grouped=True)]


def descents(plan: StudyPlan, folder: Path) -> list[Html]:
    """Energy score and classifier of whole descents, from the files of every type and model.

    Example:
        >>> plan, folder = StudyPlan({"A320": 120}, models=("gmm",)), Path("study_descents_told")
        >>> (folder / "A320" / "gmm").mkdir(parents=True)
        >>> one = {"quantity": "descent", "statistic": "auc", "equal_size": 0.65, "floor": 0.5, "n_each": 12}
        >>> pl.DataFrame([one | {"score": 0.7}]).write_csv(folder / "A320" / "gmm" / "scores.csv")
        >>> ends = {"quantity": "descent", "statistic": "auc", "low": 0.6, "high": 0.8}
        >>> pl.DataFrame([ends]).write_csv(folder / "A320" / "gmm" / "intervals.csv")
        >>> bands = [{"quantity": "rate", "low_fl": 150, "high_fl": 175, "loss": 0.14}]
        >>> pl.DataFrame(bands).write_csv(folder / "A320" / "gmm" / "classifier.csv")
        >>> "[0.6, 0.8]" in str(descents(plan, folder)[1])
        True
    """
    rows: list[Row] = []
    for r in whole_descents(plan, folder).iter_rows(named=True):
        interval = "" if r["low"] is None else f"[{number(r['low'], 2)}, {number(r['high'], 2)}]"
        looks = r["looks_at"] if r["statistic"] == "auc" else ""
        cells: Row = [r["typecode"], MODELS[r["model"]], REGISTERED[r["statistic"]].label]
        cells.append(cell(number(r["score"]), "", interval))
        rows.append([*cells, *(number(r[name]) for name in ("equal_size", "floor", "n_each")), looks])
    text = paragraph(
        "The classifier, gradient boosting, is shown flights and samples that enter alike, and its AUC is the "
        "probability that a flight looks more like a flight than a sample does: 0.5 if they cannot be told apart. "
        "Floor: flights in place of the samples. It learns more from more flights, so types compare at one size "
        "(matched). Last: how much AUC is lost where a quantity of some levels is exchanged between flights and "
        "samples. The joint energy score is of CAS and rate at all levels, in spreads of the flights."
    )
    head = ["type", "model", "statistic", "all", "matched", "floor", "flights a side", "looks at"]
    return [text, table(head, rows, align="lllrrrrl", grouped=True)]


def _ratio(value: float | None) -> str:
    return "-" if value is None or value != value else f"{value:.2f}"
