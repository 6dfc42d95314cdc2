"""DoWhy: which mechanism of a causal graph changed (`gcm.distribution_change`), set up as in its user guide.

Mechanisms are assigned by `gcm.auto`, the tests of mechanisms and their false discovery control are its defaults, and
every attribution is repeated on parts of the flights for its interval (`gcm.confidence_intervals`), as the guide
advises. A node is named if the test calls its mechanism changed and the interval of its share excludes zero, strongest
first; those of the reported rate, which has most of the graph above it, before the nodes that stand alone, whose shares
are of other targets.
"""

import contextlib
import io
import logging
from typing import Any

import numpy as np
import polars as pl

from benchmarks.rivals_mapping import EFFECTS_OF_NODE, TARGETS, graph
from benchmarks.rivals_scoring import Answer
from benchmarks.rivals_sets import RivalSet

BOOTSTRAPS = 10
PART = 0.6
"""Repetitions for an interval, and the share of the flights in each, as in the guide's example of services."""
LEVEL_FT = 100.0
LONGEST_STEP_S = 12.0
"""A level that took longer at a flight's own rate by this was no descent: a level-off."""


def answer(one: RivalSet, seed: int) -> Answer:
    """Answer of DoWhy."""
    import networkx as nx
    import pandas as pd
    from dowhy import gcm

    logging.getLogger("dowhy").setLevel(logging.ERROR)
    np.random.seed(seed)  # noqa: NPY002 - DoWhy draws from it
    old, new = (pd.DataFrame(flight_table(frame).to_dict(as_series=False)) for frame in (one.simulator, one.real))
    nodes = [c for c in old.columns if c in new.columns]
    old, new = old[nodes].dropna(), new[nodes].dropna()
    model = gcm.ProbabilisticCausalModel(nx.DiGraph(graph(set(nodes))))
    model.graph.add_nodes_from(nodes)
    found: list[str] = []
    with contextlib.redirect_stderr(io.StringIO()), contextlib.redirect_stdout(io.StringIO()):
        gcm.config.disable_progress_bars()
        gcm.config.set_default_n_jobs(1)
        gcm.auto.assign_causal_mechanisms(model, old)
        for target in [name for name in TARGETS if name in nodes]:
            share = _changed(gcm, model, old, new, target)
            found += sorted(share, key=lambda node: -share[node])
    return Answer(tuple(EFFECTS_OF_NODE[node] for node in found), gap=bool(found))


def _changed(gcm: Any, model: Any, old: Any, new: Any, target: str) -> dict[str, float]:
    """Nodes whose mechanism changed -> size of their share of the target's change (nats)."""

    def divergence(first: Any, second: Any) -> float:
        # Its own default. That returns a whole number where samples coincide, to which the sum of shares cannot add.
        return float(gcm.divergence.auto_estimate_kl_divergence(first, second))

    def change(before: Any, after: Any, **more: Any) -> Any:
        return gcm.distribution_change(model, before, after, target, difference_estimation_func=divergence, **more)

    def once() -> dict[str, float]:
        return dict(change(old.sample(frac=PART), new.sample(frac=PART)))

    _, tests, *_ = change(old, new, return_additional_info=True)
    if not any(tests.values()):
        return {}
    middle, interval = gcm.confidence_intervals(once, num_bootstrap_resamples=BOOTSTRAPS, n_jobs=1)
    sure = {node for node, (low, high) in interval.items() if low > 0 or high < 0}
    return {node: abs(float(middle[node])) for node in sure if tests[node]}


def flight_table(frame: pl.DataFrame) -> pl.DataFrame:
    """One row a flight: means of speeds and rates, the wind's gradient, short-scale noise, and time lost."""
    by_flight = frame.sort("flight_id", "level_fl", descending=[False, True])
    # A column, for the lowest version of Polars knows no window within another.
    by_flight = by_flight.with_columns(step_s=pl.col("time_s").diff().over("flight_id"))
    step = pl.col("step_s")
    passed = -pl.col("level_fl").diff().over("flight_id")
    near = passed == 1
    rate = LEVEL_FT / step * 60.0
    usual = step.median().over("flight_id")
    rows = by_flight.with_columns(
        pl.when(near & (step > 0) & (step - usual < LONGEST_STEP_S)).then(rate).alias("rate_fpm"),
        pl.when(step - usual * passed >= LONGEST_STEP_S).then(step - usual * passed).otherwise(0.0).alias("lost_s"),
        pl.when(near).then(pl.col("vertical_rate").diff().over("flight_id")).alias("jump_fpm"),
    )
    cells = [
        pl.col("IAS").mean(),
        pl.col("rate_fpm").mean().alias("rate"),
        (-pl.col("vertical_rate")).mean().alias("reported"),
        pl.col("jump_fpm").std().log().alias("noise"),
        pl.col("lost_s").sum().alias("stops"),
    ]
    cells += [pl.col(name).mean() for name in ("Mach", "TAS") if name in frame.columns]
    if {"TAS", "groundspeed"} <= set(frame.columns):
        cells.append(_slope(pl.col("groundspeed") - pl.col("TAS")).alias("wind"))
    if "geoaltitude" in frame.columns:
        cells.append(_slope(pl.col("geoaltitude") - pl.col("level_fl") * LEVEL_FT).alias("height"))
    table = rows.group_by("flight_id", maintain_order=True).agg(cells).drop("flight_id")
    return table.select([c for c in table.columns if table[c].drop_nulls().len() > len(table) / 2])


def _slope(values: pl.Expr) -> pl.Expr:
    """Slope of a regression on altitude, per 1,000 ft."""
    return pl.cov(values, pl.col("level_fl")) / pl.col("level_fl").var() * 10.0
