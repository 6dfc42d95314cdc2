"""The air that samples are flown in: one for all, by level from a table, or the training flights' own."""

import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import torch
from torch import Tensor

from descentflow.air.kept_air import WARMEST_K
from descentflow.air.level_air import LevelAir
from descentflow.core.errors import ConfigError, DataError, DescentflowWarning
from descentflow.core.units import KT_MPS
from descentflow.generation._given_temperature import NAME, gives_temperature
from descentflow.representation.representation import Representation
from descentflow.weather.weather_layout import STRONGEST_MPS, names_weather

Airs = str | Path | Mapping[str, Any] | pl.DataFrame | LevelAir
"""``standard``, ``training``, values by name, a table (in memory or as a path), or a weather field's path."""
STANDARD, TRAINING = "standard", "training"
GROWTH = "tailwind_growth"
NAMES = ("deviation_k", GROWTH)
"""Values that hold for all levels: kelvins, and knots of tailwind more for each 1,000 ft."""
TABLES = (".csv", ".parquet")
LEVEL = "level_fl"
COLUMNS = ("deviation_k", "tailwind")
"""Columns of a table, with ``level_fl``: kelvins, and knots from behind; the second may be absent."""
HIGHEST_FL = 1000.0
"""Beyond 100,000 ft nothing of air traffic flies: such levels are feet or metres."""
BEYOND_FL = 10.0
"""Levels beyond the table's ends that need no word: a day's air seldom changes by a kelvin in 1,000 ft."""


def airs_of(asked: Airs | None, representation: Representation) -> LevelAir | None:
    """Airs (m, L) to fly in on a model's grid; None for standard air, and for a weather field, met along a path.

    Args:
        asked: ``standard``; ``training``: drawn from the training flights' own, for a model of drag in measured air;
            ``{"deviation_k": 10, "tailwind_growth": 1.5}``; or a table with ``level_fl``, ``deviation_k`` and
            ``tailwind`` (kt), see :func:`.air_of_table`. If absent, ``training`` where the
            model knows the training flights' airs, else ``standard``.
        representation: The model's.

    Raises:
        ConfigError: If there is no such air, a value cannot be, or it and the context both have a temperature.
        DataError: If the table cannot be read, lacks a column, or has one that is not known.

    Warns:
        DescentflowWarning: If airs are drawn from the training flights' own, with other temperatures than the context.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> known = load_model("best.ckpt").representation
        >>> airs_of(None, known) is None  # its drag was inferred in standard air
        True
        >>> airs_of({"deviation_k": 10}, known).deviation_k[0, :2]
        tensor([10., 10.], dtype=torch.float64)
        >>> table = pl.DataFrame({"level_fl": [100, 350], "deviation_k": [10.0, 20.0]})
        >>> bool(airs_of(table, known).deviation_k[0, 0] == 12.0)  # at FL150
        True
    """
    airs = None if names_weather(asked) else _airs(asked, representation)
    _check_one_temperature(representation, asked, airs)
    return airs


def _airs(asked: Airs | None, representation: Representation) -> LevelAir | None:
    levels_fl, kept = representation.decoder.levels_fl.cpu(), representation.air
    if asked is None:
        asked = STANDARD if kept is None else TRAINING
    if isinstance(asked, LevelAir):
        return _checked(asked, len(levels_fl))
    if isinstance(asked, Mapping):
        return _of_values(asked, levels_fl)
    if isinstance(asked, pl.DataFrame) or (isinstance(asked, str | Path) and Path(asked).suffix in TABLES):
        if not isinstance(asked, pl.DataFrame):
            from descentflow.representation.context_columns import read_table

            asked = read_table(Path(asked))
        return _checked(air_of_table(asked, levels_fl), len(levels_fl))
    if asked == STANDARD:
        return None
    if asked == TRAINING:
        if kept is None:
            raise ConfigError(
                "the training flights' own airs, of a model that does not know them",
                expected="a model that was fitted with data.air=measured or a weather field",
                mend="fit such a model, or give an air: deviation_k=10",
            )
        return kept.training
    raise ConfigError(
        f"the air {str(asked)!r}",
        expected=f"{STANDARD}, {TRAINING}, {' or '.join(f'{n}=VALUE' for n in NAMES)}, a .csv or .parquet table, or a "
        "weather field (.nc, .grib)",
        mend="write for instance deviation_k=10",
    )


def _check_one_temperature(representation: Representation, asked: "Airs | None", air: LevelAir | None) -> None:
    """Refuse a second temperature, for the rate would have both; warn where the context's is not flown."""
    warm = names_weather(asked) or (air is not None and bool(air.deviation_k.any()))
    if gives_temperature(representation) and warm:
        raise ConfigError(
            f"a temperature of the air next to the context's {NAME}",
            expected=f"one of them: the model has learnt what {NAME} does to the rate, and TAS is that of the context",
            mend="leave the temperature out of the air (a tailwind may stay), or take a model without this context",
        )
    drawn = representation.air is not None and (asked is None or asked == "training")
    if drawn and NAME in representation.context.names:
        warnings.warn(
            f"samples are flown in airs drawn from the training flights' own, whatever the context's {NAME} is; to fly "
            f"them in that of the context, give the air too: {NAME}=VALUE, or a table by level",
            DescentflowWarning,
            stacklevel=4,
        )


def _of_values(values: Mapping[str, Any], levels_fl: Tensor) -> LevelAir:
    try:
        numbers = {name: float(value) for name, value in values.items()}
    except (TypeError, ValueError):
        numbers = {}
    if not numbers or not set(numbers) <= set(NAMES):
        raise ConfigError(
            f"an air with {', '.join(f'{name}={value}' for name, value in values.items()) or 'no value'}",
            expected="deviation_k (K from the standard atmosphere) and tailwind_growth (kt for each 1,000 ft)",
            mend="write for instance deviation_k=10 tailwind_growth=1.5",
        )
    air = LevelAir.uniform(levels_fl, numbers.get("deviation_k", 0.0))
    # No wind at the lowest level: what it is there does not change how a descent is flown.
    growth = numbers.get(GROWTH, 0.0) * KT_MPS * (levels_fl - levels_fl[0]).double() / 10
    return _checked(LevelAir(air.deviation_k, growth[None]), len(levels_fl))


def _checked(air: LevelAir, n_levels: int) -> LevelAir:
    """Refuse what no air on earth is."""
    warmest, strongest = float(air.deviation_k.abs().max()), float(air.tailwind_mps.abs().max())
    shapes = air.deviation_k.shape[1:], air.tailwind_mps.shape[1:]
    if shapes != ((n_levels,), (n_levels,)) or not (warmest <= WARMEST_K and strongest <= STRONGEST_MPS):
        raise ConfigError(
            f"an air of up to {warmest:g} K from the standard atmosphere and {strongest / KT_MPS:.0f} kt, on "
            f"{shapes[0][0]} levels",
            expected=f"up to {WARMEST_K:g} K and {STRONGEST_MPS / KT_MPS:.0f} kt, on the model's {n_levels} levels",
            mend="check the units",
        )
    return air


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
    unlike = {LEVEL, *COLUMNS} ^ set(table.columns)
    if not unlike <= {"tailwind"} or table.is_empty() or not all(kind.is_numeric() for kind in table.dtypes):
        raise DataError(
            f"a table of air with {', '.join(table.columns)} and {len(table)} rows",
            expected="for each level numbers: level_fl, deviation_k (K) and, if there is wind, tailwind (kt)",
            mend="call columns so, and leave others out",
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
