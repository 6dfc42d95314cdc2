"""`descentflow prepare`: surveillance rows to free descents."""

import argparse
import re
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

from descentflow.configs.packaged_config import config_file
from descentflow.surveillance.cleaning.thresholds import Cleaning, describe

if TYPE_CHECKING:
    from descentflow.core.workers import Engine

UNITS = ("", "k", "m", "g", "t")
SHOWN_AT_RANDOM = 6
"""Random flights of `--figures`, besides those of which each filter dropped most."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.description = (
        "Clean surveillance rows to free descents on flight levels, with a report of everything dropped. Rows come "
        "from any source that the documentation lists, each with a time, an address, pressure altitude, IAS and Mach. "
        "Their number is not limited: memory is bounded, and a run that was killed is resumed by the same call."
    )
    parser.add_argument("rows", type=Path, nargs="*", help="files or folders of rows")
    parser.add_argument(
        "--out", type=Path, required=True, help="a .parquet file, or a folder for a store of Parquet files by type"
    )
    parser.add_argument("--embedded", action="store_true", help="use the real snapshots that come with descentflow")
    parser.add_argument("--format", metavar="NAME", help="format of the files (default: recognised from their content)")
    parser.add_argument(
        "--column",
        type=_pair,
        action="append",
        metavar="NAME=COLUMN",
        help="column of the tables for a name of the rows, where it has another name there: altitude=alt_ft; may be "
        "given again (names and units: timestamp, icao24, altitude and geoaltitude in ft, IAS, TAS and groundspeed "
        "in kt, Mach, vertical_rate in ft/min, ..., or FL for flight levels; without Mach it is computed from IAS and "
        "altitude); 'altitude=alt_m*3.2808' multiplies",
    )
    parser.add_argument("--types", type=Path, help="CSV of icao24,typecode for rows that do not name their type")
    parser.add_argument("--typecode", help="keep these types, for instance A320,A321 (default: all)")
    parser.add_argument("--report", type=Path, help="also write the report as JSON")
    parser.add_argument(
        "--figures", type=Path, metavar="DIR", help="plots of the rows kept and dropped of some flights"
    )
    size = parser.add_argument_group("size")
    size.add_argument(
        "--memory", type=memory_bytes, default="2GB", help="bound on each process's memory (default: %(default)s)"
    )
    size.add_argument(
        "--engine", choices=["local", "dask"], default="local", help="threads of this process, or a Dask cluster"
    )
    size.add_argument("--scheduler", help="address of a Dask scheduler (default: workers on this machine)")
    size.add_argument("--workers", type=int, help="threads, or Dask workers on this machine (default: processors)")
    rules = parser.add_argument_group("thresholds (each with its source in configs/prepare/default.yaml)")
    rules.add_argument("--config", type=Path, help="YAML file of thresholds; options given here override it")
    for field in fields(Cleaning):
        # Absent options are left to --config, and then to the defaults.
        optional = "None" in str(field.type)
        kind = number_or_none if optional else int if isinstance(field.default, int) else float
        text = f"{describe(field.name)[0]} (default: {field.default})".replace("%", "%%")
        name = f"--{field.name.replace('_', '-')}"
        rules.add_argument(name, type=kind, default=argparse.SUPPRESS, metavar="X", help=text)


def number_or_none(text: str) -> float | None:
    """A threshold, or none to switch its filter off.

    Example:
        >>> number_or_none("25"), number_or_none("none")
        (25.0, None)
    """
    try:
        return None if text.lower() == "none" else float(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(f"{text!r}; expected a number, or none for no limit") from error


def _pair(text: str) -> tuple[str, str]:
    name, equals, column = text.partition("=")
    if not (name and equals and column):
        raise argparse.ArgumentTypeError(f"{text!r}; expected NAME=COLUMN, for instance altitude=alt_ft")
    return name, column


def _columns(pairs: list[tuple[str, str]]) -> dict[str, str]:
    from descentflow.core.errors import ConfigError

    names = [name for name, _ in pairs]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise ConfigError(f"--column {twice[0]}=... twice", expected="a column for each name", mend="leave one out")
    return dict(pairs)


def memory_bytes(text: str) -> int:
    """Bytes of a size as people write it.

    Example:
        >>> memory_bytes("1.5GB")
        1500000000
    """
    found = re.fullmatch(r"(\d+(?:\.\d+)?)\s*([kmgt]?)(i?)b?", text.strip().lower())
    if not found:
        raise argparse.ArgumentTypeError(f"{text!r}; expected a size such as 2GB or 800MB")
    return int(float(found[1]) * (1024 if found[3] else 1000) ** UNITS.index(found[2]))


def run(args: argparse.Namespace) -> None:
    """Read, clean, write, and print the report."""
    import json

    from descentflow.core.files import whole_file
    from descentflow.core.progress import stage
    from descentflow.surveillance.formats.embedded import embedded_rows, embedded_types
    from descentflow.surveillance.prepare import prepare

    _check(args)
    paths = [*args.rows, *([embedded_rows()] if args.embedded else [])]
    types = args.types or (embedded_types() if args.embedded else None)
    was_there = args.out.is_dir() and any(args.out.iterdir())
    with stage("reading rows") as shown:
        descents = prepare(
            paths,
            typecode=args.typecode,
            types=types,
            cleaning=_cleaning(args),
            out=args.out,
            format=args.format,
            columns=_columns(args.column or []),
            memory_bytes=args.memory,
            engine=_engine(args),
            shown=SHOWN_AT_RANDOM if args.figures else 0,
            progress=shown.say,
        )
    if args.report:
        with whole_file(args.report) as temporary:
            temporary.write_text(json.dumps(descents.metadata, indent=1))
    if args.figures and descents.dropped_rows is not None:
        from descentflow.surveillance.figures.cleaning_page import write_page

        with stage("drawing figures"):
            number = write_page(args.figures, descents.dropped_rows, descents.report)
        print(f"wrote {args.figures / 'index.html'}: {number} flights")
    print(descents.report)
    for typecode, top in descents.metadata["top_fl"].items():
        number = descents.flights[typecode]
        print(f"{typecode}: {number:,} descent{'s' * (number != 1)}, a quarter of them from FL{top} or above")
    print(f"{args.out} was there already, made of the same" if was_there else f"wrote {args.out}")


def _check(args: argparse.Namespace) -> None:
    """Refuse options that cannot work before anything is read."""
    from descentflow.core.errors import ConfigError
    from descentflow.core.files import check_folder, check_output
    from descentflow.surveillance.out_of_core.spill import LEAST_BYTES

    if not args.rows and not args.embedded:
        raise ConfigError("no rows", expected="files, folders or --embedded", mend="name what is to be prepared")
    if args.memory < LEAST_BYTES:
        raise ConfigError(
            f"--memory of {args.memory / 1e6:,.0f} MB",
            expected=f"{LEAST_BYTES / 1e6:,.0f} MB or more; the program itself takes more than half of that",
            mend="allow more",
        )
    if args.workers is not None and args.workers < 1:
        raise ConfigError(f"--workers {args.workers}", expected="1 or more", mend="leave it out for all processors")
    if args.scheduler and args.engine != "dask":
        raise ConfigError("--scheduler without --engine dask", expected="both", mend="add --engine dask")
    outputs = [path for path in (args.out, args.report) if path]
    for output in outputs:
        if output is args.report or output.suffix == ".parquet":
            check_output(output)
        else:
            check_folder(output)
    if args.figures:
        check_folder(args.figures, "index.html")
    taken = {path.resolve() for path in (*args.rows, *([args.types] if args.types else []))}
    if taken & {path.resolve() for path in outputs} or len({path.resolve() for path in outputs}) < len(outputs):
        raise ConfigError(
            f"an output that is also an input or the other output ({', '.join(map(str, outputs))})",
            expected="names of their own for --out and --report",
            mend="choose other names",
        )


def _cleaning(args: argparse.Namespace) -> Cleaning:
    """Thresholds of the options, else of the file, else the defaults."""
    from descentflow.core.settings_file import read_settings
    from descentflow.surveillance.cleaning.thresholds import cleaning_of

    settings: dict[str, Any] = read_settings(config_file(args.config)) if args.config else {}
    cleaning_of(settings, str(args.config))
    chosen = {field.name: getattr(args, field.name) for field in fields(Cleaning) if field.name in args}
    return cleaning_of(settings | chosen, "options")


def _engine(args: argparse.Namespace) -> "Engine":
    import os

    from descentflow.core.workers import DaskEngine, LocalEngine

    workers = args.workers or os.cpu_count() or 1
    return LocalEngine(workers) if args.engine == "local" else DaskEngine(workers, args.scheduler)
