"""`descentflow prepare`: surveillance rows to free descents."""

import argparse
from pathlib import Path


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
    rules.add_argument("--slowest-fpm", type=float, default=500.0, help="slowest rate that counts as descent (500)")
    rules.add_argument("--transient-s", type=float, default=20.0, help="dropped beside level flight (20 s)")
    rules.add_argument("--constant-rate-s", type=float, default=90.0, help="shortest managed stretch (90 s)")
    rules.add_argument("--constant-rate-drift-fpm", type=float, default=30.0, help="its largest drift of rate (30)")
    rules.add_argument("--constant-rate-scatter-fpm", type=float, default=55.0, help="its largest scatter of rate (55)")
    rules.add_argument("--longest-gap-s", type=float, default=60.0, help="longest gap that is bridged (60 s)")
    rules.add_argument("--highest-gap-ft", type=float, default=3000.0, help="highest gap that is bridged (3000 ft)")
    rules.add_argument("--fewest-levels", type=int, default=20, help="shortest descent kept, in levels (20)")


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
    with tqdm(total=3, desc="prepare", delay=2, bar_format="{desc}: {n_fmt}/{total_fmt} {postfix}") as bar:

        def show(stage: str) -> None:
            bar.set_postfix_str(stage, refresh=False)
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
