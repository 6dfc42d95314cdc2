"""`descentflow evaluate`: scores of a checkpoint against the descents of any prepared file."""

import argparse
from pathlib import Path


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.description = (
        "Sample a checkpoint and score the samples against real descents: time to bottom, CAS and rate above and below "
        "transition, as Kolmogorov-Smirnov and Wasserstein distance and error of the mean, each beside the distance "
        "between two halves of the real flights and beside nominal BADA. Flights that the checkpoint was trained or "
        "validated on are left out."
    )
    parser.add_argument("checkpoint", type=Path, help="checkpoint that `descentflow fit` wrote (.ckpt)")
    parser.add_argument("--real", type=Path, required=True, help="prepared descents (descentflow prepare)")
    parser.add_argument(
        "--context-table", type=Path, help="CSV or Parquet with flight_id and the context, for a conditional model"
    )
    parser.add_argument("--out", type=Path, required=True, help="folder for scores.csv, rejections.json and figures")
    parser.add_argument("-n", "--number", type=int, default=10_000, help="samples (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=0, help="of sampling and splits (default: 0)")
    parser.add_argument(
        "--resamples", type=int, help="also write intervals.csv: 90 %% bootstrap intervals of the scores over flights"
    )
    parser.add_argument("--no-figures", dest="figures", action="store_false", help="draw no figures")


def run(args: argparse.Namespace) -> None:
    """Load both, leave out flights that were trained on, score, write and print."""
    from tqdm import tqdm

    from descentflow.core.files import whole_file
    from descentflow.densities.checkpoint import load_model
    from descentflow.evaluation.evaluate import evaluate
    from descentflow.training.datamodule import DescentDataModule

    model = load_model(args.checkpoint)
    data = DescentDataModule(args.real, checkpoint=args.checkpoint, context_table=args.context_table)
    data.setup()
    real, seen = data.profiles("test"), len(data.profiles("train")) + len(data.profiles("validation"))
    n_splits = 20
    with (
        tqdm(total=args.number, desc="descents", delay=2) as bar,
        tqdm(total=3 * n_splits, desc="scores", delay=2) as two,
    ):
        found = evaluate(
            model,
            model.representation,
            real,
            context=data.contexts("test"),
            n=args.number,
            seed=args.seed,
            name=type(model).__name__,
            n_splits=n_splits,
            progress=lambda n: bar.update(n) and None,
            score_progress=lambda n: two.update(n) and None,
        )
    found.write(args.out, figures=args.figures)
    if args.resamples is not None:
        with whole_file(args.out / "intervals.csv") as temporary:
            found.intervals(args.resamples, args.seed).write_csv(temporary)
    print(f"{len(real)} held-out flights ({seen} left out: the checkpoint was trained or validated on them)")
    print(found.rejections)
    print(found.scores)
    print(f"wrote {args.out / 'scores.csv'}{' and figures' if args.figures else ''}")
