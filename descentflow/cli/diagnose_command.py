"""`descentflow diagnose`: where a simulator and real descents differ, which effect causes it, how far it shrinks."""

import argparse
import sys
from pathlib import Path

from descentflow.cli import air_arguments
from descentflow.core.seeds import seed_word


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.description = (
        "Compare a simulator with real descents: where they differ, which unmodelled effect causes it, and how far the "
        "gap shrinks once it is added. The simulator is a checkpoint, or flights of any simulator. Writes gap.json, "
        "gap.html and, with a cause, the corrected simulator (corrected.ckpt) or its flights (corrected.parquet)."
    )
    parser.add_argument(
        "--real",
        type=Path,
        nargs="+",
        required=True,
        help="rows, or prepared descents (descentflow prepare)",
    )
    parser.add_argument(
        "--simulator",
        type=Path,
        nargs="+",
        help="checkpoint that `descentflow fit` wrote; or flights of any simulator, as rows or prepared descents: "
        "files, folders, in every format that `descentflow prepare` reads; told apart by their content",
    )
    parser.add_argument(
        "--typecode",
        help="without --simulator: nominal BADA of this type at each flight's own speed, for instance A320; with a "
        "simulator's flights: the type whose coefficients give the signatures of effects (default: their own)",
    )
    parser.add_argument(
        "--nearest-type",
        action="store_true",
        help="where the flights' type has no coefficients, take those of the nearest type: as many engines of the "
        "same kind, nearest in take-off mass",
    )
    parser.add_argument(
        "--any-type",
        action="store_true",
        help="take real flights of all types; without it those of other types than the checkpoint's or --typecode's "
        "are left out and counted",
    )
    parser.add_argument(
        "--bada-dir", type=Path, help="BADA 3 files for --typecode or a simulator's flights (default: open aircraft)"
    )
    parser.add_argument(
        "--out", type=Path, required=True, help="folder for the report; not one of other flights or another simulator"
    )
    air_arguments.add_source(parser)
    parser.add_argument("--channels", help="use these alone, for instance IAS,Mach,TAS,groundspeed (default: all)")
    parser.add_argument(
        "--catalogue",
        type=Path,
        metavar="FILE.py",
        help="effects of your own that may be named beside the package's: classes or instances of "
        "descentflow.effects.Effect in this Python file, which is run",
    )
    parser.add_argument(
        "--previous",
        type=Path,
        help="gap.json of the diagnosis before the simulator was changed: predicted against achieved closure",
    )
    parser.add_argument("--seed", type=seed_word, default=0, help="the same seed gives the same answer (default: 0)")


def run(args: argparse.Namespace) -> None:
    """Diagnose, write and print the answer."""
    from descentflow.core.progress import stage
    from descentflow.diagnosis.diagnose import diagnose
    from descentflow.diagnosis.report.text import summary

    args.typecode = args.typecode and args.typecode.upper()
    if args.catalogue is not None:
        print(f"descentflow diagnose: runs {args.catalogue} for the effects that it defines", file=sys.stderr)
    channels = [name.strip() for name in args.channels.split(",")] if args.channels else None
    with stage("opening") as shown:
        report = diagnose(
            _one_or_several(args.real),
            _one_or_several(args.simulator),
            typecode=args.typecode,
            nearest_type=args.nearest_type,
            any_type=args.any_type,
            air=air_arguments.source_of(args),
            bada_dir=args.bada_dir,
            channels=channels,
            catalogue=args.catalogue,
            previous=args.previous,
            seed=args.seed,
            out=args.out,
            progress=shown.say,
        )
    print(summary(report, args.out))
    print(f"wrote {args.out / 'gap.json'} and {args.out / 'gap.html'}")


def _one_or_several(paths: list[Path] | None) -> Path | list[Path] | None:
    return paths[0] if paths is not None and len(paths) == 1 else paths
