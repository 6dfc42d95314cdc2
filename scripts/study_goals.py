"""Judge a finished study by its goals: how far samples are from held-out flights, over all types.

python scripts/paper_study.py OUT --models gmm --workers 2
python scripts/study_goals.py OUT --model gmm --workers 2   # resumable; writes OUT/goals_gmm.csv and OUT/types_gmm.csv

Distances over their noise floor and the classifier's AUC are the study's; the spread at the top and the intervals in
flight are measured here (scripts/studies/paper/fidelity_measures.py), a type after the other.
"""

import argparse
from pathlib import Path

import polars as pl

from descentflow.core.tabular import write_table
from descentflow.core.threads import one_thread
from studies.paper.fidelity_goals import judged, of_types
from studies.paper.fidelity_measures import measure
from studies.paper.study_plan import StudyPlan, begun
from studies.process_engine import processes


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("study", type=Path, help="folder of a finished study")
    parser.add_argument("--model", default="gmm", help="which of its models (default: gmm)")
    parser.add_argument("--workers", type=int, default=1)
    args = parser.parse_args()
    plan = begun(args.study)
    jobs = [name for name in plan.flights if not (args.study / name / args.model / "fidelity.json").exists()]
    engine = processes(args.workers)
    for done, _ in enumerate(engine.run(_measured, jobs, (plan, args.model, args.study.resolve())), 1):
        print(f"measured {done} of {len(jobs)} types", flush=True)
    types = of_types(plan, args.model, args.study)
    goals = judged(types)
    for name, frame in (("types", types), ("goals", goals)):
        write_table(frame, args.study / f"{name}_{args.model}.csv")
    with pl.Config(tbl_rows=-1, tbl_cols=-1, fmt_str_lengths=40, float_precision=3, tbl_hide_dataframe_shape=True):
        print(goals)


def _measured(typecode: str, about: tuple[StudyPlan, str, Path]) -> None:
    plan, model, folder = about
    with one_thread():
        measure(plan, model, folder / typecode)


if __name__ == "__main__":
    main()
