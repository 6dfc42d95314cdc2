"""A whole study on any engine: descents of each type, then fits and scores of each model, then the figures."""

import json
import resource
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import polars as pl

from descentflow.core.files import write_whole
from descentflow.core.threads import one_thread
from descentflow.core.workers import Engine
from studies.paper.steps import draw_type, fit_and_score, make_descents
from studies.paper.study_plan import LAST, StudyPlan

Progress = Callable[[str], None]


@dataclass(frozen=True)
class _Job:
    """One thing to be done for a type; with a model, its fit and scores."""

    typecode: str
    model: str | None = None

    def __str__(self) -> str:
        """For progress."""
        return self.typecode if self.model is None else f"{self.typecode} {self.model}"


@dataclass(frozen=True)
class _Place:
    """Inputs that all jobs share: the plan, and the study's folder, which all workers see under one name."""

    plan: StudyPlan
    folder: Path

    def of(self, job: _Job) -> Path:
        """Folder of the job's type."""
        return self.folder / job.typecode


def run_study(plan: StudyPlan, folder: Path, engine: Engine, progress: Progress) -> None:
    """Do what is missing of a study, in stages of jobs that do not need each other.

    Results do not depend on the engine (every job keeps to one thread: a sum's last bits depend on their number), and a
    rerun after a break goes on with the files that are missing.

    Args:
        plan: The study, already begun in the folder.
        folder: The study's folder.
        engine: Who does the jobs.
        progress: Progress callback, called with a line of text on what has been done.

    Raises:
        DescentflowError: If a step fails; its log in the type's folder has the message too.

    Example:
        >>> from studies.process_engine import processes
        >>> plan, folder = StudyPlan({"A320": 120}, models=("gaussian",), store="descents.parquet"), Path("study_run")
        >>> (folder / "A320" / "gaussian").mkdir(parents=True)
        >>> for name in ("gaussian/done", LAST):  # as if a run had left all but the descents
        ...     (folder / "A320" / name).touch()
        >>> run_study(plan, folder, processes(1), print)
        descents: 1 of 1 done (0 were there); last A320
    """
    place = _Place(plan, folder.resolve())
    # The largest first: a worker that ends with it would keep the others waiting.
    types = sorted(plan.flights, key=lambda name: -plan.flights[name])
    every_type = [_Job(name) for name in types]
    first = [_Job(name, plan.models[0]) for name in types]
    others = [_Job(name, model) for model in reversed(plan.models[1:]) for name in types]
    stages: Sequence[tuple[str, Callable[[_Job, _Place], None], list[_Job], Callable[[_Job], Path]]] = (
        ("descents", _descents, every_type, lambda job: place.of(job) / "descents.parquet"),
        ("first model", _model, first, lambda job: place.of(job) / str(job.model) / "done"),
        ("other models", _model, others, lambda job: place.of(job) / str(job.model) / "done"),
        ("figures", _figures, every_type, lambda job: place.of(job) / LAST),
    )
    for name, work, jobs, product in stages:
        missing = [job for job in jobs if not product(job).exists()]
        if not missing:
            continue
        for done, _ in enumerate(engine.run(work, missing, place, progress), 1):
            finished = [job for job in missing if product(job).exists()]
            progress(
                f"{name}: {done} of {len(missing)} done ({len(jobs) - len(missing)} were there); last {finished[-1]}"
            )


def costs(folder: Path) -> pl.DataFrame:
    """Costs of a study's jobs: columns ``stage typecode model cpu_s wall_s peak_mb``, from `cost_*.json`.

    ``peak_mb`` is the largest memory that the job's process ever had, so that of the jobs before it as well.

    Example:
        >>> costs(Path("nothing_yet")).columns
        ['stage', 'typecode', 'model', 'cpu_s', 'wall_s', 'peak_mb']
    """
    costs_of = [json.loads(path.read_text()) for path in sorted(folder.glob("*/cost_*.json"))]
    return pl.DataFrame(costs_of, schema={"stage": pl.String, "typecode": pl.String, "model": pl.String, **_NUMBERS})


_NUMBERS = dict.fromkeys(("cpu_s", "wall_s", "peak_mb"), pl.Float64)


def _descents(job: _Job, place: _Place) -> None:
    with _accounted("descents", job, place):
        make_descents(place.plan, job.typecode, place.of(job))


def _model(job: _Job, place: _Place) -> None:
    with _accounted("models", job, place):
        fit_and_score(place.plan, str(job.model), place.of(job))


def _figures(job: _Job, place: _Place) -> None:
    with _accounted("figures", job, place):
        draw_type(place.plan, job.typecode, place.of(job))


@contextmanager
def _accounted(stage: str, job: _Job, place: _Place) -> Iterator[None]:
    """Work with one thread, and leave what it cost next to the job's files."""
    cpu, wall = time.process_time(), time.monotonic()
    with one_thread():
        yield
    spent = {"cpu_s": time.process_time() - cpu, "wall_s": time.monotonic() - wall}
    spent["peak_mb"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    about = {"stage": stage, "typecode": job.typecode, "model": job.model}
    name = f"cost_{stage}{'' if job.model is None else f'_{job.model}'}.json"
    write_whole(place.of(job) / name, json.dumps({**about, **spent}))
