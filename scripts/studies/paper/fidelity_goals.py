"""Judge a study of all types: a few numbers of each type, next to the bounds that they should keep."""

import json
from dataclasses import dataclass, replace
from math import inf
from pathlib import Path

import polars as pl

from studies.paper.fidelity_tables import LARGE, ratios
from studies.paper.study_plan import StudyPlan
from studies.paper.study_tables import all_scores

ENOUGH = 400
"""Flights at a level from which on its share of 90 % intervals that hold is looked at by itself."""


@dataclass(frozen=True)
class Goal:
    """A number of each type, and between which ends it should lie.

    Attributes:
        name: Column of :func:`of_types`.
        median: Ends for the median over types.
        worst: Ends for every type of a thousand flights and more.
        control: Column of the same number with training flights in place of samples; empty if it is not measured.

    Example:
        >>> goal = Goal("auc", (0.0, 0.6), (0.0, 0.6))
        >>> goal.worst_of([0.55, 0.7, 0.58])
        0.7
    """

    name: str
    median: tuple[float, float]
    worst: tuple[float, float]
    control: str = ""

    def worst_of(self, values: list[float]) -> float:
        """The value that lies furthest outside the ends, or, if none does, nearest to one of them."""
        low, high = self.worst
        return max(values, key=lambda value: max(low - value, value - high))


_LEVELS = ("cas_above_transition", "cas_below_transition", "rocd_above_transition", "rocd_below_transition")
GOALS = (
    *(Goal(f"time_to_bottom_of_descent/{kind}", (0.0, 1.1), (0.0, 1.25)) for kind in ("ks", "wasserstein")),
    *(Goal(f"time_shown/{kind}", (0.0, 1.1), (0.0, 1.25)) for kind in ("ks", "wasserstein")),
    *(Goal(f"{level}/{kind}", (0.0, 1.15), (0.0, 1.3)) for level in _LEVELS for kind in ("ks", "wasserstein")),
    Goal("top_spread_rate", (0.97, 1.03), (0.97, 1.03), control="top_spread_rate_of_training"),
    Goal("auc", (0.0, 0.6), (0.0, 0.6)),
    Goal("covered", (0.88, 0.92), (0.88, 0.92)),
    Goal("covered_worst_level", (0.88, 0.92), (0.88, 0.92)),
    Goal("kept", (0.9, inf), (0.9, inf)),
)
"""Distances over their floor (times of flights without gaps, and of all flights on the levels that they show), spread
at the top, AUC of 200 a side, intervals in flight, share of draws kept."""


def of_types(plan: StudyPlan, name: str, folder: Path) -> pl.DataFrame:
    """Every number that is judged, of one model of every type: a row for each type, null where a type has none.

    Args:
        plan: The study.
        name: One of its models, measured by :func:`measure`.
        folder: The study's folder.

    Example:
        >>> of_types(StudyPlan({"A320": 120}, models=("gmm",)), "gmm", Path("no_study"))
        Traceback (most recent call last):
            ...
        FileNotFoundError: ...no_study/A320/gmm/scores.csv...
    """
    table = ratios(all_scores(replace(plan, models=(name,)), folder))
    rows = []
    for row in table.iter_rows(named=True):
        place = folder / row["typecode"] / name
        scores = pl.read_csv(place / "scores.csv", infer_schema_length=None)
        auc = scores.filter(pl.col("statistic") == "auc")["equal_size"].cast(pl.Float64)
        own = {key: value for key, value in row.items() if "/" in key and not key.endswith("excess")}
        measures = json.loads((place / "fidelity.json").read_text())
        known = {"typecode": row["typecode"], "flights": plan.flights[row["typecode"]]}
        rows.append({**known, **own, "auc": auc.item() if len(auc) else None, **measures, **_covered(place)})
    return pl.DataFrame(rows, infer_schema_length=None)


def _covered(place: Path) -> dict[str, float | None]:
    """Share of all times inside their intervals, and of the level where it is furthest from 0.9."""
    table = pl.read_csv(place / "in_flight.csv")
    shares = table.filter(pl.col("flights") >= ENOUGH)["covered"].to_list()
    worst = max(shares, key=lambda share: abs(share - 0.9), default=None)
    inside = table.select((pl.col("flights") * pl.col("covered")).sum() / pl.col("flights").sum()).item()
    return {"covered": inside, "covered_worst_level": worst}


def judged(types: pl.DataFrame) -> pl.DataFrame:
    """Each goal with what was reached: ``goal median wanted worst_large wanted_large met control control_large``.

    The last two are of training flights in place of samples: the median, and the number of the type that is the worst.

    Args:
        types: From :func:`of_types`.

    Example:
        >>> types = pl.DataFrame({"typecode": ["A320", "BE20"], "flights": [28_723, 257], "auc": [0.55, 0.7]})
        >>> judged(types).select("goal", "worst_large", "met").row(0)
        ('auc', 0.55, False)
    """
    rows = []
    for goal in GOALS:
        if goal.name not in types.columns:
            continue
        control = pl.col(goal.control) if goal.control in types.columns else pl.lit(None, pl.Float64)
        columns = (
            pl.col("flights"),
            pl.col(goal.name).cast(pl.Float64).fill_nan(None).alias("told"),
            control.alias("by"),
        )
        known = types.select(columns).drop_nulls("told")
        if known.is_empty():
            continue
        rows.append((goal.name, *_reached(goal, known)))
    numbers = {"median": pl.Float64, "wanted": pl.String, "worst_large": pl.Float64, "wanted_large": pl.String}
    schema = {"goal": pl.String, **numbers, "met": pl.Boolean, "control": pl.Float64, "control_large": pl.Float64}
    return pl.DataFrame(rows, schema=schema, orient="row")


def _reached(goal: Goal, known: pl.DataFrame) -> tuple[float | str | bool | None, ...]:
    """A goal's row but for its name, of the types (``flights told by``) that have the number."""
    large = known.filter(pl.col("flights") >= LARGE)
    values, middle = large["told"].to_list(), float(known["told"].median())  # type: ignore[arg-type]
    worst = goal.worst_of(values) if values else None
    met = goal.median[0] <= middle <= goal.median[1]
    met &= worst is None or goal.worst[0] <= worst <= goal.worst[1]
    by_worst = None if worst is None else large["by"][values.index(worst)]
    return middle, _told(goal.median), worst, _told(goal.worst), met, known["by"].median(), by_worst  # type: ignore[return-value]


def _told(ends: tuple[float, float]) -> str:
    low, high = ends
    return f"at least {low:g}" if high == inf else f"{low:g} to {high:g}"
