"""Times that a predictor gave for real flights: a simulator that flies each real flight's airspeeds down in them."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from descentflow.core.errors import DataError
from descentflow.core.tabular import held_table
from descentflow.core.units import FL_M, FPM_MPS
from descentflow.surveillance.descents.prepared_descents import Descents
from descentflow.surveillance.open_descents import paths_of
from descentflow.surveillance.unpacking import whole_input

KEYS = ("flight_id", "level_fl")
SIGNS = np.array([[1.0], [-1.0]])
TIMES = ("time_s", "mean_s")
"""Columns of the time (s): of any predictor, and as `descentflow predict-descent` writes it."""
SCANNED: dict[str, Callable[[Path], pl.LazyFrame]] = {".csv": pl.scan_csv, ".parquet": pl.scan_parquet}


def table_of_times(source: Any) -> pl.DataFrame | None:
    """Columns ``flight_id level_fl time_s`` of a predictor's table; None where a source is something else.

    Args:
        source: A Parquet or CSV file, or a table in memory: one that has times and no airspeeds.

    Example:
        >>> table_of_times("descents.parquet") is None
        True
    """
    path = next(iter(paths_of(source)), Path())
    with whole_input(path, "a whole table", "write it again"):
        scanned = path.is_file() and path.suffix in SCANNED
        table = SCANNED[path.suffix](path) if scanned else held_table(source)
        if not isinstance(table, pl.LazyFrame | pl.DataFrame):
            return None
        columns = table.lazy().collect_schema().names()
        if "IAS" in columns or not set(KEYS) <= set(columns):
            return None
        time = next((name for name in TIMES if name in columns), None)
        if time is None:
            raise DataError(
                f"a predictor's table with {', '.join(columns)}",
                expected=f"{', '.join(KEYS)} and {' or '.join(TIMES)}",
                mend="name the column of times so",
            )
        numbers = [pl.col(name).cast(pl.Float64, strict=False) for name in (KEYS[1], time)]
        return table.lazy().select(pl.col(KEYS[0]).cast(pl.String), *numbers).rename({time: TIMES[0]}).collect()


def flown_as_predicted(real: Descents, times: pl.DataFrame) -> tuple[Descents, dict[str, int]]:
    """Real flights with the times and rates that were predicted for them, and what was left out, by reason.

    Times are linear between the table's levels, and count from any instant. Levels that it does not span are left out.

    Args:
        real: Prepared descents.
        times: See :func:`table_of_times`; flights are named as in the descents.

    Raises:
        DataError: If no flight has times that grow downwards.
    """
    whole = times.drop_nulls().filter(pl.all_horizontal(pl.col(KEYS[1], TIMES[0]).is_finite())).sort(KEYS[1])
    predicted = {name: part for (name,), part in whole.partition_by(KEYS[0], as_dict=True).items()}
    flights = {name: part for (name,), part in real.frame.partition_by(KEYS[0], as_dict=True).items()}
    tables = {name: predicted[name].select(KEYS[1], TIMES[0]).to_numpy().T for name in flights if name in predicted}
    grow = {name for name, table in tables.items() if len(table.T) > 1 and (np.diff(table) * SIGNS > 0).all()}
    counts = {
        "predicted_times_without_a_number": len(times) - len(whole),
        "predictions_of_other_flights": len(predicted) - len(tables),
        "flights_without_a_prediction": len(flights) - len(tables),
        "predictions_whose_times_do_not_grow_downwards": len(tables) - len(grow),
    }
    if not grow:
        raise DataError(
            f"a predictor's table without a usable flight among {len(flights):,} ({counts})",
            expected="flights named as in the prepared descents (flight_id), with times that grow downwards",
            mend="prepare the real rows first, and predict for its flights",
        )
    flown = pl.concat([_flown(flight, *tables[name]) for name, flight in flights.items() if name in grow])
    return Descents(flown, real.metadata), {name: count for name, count in counts.items() if count}


def _flown(flight: pl.DataFrame, level: np.ndarray[Any, Any], time: np.ndarray[Any, Any]) -> pl.DataFrame:
    """One flight down in the predicted times; its rate at a level is that of the table's step there."""
    flight = flight.filter(pl.col(KEYS[1]).is_between(level[0], level[-1]))
    at = flight[KEYS[1]].to_numpy().astype(np.float64)
    step = np.clip(np.searchsorted(level, at), 1, len(level) - 1)
    rate_fpm = (level[step] - level[step - 1]) * FL_M / (time[step] - time[step - 1]) / FPM_MPS
    return flight.with_columns(time_s=pl.Series(np.interp(at, level, time)), vertical_rate=pl.Series(rate_fpm))
