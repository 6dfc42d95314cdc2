"""Run the paper's study on simulated flights, or on a store of real descents.

python scripts/paper_study.py OUT                             # thirteen types at the paper's counts: 116,066 flights
python scripts/paper_study.py OUT --share 0.05 --types A320,DH8D,BE20
python scripts/paper_study.py OUT --store descents.parquet --types A320
python scripts/paper_study.py OUT --sweeps variance gappy     # and the appendices' sweeps, of the same study
python scripts/paper_study.py OUT --recipe paper              # split, fPCA, mixtures and flow as the paper has them
python scripts/paper_study.py OUT --workers 2                 # two processes; or --engine dask --scheduler tcp://...

A killed run goes on where it stopped when it is started again with the same settings, on any engine.
"""

import argparse
import sys
import time
from pathlib import Path

from descentflow.cli.ending import ended_in_order

with ended_in_order("paper_study"):  # while the large libraries are loaded, too
    import polars as pl

    from descentflow.aircraft_types.registry import aircraft
    from descentflow.core.errors import DescentflowError
    from descentflow.core.workers import Engine, engine_of
    from descentflow.simulation.scenarios import scenario_settings
    from studies.paper.study_plan import MODELS, PAPER_FLIGHTS, RECIPES, StudyPlan, begin, paper_plan
    from studies.paper.study_report import write_report
    from studies.paper.study_run import costs, run_study
    from studies.paper.sweeps import NAMES, SweepPlan, run_sweeps
    from studies.process_engine import processes

_SPENT = (pl.col("cpu_s").sum(), pl.col("peak_mb").max())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path, help="folder of the study")
    parser.add_argument("--share", type=float, default=1.0, help="of the paper's flights (default: all)")
    parser.add_argument("--types", default=",".join(PAPER_FLIGHTS), help="type designators (default: all thirteen)")
    parser.add_argument("--models", help=f"default: all of the recipe ({','.join(MODELS)})")
    parser.add_argument(
        "--recipe", choices=list(RECIPES), default="own", help="how they are fitted: ours, or as the paper does"
    )
    parser.add_argument("--samples", type=int, default=10_000, help="of each model (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--store", type=Path, help="prepared descents in place of simulated flights")
    parser.add_argument("--max-epochs", type=int, help="bound on the epochs of every fit")
    parser.add_argument("--scenario", default="london-fir-2019", help="of the simulated flights (default: %(default)s)")
    parser.add_argument("--published", type=Path, help="folder of the paper's figures as CSV, for columns")
    parser.add_argument(
        "--sweeps",
        nargs="*",
        metavar="SWEEP",
        help="after the study: variance, gappy, flow (appendices B, A and C; all three if none is named)",
    )
    parser.add_argument("--sweep-flights", type=int, default=4_000, help="most training flights (default: %(default)s)")
    parser.add_argument("--engine", choices=["local", "dask"], default="local", help="processes here, or Dask workers")
    parser.add_argument(
        "--workers", type=int, default=1, help="processes, or Dask workers on this machine (default: 1)"
    )
    parser.add_argument(
        "--scheduler", help="of Dask: address, or file (.json); workers must see OUT under the same name"
    )
    args = parser.parse_args()
    settings = {
        "models": tuple(args.models.split(",") if args.models else RECIPES[args.recipe].models),
        "recipe": args.recipe,
        "seed": args.seed,
        "n_samples": args.samples,
        "max_epochs": args.max_epochs,
        "scenario": str(Path(args.scenario).resolve()) if Path(args.scenario).is_file() else args.scenario,
    }
    plan = _of_store(args, settings) if args.store else paper_plan(args.share, args.types.split(","), **settings)
    for typecode in plan.flights if plan.store is None else ():
        scenario_settings(plan.scenario, aircraft(typecode))  # better refused now than when the type's turn comes
    begin(plan, args.out)
    start, terminal = time.monotonic(), sys.stdout

    def say(what: str) -> None:
        print(f"[{time.monotonic() - start:6.0f} s] {what}", file=terminal, flush=True)

    engine = _engine(args)
    run_study(plan, args.out, engine, say)
    for stage, cpu_s, peak_mb in costs(args.out).group_by("stage", maintain_order=True).agg(*_SPENT).iter_rows():
        say(f"{stage}: {cpu_s:.0f} s of processor time, at most {peak_mb:.0f} MB in one process")
    if args.sweeps is not None:
        sweep = SweepPlan(flights=args.sweep_flights, max_epochs=args.max_epochs)
        run_sweeps(plan, sweep, args.out, tuple(args.sweeps) or NAMES, engine, say)
    say(f"wrote {write_report(plan, args.out, args.published)}")


def _engine(args: argparse.Namespace) -> Engine:
    if args.engine == "local" and args.scheduler is None:
        return processes(args.workers)
    return engine_of(args.scheduler or "dask", args.workers)


def _of_store(args: argparse.Namespace, settings: dict[str, object]) -> StudyPlan:
    from descentflow.surveillance.descents.prepared_descents import read_descents

    frame = read_descents(args.store).frame
    counts = dict(frame.group_by("typecode").agg(pl.col("flight_id").n_unique()).iter_rows())
    chosen = {name: counts.get(name, 0) for name in args.types.split(",") if counts.get(name, 0)}
    return StudyPlan(chosen, store=str(args.store.resolve()), **settings)


if __name__ == "__main__":
    try:
        with ended_in_order("paper_study"):
            main()
    except DescentflowError as error:
        sys.exit(f"error: {error}")
