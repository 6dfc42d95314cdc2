"""Tables of bluebird-dt: descents of samples, or of a nominal fleet, in its form."""

from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.stats import truncnorm

from descentflow.core.errors import DataError

Array = NDArray[np.float64]
KINDS = ("profile", "uncertainty", "mapping")
STEP_FL = 10
WIDEST_SD = 2.5
"""Truncation of an offset, in its standard deviations."""
SLOWEST_FPM = 500.0
"""bluebird's least rate."""
RANKS = (np.arange(400) + 0.5) / 400
FEWEST = 30
MACH_UNIT, CAS_UNIT_KT = 0.005, 4.0
"""Departures from constant Mach and from constant CAS that weigh alike: 0.005 is some 2 kt of CAS at FL300, and CAS is
held twice as loosely."""
FEWEST_LEVELS = 10
"""Smallest number of levels of a part."""


def tables(samples: pl.DataFrame) -> tuple[dict[str, Any], dict[str, Any]]:
    """Profile and uncertainty of a type.

    bluebird flies rate ``r(h) + d``, with one offset ``d`` of a truncated normal for each flight. ``r(h)`` is the
    harmonic mean rate by level times a factor, and factor and spread are those at which mean and spread of the time
    from the median entry level to the lowest are the samples'. Where none has a part at constant Mach number (CAS),
    that of the highest (lowest) level holds.

    Args:
        samples: Table of samples.

    Raises:
        DataError: If fewer than 30 samples enter at the median entry level or above.

    Example:
        >>> from descentflow.generation.sample import sample
        >>> profile, spread = tables(sample("best.ckpt", 300).to_polars())
        >>> sorted(profile)
        ['cas_cr', 'cas_des', 'flight_level', 'mach_cr', 'mach_des', 'rocd_des']
    """
    levels, slowness, seconds = _times(samples)
    rates, sigma = _rates(levels, slowness, seconds)
    cas, mach, phases = _speeds(samples, levels)
    profile: dict[str, Any] = {"flight_level": levels.tolist(), "rocd_des": rates.round(1).tolist()}
    for phase in ("cr", "des"):
        profile |= {f"cas_{phase}": cas.round(2).tolist(), f"mach_{phase}": mach.round(4).tolist()}
    spread = {"rocd_des": _offset(float(rates.mean()), sigma)}
    for phase in ("cr", "des"):
        for name, column in (("cas", "cas_kt"), ("mach", "mach")):
            values = phases[column].drop_nulls()
            spread[f"{name}_{phase}"] = _offset(float(values.mean()), float(values.std()))  # type: ignore[arg-type]
    return profile, spread


def _times(samples: pl.DataFrame) -> tuple[Array, Array, Array]:
    """Levels, mean slowness (min/ft) at them, and the seconds of every sample from the median entry to the lowest."""
    top = int(samples.group_by("sample_id").agg(pl.col("level_fl").max())["level_fl"].median())  # type: ignore[arg-type]
    bottom = int(samples["level_fl"].min())  # type: ignore[arg-type]
    reaching = samples.filter(pl.col("level_fl").max().over("sample_id") >= top)
    ends = reaching.group_by("sample_id").agg(
        seconds=pl.col("time_s").max() - pl.col("time_s").filter(pl.col("level_fl") == top).first()
    )
    if len(ends) < FEWEST:
        raise DataError(f"{len(ends)} samples from FL{top}", expected=f"at least {FEWEST}", mend="draw more samples")
    levels = np.append(np.arange(bottom, top, STEP_FL), top).astype(float)
    by_level = reaching.group_by("level_fl").agg(slow=(-1 / pl.col("vertical_rate")).mean()).sort("level_fl")
    slowness = np.interp(levels, by_level["level_fl"].to_numpy(), by_level["slow"].to_numpy())
    return levels, slowness, ends["seconds"].to_numpy()


def _rates(levels: Array, slowness: Array, seconds: Array) -> tuple[Array, float]:
    """Nominal rates (ft/min) and the spread of a flight's offset."""
    grid = np.linspace(levels[0], levels[-1], 400)
    base = np.interp(grid, levels, 1 / slowness)
    scores = truncnorm.ppf(RANKS, -WIDEST_SD, WIDEST_SD)

    def mismatch(values: Array) -> Array:
        factor, sigma = values
        rates = np.clip(factor * base + sigma * scores[:, None], SLOWEST_FPM, None)
        times = np.trapezoid(6000 / rates, grid, axis=1)
        return np.array([times.mean() / seconds.mean() - 1, times.std() / seconds.std() - 1])

    start = [1.0, seconds.std() / seconds.mean() / slowness.mean()]
    factor, sigma = least_squares(mismatch, start, bounds=([0.5, 0.0], [2.0, np.inf])).x
    return factor / slowness, float(sigma)


def _speeds(samples: pl.DataFrame, levels: Array) -> tuple[Array, Array, pl.DataFrame]:
    """CAS (kt) and Mach by level, each held beyond the levels where most samples fly it; and the samples' own."""
    phases = constant_speeds(samples)
    table = samples.join(phases.select("sample_id", "crossover_fl"), on="sample_id")
    on_mach = pl.col("level_fl") >= pl.col("crossover_fl").fill_null(1000.0)
    by_level = table.group_by("level_fl").agg(
        mach=pl.col("Mach").filter(on_mach).mean(), cas=pl.col("CAS").filter(~on_mach).mean(), share=on_mach.mean()
    )
    by_level = by_level.sort("level_fl")
    # Flights of low levels have no part at constant Mach number: that of their highest level never limits them.
    of_sample = samples.sort("level_fl").group_by("sample_id")
    ends = of_sample.agg(mach=pl.col("Mach").last(), cas_kt=pl.col("CAS").first())
    speeds = []
    for name, column, most in (("cas", "cas_kt", by_level["share"] < 0.5), ("mach", "mach", by_level["share"] >= 0.5)):
        known = by_level.filter(most & by_level[name].is_not_null())
        if known.is_empty():
            phases = phases.drop(column).join(ends.select("sample_id", column), on="sample_id")
            speeds.append(np.full(len(levels), phases[column].mean()))
        else:
            speeds.append(np.interp(levels, known["level_fl"].to_numpy(), known[name].to_numpy()))
    return speeds[0], speeds[1], phases


def _offset(mean: float, sigma: float) -> dict[str, float]:
    """A truncated normal as bluebird has it: it takes the offset from ``norm_mean``."""
    ends = {"minimum": mean - WIDEST_SD * sigma, "maximum": mean + WIDEST_SD * sigma}
    return {name: round(value, 4) for name, value in {"norm_mean": mean, "sigma": sigma, **ends}.items()}


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
    speeds = []
    for sample in table.partition_by("sample_id", maintain_order=True):
        mach, cas, level = (sample[name].to_numpy() for name in ("Mach", "CAS", "level_fl"))
        split = _split(mach, cas)
        row = {"sample_id": sample["sample_id"][0]}
        if split >= FEWEST_LEVELS:
            row |= {"crossover_fl": float(level[split - 1]), "mach": float(mach[:split].mean())}
        if len(level) - split >= FEWEST_LEVELS:
            row["cas_kt"] = float(cas[split:].mean())
        speeds.append(row)
    return pl.DataFrame(
        speeds, schema={"sample_id": pl.Int32, "crossover_fl": pl.Float64, "mach": pl.Float64, "cas_kt": pl.Float64}
    )


def _split(mach: Array, cas: Array) -> int:
    """Number of levels from the top that are flown at constant Mach."""
    above = _variation(mach / MACH_UNIT)
    below = _variation(cas[::-1] / CAS_UNIT_KT)[::-1]
    return int(np.argmin(above + below))


def _variation(values: Array) -> Array:
    """Sum of squares about the mean of the first k values, for k = 0 to all."""
    count = np.arange(1, len(values) + 1)
    centred = values - values[0]
    return np.concatenate([[0.0], np.cumsum(centred**2) - np.cumsum(centred) ** 2 / count])
