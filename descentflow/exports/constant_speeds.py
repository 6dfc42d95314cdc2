"""Where a descent's Mach number hands over to CAS, and what each of the two parts is like."""

import numpy as np
import polars as pl
from numpy.typing import NDArray

Array = NDArray[np.float64]
MACH_UNIT, CAS_UNIT_KT = 0.005, 4.0
"""Departures from constant Mach and from constant CAS that weigh alike: 0.005 is some 2 kt of CAS at FL300, and CAS is
held twice as loosely."""
FEWEST_LEVELS = 10
"""Levels that a part needs to be told."""


def constant_speeds(table: pl.DataFrame) -> pl.DataFrame:
    """Split each sample at the level that leaves Mach above and CAS below it the least variation.

    Args:
        table: Samples, as :meth:`descentflow.generation.samples.Samples.to_polars` has them.

    Returns:
        A row for each sample: ``sample_id``; ``crossover_fl mach`` (null where fewer than ten levels are flown at
        constant Mach); ``cas_kt`` (null where fewer are at constant CAS). Speeds are means over levels.

    Example:
        >>> from descentflow.generation.sample import sample
        >>> parts = constant_speeds(sample("best.ckpt", 50, entry_fl=340).to_polars())
        >>> bool(parts["cas_kt"].is_between(230, 340).all())
        True
    """
    rows = []
    for one in table.partition_by("sample_id", maintain_order=True):
        mach, cas, level = (one[name].to_numpy() for name in ("Mach", "CAS", "level_fl"))
        split = _split(mach, cas)
        row = {"sample_id": one["sample_id"][0]}
        if split >= FEWEST_LEVELS:
            row |= {"crossover_fl": float(level[split - 1]), "mach": float(mach[:split].mean())}
        if len(level) - split >= FEWEST_LEVELS:
            row["cas_kt"] = float(cas[split:].mean())
        rows.append(row)
    return pl.DataFrame(
        rows, schema={"sample_id": pl.Int32, "crossover_fl": pl.Float64, "mach": pl.Float64, "cas_kt": pl.Float64}
    )


def _split(mach: Array, cas: Array) -> int:
    """How many levels from the top are flown at constant Mach."""
    above = _variation(mach / MACH_UNIT)
    below = _variation(cas[::-1] / CAS_UNIT_KT)[::-1]
    return int(np.argmin(above + below))


def _variation(values: Array) -> Array:
    """Sum of squares about the mean of the first k values, for k = 0 to all."""
    count = np.arange(1, len(values) + 1)
    centred = values - values[0]
    return np.concatenate([[0.0], np.cumsum(centred**2) - np.cumsum(centred) ** 2 / count])
