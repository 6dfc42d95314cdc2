"""Context of each flight: from a table or the descents; a flight that lacks a value is dropped and counted."""

from collections.abc import Callable, Sequence
from pathlib import Path

import polars as pl
import torch
from torch import Tensor

from descentflow.core.errors import ConfigError, DataError
from descentflow.core.parquet_pages import check_pages
from descentflow.representation.context import ContextEncoder, Missing
from descentflow.representation.profiles import Profiles
from descentflow.surveillance.unpacking import whole_input

DERIVED = {
    "entry_fl": "highest flight level of the descent",
    "hour": "hour of the day (UTC) at that level",
    "operator": "first three letters of the callsign",
}
"""Names that need no column of their own."""


def read_context_table(path: str | Path | pl.DataFrame | None) -> pl.DataFrame | None:
    """Read a table of context with one row for each flight, CSV or Parquet; a table in memory is only checked.

    Raises:
        DataError: If it cannot be read, has no `flight_id`, or has a flight twice.

    Example:
        >>> table = pl.DataFrame({"flight_id": ["A320-0-00003"], "deviation_k": [7.5]})
        >>> read_context_table(table).columns
        ['flight_id', 'deviation_k']
    """
    if path is None:
        return None
    in_memory = isinstance(path, pl.DataFrame)
    table = path if isinstance(path, pl.DataFrame) else read_table(Path(path))
    name = "the table of context" if in_memory else path
    if "flight_id" not in table.columns:
        raise DataError(
            f"{name}: no column flight_id", expected="flight_id and columns of context", mend="add flight_id"
        )
    if table["flight_id"].n_unique() < len(table):
        twice = table["flight_id"].filter(table["flight_id"].is_duplicated())[0]
        raise DataError(
            f"{path}: flight {twice} twice", expected="one row for each flight", mend="keep one row of each"
        )
    return table


def read_table(path: Path) -> pl.DataFrame:
    """Read a CSV or Parquet table.

    Raises:
        DataError: If it cannot be read.

    Example:
        >>> pl.DataFrame({"flight_id": ["A320-0-00003"], "deviation_k": [7.5]}).write_csv("context.csv")
        >>> read_table(Path("context.csv")).shape
        (1, 2)
    """
    with whole_input(path, "a CSV or Parquet table", "pass another table"):
        if path.suffix == ".csv":
            return pl.read_csv(path)
        check_pages(path)
        return pl.read_parquet(path)


def flight_context(descents: pl.DataFrame, names: Sequence[str], table: pl.DataFrame | None = None) -> pl.DataFrame:
    """One row for each flight: `flight_id` and the named columns, null where nothing is known.

    A name is looked for in the table, then among the columns of the descents (their value at the flight's highest
    level), then among those of :data:`DERIVED`.

    Args:
        descents: Prepared descents, a row for each flight and level.
        names: Columns of context.
        table: One row for each flight.

    Raises:
        ConfigError: If a name is nowhere to be found.

    Example:
        >>> descents = pl.read_parquet("descents.parquet")
        >>> flight_context(descents, ["entry_fl", "hour"]).head(2).columns
        ['flight_id', 'entry_fl', 'hour']
    """
    top = descents.sort("flight_id", "level_fl", descending=[False, True]).unique("flight_id", keep="first")
    known = set() if table is None else set(table.columns)
    elsewhere = [name for name in names if name not in known]
    unknown = [n for n in elsewhere if n not in top.columns and (n not in DERIVED or not _derivable(n, top))]
    if unknown or len(set(names)) < len(names):
        raise ConfigError(
            f"context {', '.join(unknown or names)}",
            expected=f"different columns among {', '.join(sorted({*known, *top.columns, *DERIVED} - {'flight_id'}))}",
            mend="change data.context, or pass data.context_table with flight_id and the column",
        )
    context = top.select("flight_id", *[_expression(n, top) for n in elsewhere]).sort("flight_id")
    if table is not None:
        joined = [name for name in names if name in known]
        context = context.join(table.select("flight_id", *joined), on="flight_id", how="left", maintain_order="left")
    return context.select("flight_id", *names)


def _derivable(name: str, top: pl.DataFrame) -> bool:
    return name != "operator" or "callsign" in top.columns


def _expression(name: str, top: pl.DataFrame) -> pl.Expr:
    if name in top.columns:
        return pl.col(name)
    if name == "entry_fl":
        return pl.col("level_fl").cast(pl.Float64).alias(name)
    if name == "hour":
        return (pl.col("timestamp").dt.hour() + pl.col("timestamp").dt.minute() / 60).cast(pl.Float64).alias(name)
    letters = pl.col("callsign").str.strip_chars().str.extract(r"^([A-Z]{3})[0-9]")
    return letters.alias(name)


def contexts_of(flight_ids: tuple[str, ...], table: pl.DataFrame, encoder: ContextEncoder) -> Tensor:
    """Encoded context (n, c) of flights in their order.

    Example:
        >>> table = pl.DataFrame({"flight_id": ["a", "b", "c"], "deviation_k": [0.0, 5.0, 10.0]})
        >>> contexts_of(("c", "a"), table, ContextEncoder.fit(table, ["deviation_k"]))
        tensor([[ 1.],
                [-1.]], dtype=torch.float64)
    """
    order = pl.DataFrame({"flight_id": list(flight_ids)}, schema={"flight_id": pl.String})
    return encoder.encode(order.join(table, on="flight_id", how="left", maintain_order="left"))


def with_context(
    profiles: Profiles, table: pl.DataFrame, encoder: ContextEncoder, say: Callable[[str], None]
) -> Profiles:
    """The flights whose context can be encoded; ``say`` is called with a count of the others for each column.

    Example:
        >>> from descentflow.aircraft_types.registry import aircraft
        >>> from descentflow.representation.profiles import profiles_from_frame
        >>> flights = profiles_from_frame(pl.read_parquet("descents.parquet"), aircraft("A320"), 150)
        >>> table = pl.DataFrame({"flight_id": flights.flight_ids, "deviation_k": [None, *range(1, len(flights))]})
        >>> encoder = ContextEncoder.fit(table.drop_nulls(), ["deviation_k"])
        >>> len(with_context(flights, table, encoder, print))
        left out 1 flight(s) whose deviation_k is missing or was never trained on
        119
    """
    if not encoder.columns:
        return profiles
    order = pl.DataFrame({"flight_id": list(profiles.flight_ids)})
    lacking = encoder.lacking(order.join(table, on="flight_id", how="left", maintain_order="left"))
    whole = torch.ones(len(profiles), dtype=torch.bool)
    for name, rows in lacking.items():
        if bool(rows.any()):
            say(f"left out {int(rows.sum())} flight(s) whose {name} is missing or was never trained on")
        whole &= ~torch.from_numpy(rows.to_numpy().copy())
    return profiles.subset(torch.nonzero(whole)[:, 0])


def without_missing(
    frame: pl.DataFrame, table: pl.DataFrame, missing: Missing, say: Callable[[str], None]
) -> pl.DataFrame:
    """The descents of flights whose context is complete, before the split; ``say`` gets a count of the others.

    Raises:
        DataError: If no flight has a value for every column.

    Example:
        >>> descents = pl.DataFrame({"flight_id": ["a", "a", "b"], "level_fl": [150, 151, 150]})
        >>> table = pl.DataFrame({"flight_id": ["a", "b"], "deviation_k": [5.0, None]})
        >>> without_missing(descents, table, "drop", print)["flight_id"].to_list()
        left out 1 of 2 flight(s) that lack a value of their context
        ['a', 'a']
    """
    if table.width < 2 or missing == "indicator":
        return frame
    whole = table.drop_nulls()
    whole = whole.filter([pl.col(n).is_finite() for n, t in whole.schema.items() if t.is_float()] or True)
    lacking = len(table) - len(whole)
    if lacking == len(table):
        raise DataError(
            f"none of {lacking} flights has a value for all of {', '.join(table.columns[1:])}",
            expected="a context for the flights of data.descents",
            mend="check the flight_id of data.context_table, or set data.missing_context: indicator",
        )
    if lacking:
        say(f"left out {lacking} of {len(table)} flight(s) that lack a value of their context")
    return frame.filter(pl.col("flight_id").is_in(whole["flight_id"].to_list()))
