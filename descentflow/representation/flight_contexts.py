"""The context of flights: encoded in their order, or the flight is left out and counted."""

from collections.abc import Callable

import polars as pl
import torch
from torch import Tensor

from descentflow.core.errors import DataError
from descentflow.representation.context import ContextEncoder, Missing
from descentflow.representation.profiles import Profiles


def contexts_of(
    flight_ids: tuple[str, ...], table: pl.DataFrame | None, encoder: ContextEncoder | None
) -> Tensor | None:
    """Encoded context (n, c) of flights in their order; None without an encoder.

    Example:
        >>> table = pl.DataFrame({"flight_id": ["a", "b", "c"], "deviation_k": [0.0, 5.0, 10.0]})
        >>> contexts_of(("c", "a"), table, ContextEncoder.fit(table, ["deviation_k"]))
        tensor([[ 1.],
                [-1.]], dtype=torch.float64)
    """
    if encoder is None or table is None:
        return None
    order = pl.DataFrame({"flight_id": list(flight_ids)}, schema={"flight_id": pl.String})
    return encoder.encode(order.join(table, on="flight_id", how="left", maintain_order="left"))


def with_context(
    profiles: Profiles, table: pl.DataFrame | None, encoder: ContextEncoder | None, say: Callable[[str], None]
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
    if encoder is None or table is None:
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
    frame: pl.DataFrame, table: pl.DataFrame | None, missing: Missing, say: Callable[[str], None]
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
    if table is None or missing == "indicator":
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
