"""Distances of samples from flights, type by type, at one size: ratios to the noise floor, excess, whole descents."""

from pathlib import Path

import polars as pl

from descentflow.evaluation.metrics.score_registry import level_parts, statistics_of
from descentflow.evaluation.metrics.statistic_kinds import DescentStatistic
from studies.paper.study_plan import StudyPlan

STATISTICS = ("ks", "wasserstein")
"""Distances whose ratio to the floor is given: the error of the mean has none of the shape."""
LARGE = 1_000
"""Flights of a type from which on it counts for the worst: of fewer, few are held out, and ratios are of small sets."""
QUANTITIES = {name: part.short for name, part in level_parts().items()}


def ratios(scores: pl.DataFrame) -> pl.DataFrame:
    """Distances over their noise floor: one row for each type and model, a column for each quantity and statistic.

    Args:
        scores: From :func:`~studies.paper.study_tables.all_scores`.

    Returns:
        Columns ``typecode model n_each``, flights on each side at flight levels, and ``quantity/statistic`` with, after
        it, ``quantity/statistic excess`` in spreads.

    Example:
        >>> row = {"typecode": "A320", "model": "gmm", "quantity": "cas_above_transition", "statistic": "ks"}
        >>> found = ratios(pl.DataFrame([row | {"over_floor": 1.2, "excess": 0.1, "n_each": 200}]))
        >>> found.row(0, named=True)["cas_above_transition/ks"]
        1.2
    """
    rows = []
    for part in scores.partition_by("typecode", "model", maintain_order=True):
        first = part.row(0, named=True)
        row: dict[str, object] = {
            "typecode": first["typecode"],
            "model": first["model"],
            "n_each": part["n_each"].max(),
        }
        scores_of = {(r["quantity"], r["statistic"]): r for r in part.iter_rows(named=True)}
        for quantity in QUANTITIES:
            for statistic in STATISTICS:
                score = scores_of.get((quantity, statistic), {})
                row[f"{quantity}/{statistic}"] = score.get("over_floor")
                row[f"{quantity}/{statistic} excess"] = score.get("excess")
        rows.append(row)
    return pl.DataFrame(rows, infer_schema_length=None)


def summary(ratios: pl.DataFrame, flights: dict[str, int]) -> pl.DataFrame:
    """Median over types, and the worst of the types with a thousand flights and more, of every ratio and model.

    Args:
        ratios: From :func:`ratios`.
        flights: Flights of each type.

    Returns:
        Columns ``model of`` (``median`` or ``worst of N large``) and ``quantity/statistic``.

    Example:
        >>> frame = pl.DataFrame({"typecode": ["A320", "E190", "BE20"], "model": "gmm"})
        >>> frame = frame.with_columns(pl.Series("cas_above_transition/ks", [1.0, 1.4, 2.0]))
        >>> summary(frame, {"A320": 9_000, "E190": 5_000, "BE20": 200})["cas_above_transition/ks"].to_list()
        [1.4, 1.4]
    """
    columns = [c for c in ratios.columns if "/" in c and not c.endswith("excess")]
    large = [name for name, n in flights.items() if n >= LARGE]
    tables = []
    for model in ratios["model"].unique(maintain_order=True):
        own = ratios.filter(pl.col("model") == model)
        kinds = {"median": (own, pl.col(columns).median())}
        if large:
            kinds[f"worst of {len(large)} large"] = (
                own.filter(pl.col("typecode").is_in(large)),
                pl.col(columns).max(),
            )
        for name, (rows, how) in kinds.items():
            tables.append(rows.select(how).select(pl.lit(model).alias("model"), pl.lit(name).alias("of"), *columns))
    return pl.concat(tables, how="vertical_relaxed")


def whole_descents(plan: StudyPlan, folder: Path) -> pl.DataFrame:
    """Statistics of whole descents of every type and model, with what the classifier looks at.

    Args:
        plan: The study.
        folder: Its folder, with ``scores.csv``, ``intervals.csv`` and ``classifier.csv`` of every type and model.

    Returns:
        Columns ``typecode model``, those of the scores, ``low high`` of the 90 % interval, and ``looks_at``, the bands
        with which the AUC loses most.

    Example:
        >>> plan, folder = StudyPlan({"A320": 120}, models=("gmm",)), Path("study_whole")
        >>> (folder / "A320" / "gmm").mkdir(parents=True)
        >>> one = {"quantity": "descent", "statistic": "auc"}
        >>> pl.DataFrame([one | {"score": 0.7}]).write_csv(folder / "A320" / "gmm" / "scores.csv")
        >>> pl.DataFrame([one | {"low": 0.6, "high": 0.8}]).write_csv(folder / "A320" / "gmm" / "intervals.csv")
        >>> bands = [{"quantity": "rate", "low_fl": 150, "high_fl": 175, "loss": 0.14}]
        >>> pl.DataFrame(bands).write_csv(folder / "A320" / "gmm" / "classifier.csv")
        >>> whole_descents(plan, folder).select("score", "low", "looks_at").row(0)
        (0.7, 0.6, 'rate FL150-175: 0.14')
    """
    names = [statistic.name for statistic in statistics_of(DescentStatistic)]
    parts = []
    for typecode in plan.flights:
        for name in plan.models:
            place = folder / typecode / name
            scores, intervals, looked = (
                pl.read_csv(place / f"{kind}.csv", infer_schema_length=None)
                for kind in ("scores", "intervals", "classifier")
            )
            chosen = scores.filter(pl.col("statistic").is_in(names)).join(
                intervals, on=["quantity", "statistic"], how="left"
            )
            about = (pl.lit(value).alias(key) for key, value in (("typecode", typecode), ("model", name)))
            parts.append(chosen.select(*about, pl.all(), pl.lit(_looked_at(looked)).alias("looks_at")))
    return pl.concat(parts, how="diagonal_relaxed")


def _looked_at(importance: pl.DataFrame, n: int = 3) -> str:
    """The bands with which the AUC loses most; rows of all levels of a quantity, its widest, are left out."""
    if importance.is_empty():
        return ""
    width = pl.col("high_fl") - pl.col("low_fl")
    bands = importance.filter((width < width.max().over("quantity")) | (pl.len().over("quantity") == 1))
    top = bands.sort("loss", descending=True).head(n)
    return "; ".join(
        f"{r['quantity']} FL{r['low_fl']:.0f}-{r['high_fl']:.0f}: {r['loss']:.2f}" for r in top.iter_rows(named=True)
    )
