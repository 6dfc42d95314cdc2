"""Rows of samples on a clock of equal steps, in place of a row for each level."""

import numpy as np
import polars as pl
from numpy.typing import NDArray

from descentflow.core.errors import ConfigError

Array = NDArray[np.float64]
TURNS = {"track": 0.0, "longitude": -180.0}
"""Angles (degrees), and where each begins: between rows they go the shorter way round."""
FEWEST = 2
"""Rows of a flight."""


def rows_by_time(table: pl.DataFrame, step_s: float) -> pl.DataFrame:
    """Rows where the clock shows a multiple of a step: UTC if there are timestamps, else the time since entry.

    Programs that resample take the first row of each step for the step's beginning: at odd times it is not.

    Args:
        table: Flights with a row for each level, in the order of time, identified by ``sample_id``.
        step_s: Seconds from row to row.

    Returns:
        The same columns; numbers are interpolated in time, ``level_fl`` too.

    Raises:
        ConfigError: If the step is not above 0, or leaves a flight fewer than two rows.

    Example:
        >>> from descentflow.generation.sample import sample
        >>> rows_by_time(sample("best.ckpt", 2).to_polars(), 5.0)["time_s"][:3].to_list()
        [0.0, 5.0, 10.0]
    """
    if not step_s > 0:
        raise ConfigError(f"rows every {step_s:g} s", expected="above 0 s", mend="pass for instance --step-s 1")
    found = []
    # Microseconds of UTC are whole numbers: rows fall on the step itself.
    name, step = ("timestamp", 1e6 * step_s) if "timestamp" in table.columns else ("time_s", step_s)
    for one in table.partition_by("sample_id", maintain_order=True):
        clock = one[name].to_physical().to_numpy().astype(float)
        times = step * np.arange(np.ceil(clock[0] / step), np.floor(clock[-1] / step) + 1)
        if len(times) < FEWEST:
            raise ConfigError(
                f"rows every {step_s:g} s of a descent of {(clock[-1] - clock[0]) * step_s / step:.0f} s",
                expected=f"{FEWEST} rows or more of each descent",
                mend="pass for instance --step-s 1",
            )
        found.append(rows_at(one, clock, times))
    return pl.concat(found)


def rows_at(one: pl.DataFrame, clock: Array, times: Array) -> pl.DataFrame:
    """Rows of one flight at other times.

    Args:
        one: The flight, a row for each level.
        clock: (k,) time of each row, ascending.
        times: (m,) times of the new rows, on the same clock.

    Returns:
        m rows of the same columns; what is no number is that of the first row.

    Example:
        >>> from descentflow.generation.sample import sample
        >>> one = sample("best.ckpt", 1).to_polars()
        >>> rows_at(one, one["time_s"].to_numpy(), np.array([10.0, 20.0]))["time_s"].to_list()
        [10.0, 20.0]
    """
    columns: dict[str, pl.Series] = {}
    for name, kind in one.schema.items():
        if name == "sample_id" or not (kind.is_numeric() or kind.is_temporal()):
            columns[name] = one[name].head(1).new_from_index(0, len(times))
            continue
        values = one[name].to_physical().to_numpy().astype(float)
        if name in TURNS:
            turned = np.interp(times, clock, np.unwrap(values, period=360))
            values = (turned - TURNS[name]) % 360 + TURNS[name]
        else:
            values = np.interp(times, clock, values)
        columns[name] = (
            pl.Series(values.round().astype(np.int64)).cast(kind) if kind.is_temporal() else pl.Series(values)
        )
    return pl.DataFrame(columns)
