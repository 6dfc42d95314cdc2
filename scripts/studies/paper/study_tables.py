"""The paper's five tables from the scores of every type and model, and means over types."""

from pathlib import Path

import polars as pl

from descentflow.evaluation.metrics.score_registry import level_parts
from studies.paper.study_plan import MODELS, PAPER_STATISTICS, StudyPlan

QUANTITIES = {name: part.label for name, part in level_parts().items()}
"""Quantity of the scores -> heading of the paper's table."""
_BY_MODEL = {"score": "", "equal_size": "_equal_size", "low": "_low", "high": "_high"}
"""Column of the scores -> ending of the model's column in a table."""
WITHIN = 1.05
"""The paper marks every model within 5 % of the best."""


def all_scores(plan: StudyPlan, folder: Path) -> pl.DataFrame:
    """The paper's scores of every type and model, one row per quantity and statistic; other scores are left out.

    Returns:
        Columns ``typecode model``, those of :class:`descentflow.evaluation.metrics.score_table.Score`, and ``low
        high``, the ends of the score's 90 % interval over held-out flights.

    Args:
        plan: The study.
        folder: Its folder, with ``scores.csv`` and ``intervals.csv`` of every type and model.

    Example:
        >>> plan, folder = StudyPlan({"A320": 120}, models=("gmm",)), Path("study_scores")
        >>> (folder / "A320" / "gmm").mkdir(parents=True)
        >>> one = {"quantity": "time_to_bottom_of_descent", "statistic": "ks"}
        >>> rest = dict.fromkeys(("equal_size", "floor", "floor_high", "over_floor", "excess", "nominal", "worst_fl"))
        >>> pl.DataFrame([one | rest | {"score": 0.12}]).write_csv(folder / "A320" / "gmm" / "scores.csv")
        >>> pl.DataFrame([one | {"low": 0.1, "high": 0.2}]).write_csv(folder / "A320" / "gmm" / "intervals.csv")
        >>> all_scores(plan, folder).select("model", "score", "low", "high").row(0)
        ('gmm', 0.12, 0.1, 0.2)
    """
    parts = []
    for typecode in plan.flights:
        for name in plan.models:
            frame = pl.read_csv(folder / typecode / name / "scores.csv", infer_schema_length=None)
            numbers = ("score", "equal_size", "floor", "floor_high", "over_floor", "excess", "nominal", "worst_fl")
            frame = frame.with_columns(pl.col(c).cast(pl.Float64) for c in numbers)
            intervals = pl.read_csv(folder / typecode / name / "intervals.csv", infer_schema_length=None)
            ends = intervals.with_columns(pl.col("low", "high").cast(pl.Float64))
            frame = frame.join(ends, on=["quantity", "statistic"], how="left")
            frame = frame.filter(
                pl.col("quantity").is_in(list(QUANTITIES)), pl.col("statistic").is_in(list(PAPER_STATISTICS))
            )
            parts.append(frame.select(pl.lit(typecode).alias("typecode"), pl.lit(name).alias("model"), pl.all()))
    return pl.concat(parts, how="diagonal_relaxed")


def with_best(scores: pl.DataFrame) -> pl.DataFrame:
    """Mark, for each type, quantity and statistic, the models within 5 % of the best.

    Args:
        scores: From :func:`all_scores`.

    Returns:
        The scores with a column ``best`` of booleans.

    Example:
        >>> about = {"typecode": "A320", "quantity": "time_to_bottom_of_descent", "statistic": "ks", "unit": "1"}
        >>> about |= {"equal_size": 0.2, "floor": 0.1, "nominal": None, "low": 0.1, "high": 0.3}
        >>> scores = pl.DataFrame([about | {"model": m, "score": s} for m, s in (("gaussian", 0.2), ("gmm", 0.12))])
        >>> with_best(scores)["best"].to_list()
        [False, True]
    """
    best = pl.col("score").min().over("typecode", "quantity", "statistic")
    return scores.with_columns(best=(pl.col("score") <= WITHIN * best).fill_null(False))


def table(scores: pl.DataFrame, quantity: str, published: pl.DataFrame | None = None) -> pl.DataFrame:
    """One of the five tables: one row per type and statistic.

    Columns: ``typecode statistic unit``, each model's score, ``<model>_equal_size _low _high``, the ``floor``,
    ``nominal`` BADA's error of the mean, ``best`` (names of the models within 5 %), and, where published figures are
    given,
    ``paper_<model>``: from other data, to be compared in order of magnitude only.

    Args:
        scores: From :func:`all_scores`.
        quantity: One of :data:`QUANTITIES`.
        published: Columns ``quantity typecode statistic gaussian gmm flow bada``.

    Example:
        >>> about = {"typecode": "A320", "quantity": "time_to_bottom_of_descent", "statistic": "ks", "unit": "1"}
        >>> about |= {"equal_size": 0.2, "floor": 0.1, "nominal": None, "low": 0.1, "high": 0.3}
        >>> scores = pl.DataFrame([about | {"model": m, "score": s} for m, s in (("gaussian", 0.2), ("gmm", 0.12))])
        >>> table(scores, "time_to_bottom_of_descent").select("gaussian", "gmm", "best").row(0)
        (0.2, 0.12, 'gmm')
    """
    chosen = with_best(scores).filter(pl.col("quantity") == quantity)
    keys = ["typecode", "statistic", "unit"]
    wide = chosen.pivot(on="model", index=keys, values=list(_BY_MODEL), separator="|")
    models = chosen["model"].unique(maintain_order=True).to_list()
    if len(models) == 1:
        wide = wide.rename({c: f"{c}|{models[0]}" for c in _BY_MODEL if c in wide.columns})
    wide = wide.rename({f"{c}|{m}": f"{m}{ending}" for c, ending in _BY_MODEL.items() for m in models})
    shared = chosen.group_by(keys, maintain_order=True).agg(
        pl.col("floor").mean(), pl.col("nominal").first(), best=pl.col("model").filter("best").str.join(" ")
    )
    joined = wide.join(shared, on=keys, how="left")
    if published is not None:
        theirs = published.filter(pl.col("quantity") == quantity).select(
            "typecode",
            "statistic",
            *(pl.col(m).alias(f"paper_{m}") for m in (*MODELS, "bada") if m in published.columns),
        )
        joined = joined.join(theirs, on=["typecode", "statistic"], how="left")
    return joined


def means(scores: pl.DataFrame) -> pl.DataFrame:
    """Means over types: one row per quantity, statistic and model, with the floor and the number of types behind it.

    Args:
        scores: From :func:`all_scores`.

    Returns:
        Columns ``quantity statistic unit model types score equal_size floor over_floor nominal``.

    Example:
        >>> about = {"typecode": "A320", "quantity": "time_to_bottom_of_descent", "statistic": "ks", "unit": "1"}
        >>> about |= {"equal_size": 0.2, "floor": 0.1, "nominal": None, "low": 0.1, "high": 0.3}
        >>> scores = pl.DataFrame([about | {"model": m, "score": s} for m, s in (("gaussian", 0.2), ("gmm", 0.12))])
        >>> means(scores).select("model", "types", "over_floor").rows()
        [('gaussian', 1, 2.0), ('gmm', 1, 2.0)]
    """
    by_quantity = scores.group_by("quantity", "statistic", "unit", "model", maintain_order=True).agg(
        types=pl.col("score").is_not_null().sum(),
        score=pl.col("score").mean(),
        equal_size=pl.col("equal_size").mean(),
        floor=pl.col("floor").mean(),
        over_floor=(pl.col("equal_size") / pl.col("floor")).median(),
        nominal=pl.col("nominal").mean(),
    )
    order = {name: i for i, name in enumerate([*QUANTITIES, *PAPER_STATISTICS])}
    places = [pl.col(c).replace_strict(order, return_dtype=pl.Int64) for c in ("quantity", "statistic")]
    return by_quantity.sort(*places, maintain_order=True)
