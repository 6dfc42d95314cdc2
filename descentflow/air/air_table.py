"""The air that flights met as a table by flight, level and time, with its errors."""

import polars as pl
import torch

from descentflow.air.measured_air import measured_airs
from descentflow.core.units import KT_MPS

STEP_FL = 10
"""Between rows of a flight: air is known in bands of 500 ft, and smooth."""
PLACES = ("latitude", "longitude", "track")


def air_table(frame: pl.DataFrame) -> pl.DataFrame:
    """Temperature and wind of flights by their own reports, where both are known well enough to fly in.

    Args:
        frame: Prepared descents with TAS, and groundspeed for the wind.

    Returns:
        A row for each flight and 1,000 ft: ``flight_id timestamp level_fl``, the place where rows have it,
        ``deviation_k`` (from the standard atmosphere) with ``deviation_error_k``, and ``tailwind`` (kt along the track)
        with ``tailwind_error``. Errors are standard errors; the wind is missing where no groundspeed is reported.

    Raises:
        DataError: If no flight reports its air.

    Example:
        >>> found = air_table(pl.read_parquet("descents.parquet"))
        >>> found["flight_id"].n_unique(), bool((found["deviation_error_k"] < 10).all())
        (120, True)
    """
    low, high = frame["level_fl"].to_numpy().min(), frame["level_fl"].to_numpy().max()
    levels = torch.arange(int(low), int(high) + 1)
    airs = measured_airs(frame, levels)
    shown = airs.known & (levels % STEP_FL == 0)
    row, level = torch.nonzero(shown, as_tuple=True)
    wind = {"tailwind": airs.air.tailwind_mps / KT_MPS, "tailwind_error": airs.tailwind_error_mps / KT_MPS}
    values = {"deviation_k": airs.air.deviation_k, "deviation_error_k": airs.deviation_error_k, **wind}
    table = pl.DataFrame(
        {
            "flight_id": [airs.flight_ids[i] for i in row.tolist()],
            "level_fl": pl.Series(levels[level].numpy()).cast(frame.schema["level_fl"]),
            **{name: value[row, level].numpy() for name, value in values.items()},
        }
    )
    if not airs.wind:
        table = table.with_columns(pl.lit(None, pl.Float64).alias(name) for name in wind)
    # Levels that a flight skipped have no time of their own.
    place = [name for name in PLACES if name in frame.columns]
    seen = frame.select("flight_id", "timestamp", "level_fl", *place)
    return seen.join(table, on=["flight_id", "level_fl"], maintain_order="left")
