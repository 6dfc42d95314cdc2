"""Run the paper's study on simulated flights, or on a store of real descents.

python scripts/paper_study.py OUT                             # thirteen types at the paper's counts: 116,066 flights
python scripts/paper_study.py OUT --share 0.05 --types A320,DH8D,BE20
python scripts/paper_study.py OUT --store descents.parquet --types A320

A killed run goes on where it stopped when it is started again with the same settings.
"""

import argparse
import time
from pathlib import Path

import polars as pl

from descentflow.study.plan import MODELS, PAPER_FLIGHTS, StudyPlan, begin, paper_plan
from descentflow.study.report import write_report
from descentflow.study.steps import study_type


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path, help="folder of the study")
    parser.add_argument("--share", type=float, default=1.0, help="of the paper's flights (default: all)")
    parser.add_argument("--types", default=",".join(PAPER_FLIGHTS), help="type designators (default: all thirteen)")
    parser.add_argument("--models", default=",".join(MODELS), help="default: %(default)s")
    parser.add_argument("--samples", type=int, default=10_000, help="of each model (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--store", type=Path, help="prepared descents in place of simulated flights")
    parser.add_argument("--max-epochs", type=int, help="bound on the epochs of every fit")
    parser.add_argument("--published", type=Path, help="CSV of the paper's scores, for columns of their own")
    args = parser.parse_args()
    settings = {
        "models": tuple(args.models.split(",")),
        "seed": args.seed,
        "n_samples": args.samples,
        "max_epochs": args.max_epochs,
    }
    plan = _of_store(args, settings) if args.store else paper_plan(args.share, args.types.split(","), **settings)
    begin(plan, args.out)
    start = time.monotonic()

    def say(what: str) -> None:
        print(f"[{time.monotonic() - start:6.0f} s] {what}", flush=True)

    for typecode in plan.flights:
        study_type(plan, typecode, args.out / typecode, say)
    say(f"wrote {write_report(plan, args.out, args.published)}")


def _of_store(args: argparse.Namespace, settings: dict[str, object]) -> StudyPlan:
    from descentflow.surveillance.descents import read_descents

    frame = read_descents(args.store).frame
    counts = dict(frame.group_by("typecode").agg(pl.col("flight_id").n_unique()).iter_rows())
    chosen = {name: counts.get(name, 0) for name in args.types.split(",") if counts.get(name, 0)}
    return StudyPlan(chosen, store=str(args.store), **settings)


if __name__ == "__main__":
    main()
