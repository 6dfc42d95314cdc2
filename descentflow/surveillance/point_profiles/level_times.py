"""From points to seconds between flight levels of free descents."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import polars as pl

from descentflow.surveillance.cleaning.thresholds import Cleaning

LEG_FL = 50
"""Height of a leg, in flight levels: five times the usual distance between points in level, so that their whole seconds
and levels are small beside it; four legs cover FL150 to FL350."""


@dataclass(frozen=True)
class Legs:
    """Seconds that flights take from one level down to another.

    Attributes:
        edges_fl: (K + 1,) levels that bound the legs, from low to high.
        seconds: (n, K), NaN where a flight was not seen to descend freely over the leg.
        names: Of the flights.

    Example:
        >>> legs = Legs((150, 200, 250), np.array([[150.0, np.nan]]), ("a",))
        >>> legs.mask.tolist(), legs.labels
        ([[True, False]], ['FL200 to FL150', 'FL250 to FL200'])
    """

    edges_fl: tuple[int, ...]
    seconds: np.ndarray
    names: tuple[str, ...] = ()

    @property
    def mask(self) -> np.ndarray:
        """(n, K) legs that were seen."""
        return np.asarray(np.isfinite(self.seconds))

    @property
    def labels(self) -> list[str]:
        """What each leg is called."""
        return [f"FL{high} to FL{low}" for low, high in pairwise(self.edges_fl)]


def edges_between(low_fl: float, high_fl: float) -> tuple[int, ...]:
    """Levels that bound legs of :data:`LEG_FL` from the lowest level up.

    Example:
        >>> edges_between(150, 362)
        (150, 200, 250, 300, 350)
    """
    return tuple(range(int(low_fl), int(high_fl) + 1, LEG_FL))


def legs_of_points(points: pl.DataFrame, edges_fl: tuple[int, ...], rules: Cleaning | None = None) -> Legs:
    """Seconds over each leg, of flights that descend over all of it without a level stretch.

    Between two points a flight is taken to descend at a constant rate. That is not said of a pair that is further
    apart than ``highest_gap_ft``: the end of a leg may not lie inside such a pair, though a leg may hold it whole. A
    pair whose mean rate is below ``slowest_fpm`` is no free descent, and a leg that touches it is not measured.

    Args:
        points: Columns ``flight_id segment timestamp level_fl``, in order.
        edges_fl: Levels that bound the legs, from low to high.
        rules: Thresholds; the defaults if absent.

    Example:
        >>> from datetime import datetime, timedelta
        >>> times = [datetime(2024, 3, 1, 12) + timedelta(seconds=s) for s in (0, 60, 120, 180)]
        >>> levels = {"level_fl": [260, 240, 210, 190]}
        >>> points = pl.DataFrame({"flight_id": "a", "segment": 1, "timestamp": times, **levels})
        >>> legs_of_points(points, (200, 250)).seconds
        array([[120.]])
    """
    rules = rules or Cleaning()
    names = points["flight_id"].unique(maintain_order=True).to_list()
    seconds = np.full((len(names), len(edges_fl) - 1), np.nan)
    row = {name: k for k, name in enumerate(names)}
    for (name, _), own in points.group_by("flight_id", "segment", maintain_order=True):
        at = own["timestamp"].dt.epoch("us").to_numpy() / 1e6
        for part in _descents(at, own["level_fl"].to_numpy().astype(float), rules.slowest_fpm):
            crossed = _crossings(*part, edges_fl, rules.highest_gap_ft / 100)
            leg = crossed[:-1] - crossed[1:]
            seconds[row[str(name)]] = np.where(np.isfinite(leg), leg, seconds[row[str(name)]])
    some = np.isfinite(seconds).any(1)
    return Legs(edges_fl, seconds[some], tuple(n for n, kept in zip(names, some, strict=True) if kept))


def _descents(at: np.ndarray, level: np.ndarray, slowest_fpm: float) -> list[tuple[np.ndarray, np.ndarray]]:
    """Runs of points between which the flight descends at the slowest rate at least."""
    step_s, step_fl = np.diff(at), -np.diff(level)
    falls = (step_s > 0) & (step_fl > 0) & (step_fl * 6000 >= slowest_fpm * step_s)
    bounds = np.flatnonzero(np.diff(np.concatenate([[False], falls, [False]]).astype(int)))
    return [(at[a : b + 1], level[a : b + 1]) for a, b in zip(bounds[::2], bounds[1::2], strict=True)]


def _crossings(at: np.ndarray, level: np.ndarray, edges_fl: tuple[int, ...], highest_fl: float) -> np.ndarray:
    """Seconds at which each level is passed; NaN beyond the run, or inside a pair of points too far apart."""
    edges = np.array(edges_fl, dtype=float)
    crossed = np.interp(-edges, -level, at, left=np.nan, right=np.nan)
    after = np.clip(np.searchsorted(-level, -edges), 1, len(level) - 1)
    tall = level[after - 1] - level[after] > highest_fl
    return np.where(tall & ~np.isin(edges, level), np.nan, crossed)


def legs_of_levels(frame: pl.DataFrame, edges_fl: tuple[int, ...]) -> Legs:
    """Seconds over each leg of prepared descents or of samples, of flights that have every level of the leg.

    Args:
        frame: Columns ``flight_id level_fl time_s``.
        edges_fl: Levels that bound the legs, from low to high.

    Example:
        >>> legs = legs_of_levels(pl.read_parquet("descents.parquet"), (200, 250, 300))
        >>> legs.seconds.shape[1], bool((legs.seconds[legs.mask] > 60).all())
        (2, True)
    """
    columns = []
    for low, high in pairwise(edges_fl):
        inside = frame.filter(pl.col("level_fl").is_between(low, high))
        leg = inside.group_by("flight_id").agg(levels=pl.len(), seconds=pl.col("time_s").max() - pl.col("time_s").min())
        columns.append(leg.filter(levels=high - low + 1).select("flight_id", pl.col("seconds").alias(str(low))))
    names = frame.select(pl.col("flight_id").unique().sort())
    for column in columns:
        names = names.join(column, on="flight_id", how="left", maintain_order="left")
    seconds = names.drop("flight_id").cast(pl.Float64).fill_null(np.nan).to_numpy()
    some = np.isfinite(seconds).any(1)
    kept = tuple(name for name, is_there in zip(names["flight_id"].to_list(), some.tolist(), strict=True) if is_there)
    return Legs(edges_fl, seconds[some], kept)
