"""The contexts that samples are drawn for: one for all of them, or a table with a row for each."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import torch
from torch import Tensor

from descentflow.core.errors import ConfigError, DataError
from descentflow.representation.context import ContextEncoder
from descentflow.representation.representation import Representation

Contexts = Mapping[str, Any] | pl.DataFrame | str | Path
"""Values of one context by name, a table with one context in each row, or the path of such a table."""


def context_rows(context: Contexts | None, encoder: ContextEncoder) -> pl.DataFrame:
    """The contexts as a table with the encoder's columns; one without columns for a density without context.

    Args:
        context: Values by name (text is read as the column's kind; None where the model knows missing values), a table,
            or the path of a CSV or Parquet table.
        encoder: The density's.

    Raises:
        ConfigError: If the density has no context, none is given to one that has, a name or a value cannot be, or a
            number lies outside of what the training flights had.
        DataError: If the table cannot be read or is empty.

    Example:
        >>> encoder = ContextEncoder.fit(pl.DataFrame({"deviation_k": [0.0, 10.0]}), ["deviation_k"])
        >>> context_rows({"deviation_k": "7.5"}, encoder)["deviation_k"].to_list()
        [7.5]
    """
    if context is None:
        if not encoder.columns:
            return pl.DataFrame()
        raise ConfigError(
            "a conditional model without a context",
            expected=f"a context with {encoder.describe()}",
            mend="give its values, or a table with a row for each context",
        )
    if not encoder.columns:
        raise ConfigError(
            "a context for a model that knows no context",
            expected="a model that was fitted with data.context",
            mend="leave the context out, or fit with data.context",
        )
    if isinstance(context, Mapping):
        return _one_row(context, encoder)
    if isinstance(context, str | Path):
        # Here and not above: samples without a file do without its readers.
        from descentflow.representation.context_columns import read_table

        context = read_table(Path(context))
    if context.is_empty():
        raise DataError("a table of contexts without a row", expected="a row for each context", mend="add rows")
    rows = context.select([name for name in encoder.names if name in context.columns])
    if rows.width == len(encoder.names):
        encoder.check_range(rows)
    return rows


def _one_row(context: Mapping[str, Any], encoder: ContextEncoder) -> pl.DataFrame:
    several = [name for name, value in context.items() if np.ndim(value) > 0]
    if several:
        raise ConfigError(
            f"context {', '.join(f'{name} = {context[name]!r:.60}' for name in several)}",
            expected="one value of each name, for all descents",
            mend="pass a table with a row for each descent: pl.DataFrame({name: values, ...})",
        )
    encoder.encode_one(context)  # refuses unknown names and values
    kinds = {column.name: pl.String if column.kind == "category" else pl.Float64 for column in encoder.columns}
    row = pl.DataFrame([pl.Series(name, [value]).cast(kinds[name]) for name, value in context.items()])
    encoder.check_range(row)
    return row


def entry_levels(
    representation: Representation, contexts: pl.DataFrame, entry_fl: float | Sequence[float] | None
) -> Tensor:
    """Indices (m,) of the levels where descents start; empty if they are drawn as the training flights entered.

    Args:
        representation: The model's: its grid, and whether ``entry_fl`` is part of its context.
        contexts: From :func:`context_rows`; where they hold ``entry_fl``, each descent starts at the level of the grid
            nearest to it.
        entry_fl: Flight levels that the caller asks for: one for all, one for each context, or without contexts
            several to draw from.

    Raises:
        ConfigError: If the levels are not on the grid, are given twice, or are not as many as the contexts.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> representation = load_model("best.ckpt").representation
        >>> representation.decoder.levels_fl[entry_levels(representation, pl.DataFrame(), [300, 320])]
        tensor([300., 320.], dtype=torch.float64)
    """
    own, levels = "entry_fl" in contexts.columns, representation.decoder.levels_fl
    if entry_fl is None:
        wanted = contexts["entry_fl"].cast(pl.Float64, strict=False).to_list() if own else []
        return _nearest(levels, [] if None in wanted else wanted)
    asked = [float(level_fl) for level_fl in np.atleast_1d(entry_fl)]
    # At the lowest level nothing is left to descend.
    wrong = [level_fl for level_fl in asked if not float(levels[0] + levels[1]) / 2 < level_fl <= float(levels[-1])]
    one_each = len(contexts) if len(asked) == 1 and contexts.width else 1
    if own or wrong or not asked or (contexts.width and len(contexts) != len(asked) * one_each):
        raise ConfigError(
            f"entry_fl {', '.join(f'{name:g}' for name in asked[:8])}"
            + (" next to a context that holds entry_fl" if own else ""),
            expected=f"flight levels above {levels[0]:.0f}, up to {levels[-1]:.0f}: one, or one for each context",
            mend="leave entry_fl to the context" if own else "choose levels of the model's grid",
        )
    return _nearest(levels, asked * one_each)


def _nearest(levels_fl: Tensor, wanted: list[float]) -> Tensor:
    return (torch.tensor(wanted, dtype=torch.float64)[:, None] - levels_fl.cpu()).abs().argmin(1)
