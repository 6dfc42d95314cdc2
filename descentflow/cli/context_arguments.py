"""The context of samples on the command line: words `name=value`, or a table."""

import argparse
from pathlib import Path


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments that set the context."""
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


def context_of(args: argparse.Namespace) -> dict[str, str | None] | Path | None:
    """The context that the words or the table stand for; None if there are neither.

    Raises:
        ConfigError: If there are both, or a word is not NAME=VALUE.
    """
    from descentflow.core.errors import ConfigError

    if args.given and args.given_table:
        raise ConfigError("both --given and --given-table", expected="one of them", mend="leave one of them out")
    if not args.given:
        table: Path | None = args.given_table
        return table
    pairs = [word.partition("=") for word in args.given]
    odd = [word for word, (_, equals, _) in zip(args.given, pairs, strict=True) if not equals]
    if odd or len({name for name, _, _ in pairs}) < len(pairs):
        raise ConfigError(
            f"--given {' '.join(odd or args.given)}", expected="NAME=VALUE, each name once", mend="correct the words"
        )
    return {name: value or None for name, _, value in pairs}
