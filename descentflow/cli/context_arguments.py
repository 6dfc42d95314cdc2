"""The context that a command is given: words `name=value`, or a table."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import polars as pl
    from torch import Tensor

    from descentflow.representation.representation import Representation


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments that say what is given."""
    parser.add_argument(
        "--given",
        nargs="+",
        action="extend",
        metavar="NAME=VALUE",
        help="context of all descents, for a model that was fitted with data.context: deviation_k=10 operator=FST",
    )
    parser.add_argument(
        "--given-table",
        type=Path,
        help="CSV or Parquet with the columns of the context; sample i is of row i, beginning again after the last",
    )


def given_frame(args: argparse.Namespace, parts: "Representation") -> "pl.DataFrame | None":
    """Contexts that were given, a row each; None for a model without context.

    Raises:
        ConfigError: If the model knows no context, if none was given, or both words and a table.
        DataError: If the table cannot be read.
    """
    import polars as pl

    from descentflow.core.errors import ConfigError

    if parts.context is None:
        if args.given or args.given_table:
            raise ConfigError(
                "--given with a model that knows no context",
                expected="a checkpoint that was fitted with data.context",
                mend="leave --given away, or fit with --data.context",
            )
        return None
    if bool(args.given) == bool(args.given_table):
        raise ConfigError(
            "both --given and --given-table" if args.given else "a conditional model without a context",
            expected=f"--given or --given-table with {parts.context.describe()}",
            mend="give one of them",
        )
    if args.given_table:
        return _table(args.given_table, parts.context.names)
    pairs = [word.partition("=") for word in args.given]
    names = [name for name, _, _ in pairs]
    odd = [word for word, (_, equals, _) in zip(args.given, pairs, strict=True) if not equals]
    if odd or len(set(names)) < len(names):
        raise ConfigError(
            f"--given {' '.join(odd or args.given)}", expected="NAME=VALUE, each name once", mend="correct the words"
        )
    parts.context.given({name: value or None for name, _, value in pairs})  # refuses unknown names and values
    text = [column.name for column in parts.context.columns if column.kind == "category"]
    frame = pl.DataFrame({name: [value or None] for name, _, value in pairs}, schema=dict.fromkeys(names, pl.String))
    return frame.with_columns(pl.exclude(text).cast(pl.Float64))


def _table(path: Path, names: tuple[str, ...]) -> "pl.DataFrame":
    import polars as pl

    from descentflow.core.errors import DataError

    try:
        table = pl.read_csv(path) if path.suffix == ".csv" else pl.read_parquet(path)
    except (pl.exceptions.PolarsError, OSError) as error:
        raise DataError(
            f"{path}: {str(error).splitlines()[0]}", expected="a CSV or Parquet table", mend="pass another table"
        ) from error
    if table.is_empty():
        raise DataError(f"{path}: no row", expected="a row for each context", mend="add rows")
    return table.select([name for name in names if name in table.columns])


def entry_of(frame: "pl.DataFrame", parts: "Representation") -> "Tensor | None":
    """Index of the level that each row enters at, where `entry_fl` is part of the context: the nearest of the grid."""
    import polars as pl
    import torch

    if parts.context is None or "entry_fl" not in parts.context.names:
        return None
    wanted = frame["entry_fl"].cast(pl.Float64, strict=False)
    if wanted.null_count():
        return None
    levels = parts.decoder.levels_fl
    return (torch.from_numpy(wanted.to_numpy().copy())[:, None] - levels).abs().argmin(1)
