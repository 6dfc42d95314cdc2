"""An air by flight level from a table: its columns and levels are checked before a model's grid takes it."""

import warnings

import numpy as np
import polars as pl
import torch
from torch import Tensor

from descentflow.air.level_air import LevelAir
from descentflow.core.errors import ConfigError, DataError, DescentflowWarning, nearest
from descentflow.core.units import KT_MPS

LEVEL = "level_fl"
COLUMNS = ("deviation_k", "tailwind")
"""What a table has beside ``level_fl``: kelvins, and knots from behind; the second may be absent."""
HIGHEST_FL = 1000.0
"""Beyond 100,000 ft nothing of air traffic flies: such levels are feet or metres."""
BEYOND_FL = 10.0
"""Levels beyond the table's ends that need no word: a day's air seldom changes by a kelvin in 1,000 ft."""


def air_of_table(table: pl.DataFrame, levels_fl: Tensor) -> LevelAir:
    """The air of a table on a model's grid: linear between its levels and held outside of them.

    Args:
        table: ``level_fl``, ``deviation_k`` (K) and, if there is wind, ``tailwind`` (kt).
        levels_fl: (L,) ascending levels of the model's grid.

    Raises:
        ConfigError: If its levels are no flight levels, or none of the model's lies between them.
        DataError: If it lacks a column, or has one that is not known, another type, no row, or a level twice.

    Warns:
        DescentflowWarning: If levels of the model lie far beyond its ends.

    Example:
        >>> table = pl.DataFrame({"level_fl": [100, 350], "deviation_k": [10.0, 20.0]})
        >>> air_of_table(table, torch.tensor([150.0, 200.0])).deviation_k
        tensor([[12., 14.]], dtype=torch.float64)
    """
    kept = _checked_columns(table)
    _check_levels(kept[LEVEL], float(levels_fl[0]), float(levels_fl[-1]))
    at = levels_fl.numpy()
    parts = [np.interp(at, kept[LEVEL], kept[name]) if name in kept.columns else np.zeros(len(at)) for name in COLUMNS]
    deviation, tailwind = (torch.from_numpy(part)[None] for part in parts)
    return LevelAir(deviation, tailwind * KT_MPS)


def _checked_columns(table: pl.DataFrame) -> pl.DataFrame:
    """The table as numbers, by ascending level."""
    known = (LEVEL, *COLUMNS)
    unknown = [name for name in table.columns if name not in known]
    lacking = not {LEVEL, "deviation_k"} <= set(table.columns) or table.is_empty()
    if unknown or lacking or not all(kind.is_numeric() for kind in table.dtypes):
        meant = {name: nearest(name.lower(), known) for name in unknown}
        renamed = [f"{name} {near}" for name, near in meant.items() if near and near not in table.columns]
        raise DataError(
            f"a table of air with {', '.join(table.columns)} and {len(table)} rows"
            + (f", of which {', '.join(unknown)} is not known" if unknown else ""),
            expected="for each level numbers: level_fl, deviation_k (K) and, if there is wind, tailwind (kt)",
            mend=f"call {' and '.join(renamed)}"
            if renamed
            else ("leave other columns out" if not lacking else "add the columns"),
        )
    kept = table.with_columns(pl.all().cast(pl.Float64)).sort(LEVEL)
    if kept[LEVEL].n_unique() < len(kept):
        raise DataError("a table of air with a level twice", expected="one row for each level", mend="keep one of each")
    return kept


def _check_levels(levels: pl.Series, low_fl: float, high_fl: float) -> None:
    """Refuse a table of other levels than the model's, and tell where one covers a part."""
    lowest, highest = float(levels.min()), float(levels.max())  # type: ignore[arg-type]
    if not 0 <= lowest <= highest <= HIGHEST_FL or lowest > high_fl or highest < low_fl:
        raise ConfigError(
            f"a table of air whose level_fl goes from {lowest:g} to {highest:g}",
            expected=f"flight levels (hundreds of feet) that hold some of the model's, FL{low_fl:g} to FL{high_fl:g}",
            mend="divide feet by 100" if highest > HIGHEST_FL else "give levels of the model's grid",
        )
    if lowest > low_fl + BEYOND_FL or highest < high_fl - BEYOND_FL:
        warnings.warn(
            f"the table of air goes from FL{lowest:g} to FL{highest:g}, the model from FL{low_fl:g} to FL{high_fl:g}: "
            "beyond the table's ends its first and last values are taken; add levels if the air is known there",
            DescentflowWarning,
            stacklevel=2,
        )
