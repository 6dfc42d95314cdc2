"""Air of samples and of given flights on the command line."""

import argparse
from pathlib import Path


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the argument that sets the air of samples."""
    parser.add_argument(
        "--air",
        nargs="+",
        metavar="AIR",
        help="air of all descents: deviation_k=10 (K from the standard atmosphere), tailwind_growth=1.5 (kt more "
        "tailwind for each 1,000 ft), or both; a .csv or .parquet table with level_fl, deviation_k and tailwind (kt); "
        "a weather field on pressure levels (NetCDF or GRIB file, or a folder of them), met along the path of --end "
        "and --track, or --route, at --time; standard; or training, drawn from the training flights' own "
        "(default for a model fitted with data.air=measured or a weather field; standard for others)",
    )


def air_of(args: argparse.Namespace) -> dict[str, str] | Path | str | None:
    """The air that the words stand for; None if there are none.

    Raises:
        ConfigError: If a word is neither NAME=VALUE nor the only one.
    """
    from descentflow.core.errors import ConfigError

    if not args.air:
        return None
    pairs = [word.partition("=") for word in args.air]
    if len(pairs) == 1 and not pairs[0][1]:
        return str(args.air[0])
    if any(not equals for _, equals, _ in pairs) or len({name for name, _, _ in pairs}) < len(pairs):
        raise ConfigError(
            f"--air {' '.join(args.air)}",
            expected="NAME=VALUE, each name once, or one of standard, training, a table and a weather field",
            mend="write for instance --air deviation_k=10",
        )
    return {name: value for name, _, value in pairs}


def add_source(parser: argparse.ArgumentParser) -> None:
    """Declare the argument for the source of the air of given flights."""
    parser.add_argument(
        "--air",
        nargs="+",
        metavar="AIR",
        help="for a model that was fitted with data.air: where the air of these flights is known from: measured (their "
        "own reports; default for a model fitted with measured), or a weather field: a NetCDF or GRIB file by pressure "
        "level, several, or a folder of them",
    )


def source_of(args: argparse.Namespace) -> str | list[str] | None:
    """Source of the air of given flights; None if it is not given."""
    words: list[str] | None = args.air
    return words[0] if words and len(words) == 1 else words
