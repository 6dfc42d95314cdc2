"""`descentflow prepare`: surveillance rows to free descents."""

import argparse
import re
from dataclasses import fields
from pathlib import Path
from typing import Annotated, Any

from descentflow.cli.options import pairs
from descentflow.configs.packaged_config import config_file
from descentflow.core.errors import ConfigError
from descentflow.surveillance.cleaning.thresholds import Cleaning, meaning_of

UNITS = ("", "k", "m", "g", "t")
IDLE_WITHIN = 5.0
"""Of `--idle-only`: idle N1 varies by as much within a band, and 5 points are some 20 % of idle's fuel flow."""
SHOWN_AT_RANDOM = 6
"""Random flights of `--figures`, besides those of which each filter dropped most."""


def memory_bytes(text: str) -> int:
    """Bytes of a size as people write it.

    Example:
        >>> memory_bytes("1.5GB")
        1500000000
    """
    size = re.fullmatch(r"(\d+(?:\.\d+)?)\s*([kmgt]?)(i?)b?", text.strip().lower())
    if not size:
        raise argparse.ArgumentTypeError(f"{text!r}; expected a size such as 2GB or 800MB")
    return int(float(size[1]) * (1024 if size[3] else 1000) ** UNITS.index(size[2]))


def extend(parser: argparse.ArgumentParser) -> None:
    """Declare an option for each threshold."""
    rules = parser.add_argument_group("thresholds (each with its source in configs/prepare/default.yaml)")
    for field in fields(Cleaning):
        # Absent options are left to --config, and then to the defaults.
        optional = "None" in str(field.type)
        kind = number_or_none if optional else int if isinstance(field.default, int) else float
        text = f"{meaning_of(field.name)} (default: {field.default})".replace("%", "%%")
        name = f"--{field.name.replace('_', '-')}"
        if field.name == "idle_only":
            text = f"drop rows with thrust above idle ({IDLE_WITHIN:g} points of N1); needs N1, thrust or fuel_flow"
            rules.add_argument(name, action="store_const", const=IDLE_WITHIN, default=argparse.SUPPRESS, help=text)
            continue
        rules.add_argument(name, type=kind, default=argparse.SUPPRESS, metavar="X", help=text)


def number_or_none(text: str) -> float | None:
    """A threshold, or none to switch its filter off.

    Example:
        >>> number_or_none("25"), number_or_none("none")
        (25.0, None)
    """
    return None if text.lower() == "none" else float(text)


def run(
    rows: list[Path] | None = None,
    *,
    out: Path,
    embedded: bool = False,
    format: str | None = None,
    column: list[str] | None = None,
    airspeeds_from: list[str] | None = None,
    types: Path | None = None,
    typecode: str | None = None,
    report: Path | None = None,
    figures: Path | None = None,
    level_flight: Path | None = None,
    bada_dir: Path | None = None,
    memory: Annotated[int, memory_bytes] = 2_000_000_000,
    engine: str = "local",
    scheduler: str | None = None,
    workers: int | None = None,
    config: Path | None = None,
    **thresholds: Any,
) -> None:
    """Clean surveillance rows to free descents on flight levels, with a report of everything dropped.

    Rows come from any source that the documentation lists, each with a time, an address, pressure altitude, IAS and
    Mach. Their number is not limited: memory is bounded, and a run that was killed is resumed by the same call.

    Args:
        rows: files or folders of rows
        out: a .parquet file, or a folder for a store of Parquet files by type
        embedded: use the real snapshots that come with descentflow
        format: format of the files (default: recognised from their content)
        column (NAME=COLUMN): column of the tables for a name of the rows, where it has another name there:
            altitude=alt_ft; may be given again (names and units: timestamp, icao24, altitude and geoaltitude in ft,
            IAS, TAS and groundspeed in kt, Mach, vertical_rate in ft/min, ..., or FL for flight levels; without Mach it
            is computed from IAS and altitude); 'altitude=alt_m*3.2808' multiplies
        airspeeds_from (FIELD): for rows without IAS and Mach, which get them from groundspeed, track, and the wind and
            temperature of this weather field (NetCDF or GRIB on pressure levels, a file or a folder; may be given
            again), of 'columns' of the rows (u_component_of_wind, v_component_of_wind in m/s, temperature in K), or of
            their 'neighbours', aircraft of the same rows that report theirs
        types: CSV of icao24,typecode, or flight_id,typecode, for rows that do not name their type
        typecode: keep these types, for instance A320,A321 (default: all)
        report: also write the report as JSON
        figures (DIR): plots of the rows kept and dropped of some flights
        level_flight (DIR): tables of level flight in descents by flight and by segment, with its fuel, and a picture
        bada_dir: folder of BADA 3 or 4 for the fuel of level flight (default: open aircraft)
        memory: bound on each process's memory (default: 2GB)
        engine: local, threads of this process; or dask, workers of Dask
        scheduler: of Dask: its address, or the file it wrote, .json (default: workers on this machine)
        workers: threads, or Dask's workers on this machine (default: processors)
        config: YAML file of thresholds; options given here override it
        **thresholds: the others, each with its source in configs/prepare/default.yaml
    """
    import json

    from descentflow.core.files import check_folder, write_whole
    from descentflow.core.progress import stage
    from descentflow.surveillance.formats.aircraft_json import embedded_rows, embedded_types
    from descentflow.surveillance.prepare import prepare

    rows = rows or []
    _check_outputs(rows, types, out, report)
    _check_memory(memory)
    if figures:
        check_folder(figures, "index.html")
    if level_flight:
        from descentflow.measurements.level_fuel import FILES, write_level_flight

        check_folder(level_flight, *FILES)
    if not rows and not embedded:
        raise ConfigError("no rows", expected="files, folders or --embedded", mend="name what is to be prepared")
    chosen = cleaning_of_options(config, thresholds)
    was_there = out.is_dir() and any(out.iterdir())
    with stage("reading rows") as shown:
        descents = prepare(
            [*rows, *([embedded_rows()] if embedded else [])],
            typecode=typecode,
            types=types or (embedded_types() if embedded else None),
            cleaning=chosen,
            out=out,
            format=format,
            columns=pairs("--column", column or []),
            airspeeds_from=airspeeds_from,
            memory_bytes=memory,
            engine=scheduler or engine,
            workers=workers,
            shown=SHOWN_AT_RANDOM if figures else 0,
            progress=shown.say,
        )
    if report:
        write_whole(report, json.dumps(descents.metadata, indent=1))
    if figures and descents.dropped_rows is not None:
        from descentflow.surveillance.figure_pages import write_page

        with stage("drawing figures"):
            number = write_page(figures, descents.dropped_rows, descents.report, chosen.slowest_fpm)
        print(f"wrote {figures / 'index.html'}: {number} flights")
    print(descents.report)
    if level_flight:
        print(write_level_flight(descents, level_flight, bada_dir))
        print(f"wrote {level_flight}")
    for typecode, top in descents.metadata["top_fl"].items():
        number = descents.flights[typecode]
        print(f"{typecode}: {number:,} descent{'s' * (number != 1)}, a quarter of them from FL{top} or above")
    print(f"{out} was there already, made of the same" if was_there else f"wrote {out}")


def _check_outputs(rows: list[Path], types: Path | None, out: Path, report: Path | None) -> None:
    """Refuse outputs that cannot be written, or that are inputs, before anything is read."""
    from descentflow.core.files import check_folder, check_output, check_separate

    outputs = [check_output(out) if out.suffix == ".parquet" else check_folder(out)]
    if report:
        outputs.append(check_output(report))
    check_separate(outputs, [*rows, *([types] if types else [])])


def _check_memory(memory: int) -> None:
    from descentflow.surveillance.out_of_core.spill import LEAST_BYTES

    if memory < LEAST_BYTES:
        raise ConfigError(
            f"--memory of {memory / 1e6:,.0f} MB",
            expected=f"{LEAST_BYTES / 1e6:,.0f} MB or more; the program itself takes more than half of that",
            mend="allow more",
        )


def cleaning_of_options(config: Path | None, options: dict[str, Any]) -> Cleaning:
    """Thresholds of the options, else of the file, else the defaults.

    Example:
        >>> cleaning_of_options(None, {"bottom_fl": 100}).bottom_fl
        100
    """
    from descentflow.core.user_files import read_settings
    from descentflow.surveillance.cleaning.thresholds import cleaning_of

    settings = read_settings(config_file(config)) if config else {}
    cleaning_of(settings, str(config))
    return cleaning_of(settings | options, "options")
