"""`descentflow prepare`: surveillance rows to free descents."""

import argparse
from pathlib import Path

THRESHOLDS: dict[str, tuple[float, str]] = {
    "flight-gap-s": (900.0, "silence after which an address is another flight, s"),
    "slowest-fpm": (500.0, "slowest rate that counts as descent, ft/min"),
    "transient-s": (20.0, "what is dropped on either side of level flight, s"),
    "constant-rate-s": (50.0, "shortest managed stretch, where a rate is selected at once, held, and given up, s"),
    "constant-rate-alone-s": (180.0, "shortest managed stretch where the rate is held, but no change to it is seen, s"),
    "constant-rate-jump-fpm": (150.0, "smallest change of rate at the begin or end of a managed stretch, ft/min"),
    "constant-rate-drift-fpm": (80.0, "largest drift of the rate over a managed stretch, ft/min"),
    "constant-rate-scatter-fpm": (64.0, "largest scatter of the rate in a managed stretch, ft/min"),
    "longest-gap-s": (60.0, "longest gap that is bridged, s"),
    "highest-gap-ft": (3000.0, "highest gap that is bridged, ft"),
    "fewest-levels": (20, "shortest descent kept, in flight levels"),
}
"""Options named as the fields of `descentflow.surveillance.prepare.Cleaning`, their defaults and meaning."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.description = (
        "Clean surveillance rows into free descents on flight levels, with an account of everything dropped. Rows come "
        "from Parquet or CSV as the traffic library and OpenSky write them, or from aircraft.json snapshots of "
        "dump1090-fa, readsb and tar1090; each needs a time, an address, pressure altitude, IAS and Mach."
    )
    parser.add_argument("rows", type=Path, nargs="*", help="files or folders of rows")
    parser.add_argument("--out", type=Path, required=True, help="prepared descents (.parquet)")
    parser.add_argument("--embedded", action="store_true", help="use the real snapshots that come with descentflow")
    parser.add_argument("--types", type=Path, help="CSV of icao24,typecode for rows that do not name their type")
    parser.add_argument("--typecode", help="keep these types, for instance A320,A321 (default: all)")
    parser.add_argument("--bottom-fl", type=int, default=150, help="lowest flight level (default: %(default)s)")
    parser.add_argument("--report", type=Path, help="also write the account as JSON")
    rules = parser.add_argument_group("thresholds")
    for name, (default, meaning) in THRESHOLDS.items():
        # Absent options are left to the defaults of `Cleaning`, which a test holds to these.
        text = f"{meaning} (default: {default})"
        rules.add_argument(f"--{name}", type=type(default), default=argparse.SUPPRESS, metavar="X", help=text)


def run(args: argparse.Namespace) -> None:
    """Read, clean, write, and print the account."""
    import json
    from dataclasses import fields

    from tqdm import tqdm

    from descentflow.errors import ConfigError
    from descentflow.files import check_output, whole_file
    from descentflow.surveillance.descents import write_descents
    from descentflow.surveillance.embedded import embedded_rows, embedded_types
    from descentflow.surveillance.prepare import Cleaning, prepare
    from descentflow.surveillance.readers import read_table

    if not args.rows and not args.embedded:
        raise ConfigError("no rows", expected="files, folders or --embedded", mend="name what is to be prepared")
    outputs = [path for path in (args.out, args.report) if path]
    for output in outputs:
        check_output(output)
    taken = {path.resolve() for path in (*args.rows, *([args.types] if args.types else []))}
    if taken & {path.resolve() for path in outputs} or len({path.resolve() for path in outputs}) < len(outputs):
        raise ConfigError(
            f"an output that is also an input or the other output ({', '.join(map(str, outputs))})",
            expected="names of their own for --out and --report",
            mend="choose other names",
        )
    paths = [*args.rows, *([embedded_rows()] if args.embedded else [])]
    types = read_table(args.types) if args.types else embedded_types() if args.embedded else None
    cleaning = Cleaning(**{field.name: getattr(args, field.name) for field in fields(Cleaning) if field.name in args})
    with tqdm(desc="prepare", delay=2, leave=False, bar_format="{desc} [{elapsed}]") as bar:

        def show(stage: str) -> None:
            bar.set_description_str(f"prepare: {stage}", refresh=False)
            bar.update()

        wanted = [name.strip() for name in args.typecode.split(",")] if args.typecode else None
        descents, report = prepare(paths, types=types, typecodes=wanted, cleaning=cleaning, progress=show)
    write_descents(descents, args.out)
    if args.report:
        with whole_file(args.report) as temporary:
            temporary.write_text(json.dumps(descents.metadata, indent=1))
    print(report)
    for typecode, top in descents.metadata["top_fl"].items():
        count = descents.frame.filter(typecode=typecode)["flight_id"].n_unique()
        print(f"{typecode}: {count:,} descents, a quarter of them from FL{top} or above")
    print(f"wrote {args.out}")
