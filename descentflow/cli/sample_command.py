"""`descentflow sample`: draw plausible descents from a checkpoint."""

import argparse
from pathlib import Path

from descentflow.cli import context_arguments as given


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.description = (
        "Draw plausible descents from a fitted model and write them as one long table: a row per sample and flight "
        "level, with time since entry, altitude, CAS, Mach, TAS, vertical rate and drag. A model that was fitted with "
        "data.context is told the context by --given or --given-table; the table then holds it, too."
    )
    parser.add_argument("checkpoint", type=Path, help="checkpoint that `descentflow fit` wrote (.ckpt)")
    parser.add_argument("-n", "--number", type=int, default=10_000, help="descents wanted (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=0, help="the same seed gives the same descents (default: 0)")
    parser.add_argument("--out", type=Path, required=True, help="output: .parquet, .csv or .nc (NetCDF)")
    given.add_arguments(parser)
    parser.add_argument(
        "--draw-budget", type=int, help="most draws before giving up (default: 100 for each descent wanted)"
    )
    parser.add_argument(
        "--compile",
        action="store_true",
        help="let torch.compile fuse the decoder's arithmetic: needs a C++ compiler and some ten seconds, and pays "
        "from millions of descents",
    )


def run(args: argparse.Namespace) -> None:
    """Load, sample, write, and say what was rejected."""
    from tqdm import tqdm

    from descentflow.core.errors import ConfigError
    from descentflow.core.files import check_output
    from descentflow.densities.checkpoint import load_model
    from descentflow.generation.rejection import sample_descents
    from descentflow.generation.sample_tables import write_samples

    if args.number < 1:
        raise ConfigError(f"-n {args.number}", expected="at least one descent", mend="pass a positive number")
    check_output(args.out)
    model = load_model(args.checkpoint)
    parts = model.representation
    contexts = given.given_frame(args, parts)
    encoded = None if contexts is None or parts.context is None else parts.context.encode(contexts)
    with tqdm(total=args.number, desc="descents", delay=2) as bar:
        samples = sample_descents(
            model,
            parts.decoder,
            parts.plausibility,
            args.number,
            args.seed,
            context=encoded,
            entry=None if contexts is None else given.entry_of(contexts, parts),
            draw_budget=args.draw_budget,
            compiled=args.compile,
            progress=lambda n: bar.update(n) and None,
        )
    write_samples(samples.trajectories, args.out, contexts)
    print(samples.report)
    print(f"wrote {args.out}")
