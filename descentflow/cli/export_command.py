"""`descentflow export`: samples, or the model itself, in the format of another program."""

from argparse import ArgumentParser
from pathlib import Path
from typing import Annotated, Literal, Unpack

from descentflow.cli.options import Where, context_of
from descentflow.exports.targets import TARGETS


def extend(parser: ArgumentParser) -> None:
    """List the targets."""
    lines = [
        f"  {name:<13}{target.purpose}{'; needs --time, and --end with --track or --route' * target.placed}"
        for name, target in TARGETS.items()
    ]
    parser.epilog = "\n".join(["targets:", *lines])


def run(
    checkpoint: list[Path],
    *,
    to: str,
    out: Path,
    number: Annotated[int, "-n"] = 1000,
    seed: int = 0,
    every: float = 120.0,
    prefix: str = "",
    as_: list[str] | None = None,
    precision: Literal["float64", "float32"] = "float64",
    step_s: float | None = None,
    draw_budget: int | None = None,
    given: list[str] | None = None,
    given_table: Path | None = None,
    **where: Unpack[Where],
) -> None:
    """Write samples of a checkpoint, or the model itself, for another program.

    Args:
        checkpoint: checkpoint that `descentflow fit` wrote (.ckpt); for bluesky and bluebird several, of different
            types
        to (TARGET): one of the targets below
        out: output; some targets write further files in its folder
        number: samples of each checkpoint
        seed: the same seed gives the same files
        every (S): seconds from one flight's arrival to the next one's
        prefix (LETTERS): of the callsigns (default: three letters that stand for these flights)
        as_ (TYPES): types that fly the samples, A319,A320,A321; such a list for each checkpoint: bluesky, bluebird
        precision: of the inputs and outputs of a sampler: onnx
        step_s (S): a row every S seconds, on whole steps of the clock: parquet, cf, traffic (default: 1 for traffic,
            a row for each level for the others)
        draw_budget: most draws before giving up (default: 100 for each sample)
        given (NAME=VALUE): context of all descents, for a model that was fitted with data.context: deviation_k=10
            operator=FST
        given_table: CSV or Parquet with the columns of the context; sample i is of row i, beginning again after the
            last
    """
    from descentflow.core.progress import stage
    from descentflow.exports.export import export

    drawing = ("drawing descents", number * len(checkpoint), "descents")
    with stage(*(("exporting the model",) if to == "onnx" else drawing)) as drawn:
        written = export(
            checkpoint,
            to,
            out,
            n=number,
            seed=seed,
            context=context_of(given, given_table),
            every_s=every,
            draw_budget=draw_budget,
            progress=drawn.advance,
            precision=precision,
            step_s=step_s,
            prefix=prefix,
            fly_as=as_ or (),
            **where,
        )
    for path in written:
        print(f"wrote {path}")
