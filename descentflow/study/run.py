"""A whole study on any engine: descents of each type, then fits and scores of each model, then the figures."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from descentflow.engine import Engine
from descentflow.study.plan import StudyPlan
from descentflow.study.steps import LAST, draw_type, fit_and_score, make_descents
from descentflow.world.flight import one_thread

Say = Callable[[str], None]


@dataclass(frozen=True)
class Job:
    """One thing to be done for a type; with a model, its fit and scores."""

    typecode: str
    model: str | None = None

    def __str__(self) -> str:
        """For progress."""
        return self.typecode if self.model is None else f"{self.typecode} {self.model}"


@dataclass(frozen=True)
class Place:
    """What all jobs share: the plan, and the study's folder, which all workers see under one name."""

    plan: StudyPlan
    folder: Path

    def of(self, job: Job) -> Path:
        """Folder of the job's type."""
        return self.folder / job.typecode


def run_study(plan: StudyPlan, folder: Path, engine: Engine, say: Say) -> None:
    """Do what is missing of a study, in three stages of jobs that do not need each other.

    Results do not depend on the engine (every job keeps to one thread: a sum's last bits depend on their number), and a
    rerun after a break goes on with the files that are missing.

    Args:
        plan: The study, already begun in the folder.
        folder: The study's folder.
        engine: Who does the jobs.
        say: Called with what has been done.

    Raises:
        DescentflowError: If a command fails; the message names its log.

    Example:
        >>> run_study(plan, folder, ProcessEngine(2), print)
    """
    place = Place(plan, folder.resolve())
    # The largest first: a worker that ends with it would keep the others waiting.
    types = sorted(plan.flights, key=lambda name: -plan.flights[name])
    every_type = [Job(name) for name in types]
    every_model = [Job(name, model) for model in reversed(plan.models) for name in types]
    stages: Sequence[tuple[str, Callable[[Job, Place], None], list[Job], Callable[[Job], Path]]] = (
        ("descents", _descents, every_type, lambda job: place.of(job) / "descents.parquet"),
        ("models", _model, every_model, lambda job: place.of(job) / str(job.model) / "done"),
        ("figures", _figures, every_type, lambda job: place.of(job) / LAST),
    )
    for name, work, jobs, product in stages:
        missing = [job for job in jobs if not product(job).exists()]
        if not missing:
            continue
        for done, _ in enumerate(engine.run(work, missing, place), 1):
            finished = [job for job in missing if product(job).exists()]
            say(f"{name}: {done} of {len(missing)} done ({len(jobs) - len(missing)} were there); last {finished[-1]}")


def _descents(job: Job, place: Place) -> None:
    with one_thread():
        make_descents(place.plan, job.typecode, place.of(job))


def _model(job: Job, place: Place) -> None:
    with one_thread():
        fit_and_score(place.plan, str(job.model), place.of(job))


def _figures(job: Job, place: Place) -> None:
    with one_thread():
        draw_type(place.plan, job.typecode, place.of(job))
