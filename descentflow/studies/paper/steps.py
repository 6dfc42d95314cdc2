"""The study of one type, in steps that each leave one file: a step whose file is there is not done again."""

import logging
import shutil
import sys
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from pathlib import Path
from typing import TextIO

import polars as pl

from descentflow.cli import entry as cli
from descentflow.configs.packaged_config import config_file
from descentflow.core.errors import DescentflowError
from descentflow.core.files import whole_file
from descentflow.studies.paper.study_plan import StudyPlan
from descentflow.surveillance.descents.prepared_descents import read_descents, write_descents

BLOCK = 4_000
"""Flights simulated at a time: their rows and truth are some 300 MB."""
RESAMPLES = 50
"""Of the held-out flights, behind each score's interval."""
LAST = "flights.json"
"""What :func:`~descentflow.studies.paper.pictures.type_pictures` writes last: where it is, the pictures are done."""
CSV_LOGGER = ("--trainer.logger", "lightning.pytorch.loggers.CSVLogger", "--trainer.logger.init_args.save_dir")
"""In place of TensorBoard, for which every fit draws figures that nobody would look at; the folder follows."""


def make_descents(plan: StudyPlan, typecode: str, folder: Path) -> None:
    """Leave ``descents.parquet`` of one type: from the store, or simulated block by block and prepared.

    Args:
        plan: The study.
        typecode: One of its types.
        folder: The type's folder; blocks that are there already are not simulated again.

    Raises:
        DescentflowError: If `prepare` fails; the message names its log.
    """
    folder.mkdir(parents=True, exist_ok=True)
    if plan.store is not None:
        source = read_descents(plan.store)
        chosen = type(source)(_slim(source.frame.filter(typecode=typecode)), source.metadata)
        write_descents(chosen, folder / "descents.parquet")
        return
    rows, prepared = folder / "rows", folder / "prepared.parquet"
    rows.mkdir(exist_ok=True)
    for number, first in enumerate(range(0, plan.flights[typecode], BLOCK)):
        path = rows / f"{number:03d}.parquet"
        if not path.exists():
            _simulate(plan, typecode, number, min(BLOCK, plan.flights[typecode] - first), path)
    words = ["prepare", str(rows), "--out", str(prepared)]
    command([*words, "--report", str(folder / "prepare.json")], folder / "prepare.log")
    whole = read_descents(prepared)
    write_descents(type(whole)(_slim(whole.frame), whole.metadata), folder / "descents.parquet")
    # The rows can be simulated again; at the paper's counts they take gigabytes.
    shutil.rmtree(rows)
    prepared.unlink()


def _slim(frame: pl.DataFrame) -> pl.DataFrame:
    """Without what the study does not look at: a third of the memory of every later job."""
    return frame.drop("TAS", "groundspeed", "track", "heading", "geoaltitude", "latitude", "longitude", strict=False)


def fit_and_score(plan: StudyPlan, name: str, folder: Path) -> None:
    """Leave ``model.ckpt`` of one model, its scores and, last, ``done`` in a folder of its own.

    The first of the plan's models fits split, components and bounds; the others take them from its checkpoint.

    Args:
        plan: The study.
        name: One of its models.
        folder: The type's folder, with its descents.

    Raises:
        DescentflowError: If a command fails; the message names its log.
    """
    model, descents = folder / name, folder / "descents.parquet"
    model.mkdir(exist_ok=True)
    if not (model / "model.ckpt").exists():
        first = folder / plan.models[0] / "model.ckpt"
        _fit(plan, name, descents, model, None if name == plan.models[0] else first)
    words = ["evaluate", str(model / "model.ckpt"), "--real", str(descents), "--out", str(model), "--no-figures"]
    words += ["-n", str(plan.n_samples), "--seed", str(plan.seed), "--resamples", str(RESAMPLES)]
    command(words, model / "scores.log")
    (model / "done").touch()


def draw_type(plan: StudyPlan, typecode: str, folder: Path) -> None:
    """Leave the figures of one type, see :func:`descentflow.studies.paper.pictures.type_pictures`."""
    from descentflow.studies.paper.pictures import type_pictures

    with into(folder / "figures.log"):
        type_pictures(plan, folder, typecode)


def _simulate(plan: StudyPlan, typecode: str, block: int, number: int, path: Path) -> None:
    from descentflow.simulation.world import simulate

    # A seed for each block, so that flights have names of their own and a block can be made again alone.
    world = simulate(typecode, number, 1000 * plan.seed + block, plan.scenario)
    with whole_file(path) as temporary:
        world.rows.write_parquet(temporary)


def _fit(plan: StudyPlan, name: str, descents: Path, folder: Path, first: Path | None) -> None:
    runs = folder / "runs"
    # What a killed fit left would only be in the way: a fit of minutes starts again.
    shutil.rmtree(runs, ignore_errors=True)
    words = ["fit", "--config", str(config_file(name)), "--data.descents", str(descents)]
    words += ["--seed_everything", str(plan.seed), *CSV_LOGGER, str(runs)]
    words += ["--trainer.enable_progress_bar", "false", "--trainer.enable_model_summary", "false"]
    words += ["--scores.n_samples", "200"]
    if first is not None:
        words += ["--data.checkpoint", str(first)]
    if plan.max_epochs is not None:
        words += ["--trainer.max_epochs", str(plan.max_epochs)]
    command(words, folder / "fit.log")
    best = next(runs.rglob("best.ckpt"))
    with whole_file(folder / "model.ckpt") as temporary:
        shutil.copyfile(best, temporary)


def command(words: list[str], log: Path) -> None:
    """Run one of descentflow's commands, what it prints going into a log."""
    with into(log):
        status = cli.main(words)
    if status:
        last = log.read_text().strip().splitlines()[-1:] or ["nothing printed"]
        raise DescentflowError(
            f"descentflow {words[0]} ended with: {last[0]}", expected="a command that succeeds", mend=f"see {log}"
        )


@contextmanager
def into(log: Path) -> Iterator[None]:
    """Send what is printed into a log, and what Lightning logs, whose handlers keep the stream they were made with."""
    with log.open("w") as file, redirect_stdout(file), redirect_stderr(file):
        before = [(handler, handler.setStream(file)) for handler in _handlers()]
        try:
            yield
        finally:
            kept = dict(before)
            for handler in _handlers():
                # One that was made in here, as Lightning was imported, has no stream from before.
                stream = kept.get(handler) or sys.__stderr__
                if stream is not None:
                    handler.setStream(stream)


def _handlers() -> list[logging.StreamHandler[TextIO]]:
    loggers = [logging.getLogger(name) for name in ("lightning", "lightning.pytorch", "lightning.fabric")]
    return [h for logger in loggers for h in logger.handlers if isinstance(h, logging.StreamHandler)]
