"""`descentflow diagnose`: where a simulator and real descents differ, which effect causes it, how far it shrinks."""

import argparse
from pathlib import Path


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.description = (
        "Compare a simulator with real descents: where they differ, which unmodelled effect causes it, and how far the "
        "gap shrinks once it is added. Writes gap.json, gap.html and, for a checkpoint, corrected.ckpt."
    )
    parser.add_argument("--real", type=Path, required=True, help="rows, or prepared descents (descentflow prepare)")
    which = parser.add_mutually_exclusive_group(required=True)
    which.add_argument("--simulator", type=Path, help="checkpoint that `descentflow fit` wrote (.ckpt)")
    which.add_argument("--typecode", help="nominal BADA of this type at each flight's own speed, for instance A320")
    parser.add_argument("--bada-dir", type=Path, help="BADA 3 files for --typecode (default: open aircraft)")
    parser.add_argument("--out", type=Path, required=True, help="folder for the report")
    parser.add_argument("--channels", help="use these alone, for instance IAS,Mach,TAS,groundspeed (default: all)")
    parser.add_argument("--seed", type=int, default=0, help="the same seed gives the same answer (default: 0)")


def run(args: argparse.Namespace) -> None:
    """Diagnose, write and print the answer."""
    from tqdm import tqdm

    from descentflow.core.errors import ConfigError
    from descentflow.diagnosis.diagnose import diagnose

    if args.bada_dir is not None and args.typecode is None:
        raise ConfigError("--bada-dir without --typecode", expected="both", mend="name the type, or drop --bada-dir")
    channels = [name.strip() for name in args.channels.split(",")] if args.channels else None
    with tqdm(desc="diagnose", delay=2, leave=False, bar_format="{desc} [{elapsed}]") as bar:

        def show(stage: str) -> None:
            bar.set_description_str(f"diagnose: {stage}", refresh=False)
            bar.update()

        report = diagnose(
            args.real,
            args.simulator,
            typecode=args.typecode,
            bada_dir=args.bada_dir,
            channels=channels,
            seed=args.seed,
            out=args.out,
            progress=show,
        )
    print(report)
    print(f"wrote {args.out / 'gap.json'} and {args.out / 'gap.html'}")
