"""The study of one type, in steps that each leave one file: a step whose file is there is not done again.

Every step is a few calls of the functions that the front door offers: simulate, prepare, fit, evaluate.
"""

import json
import shutil
from dataclasses import asdict
from pathlib import Path

import polars as pl

from descentflow.core.files import write_whole
from descentflow.core.tabular import write_table
from descentflow.surveillance.descents.prepared_descents import Descents, read_descents, write_descents
from studies.paper.job_log import logged_to
from studies.paper.study_plan import RECIPES, StudyPlan

BLOCK = 4_000
"""Flights simulated at a time: their rows and truth are some 300 MB."""
RESAMPLES = 50
"""Of the held-out flights, behind each score's interval."""
UNUSED = ("TAS", "groundspeed", "track", "heading", "geoaltitude", "latitude", "longitude")
"""Columns that the study does not look at: a third of the memory of every later job."""


def make_descents(plan: StudyPlan, typecode: str, folder: Path) -> None:
    """Leave ``descents.parquet`` of one type: from the store, or simulated block by block and prepared.

    Args:
        plan: The study.
        typecode: One of its types.
        folder: The type's folder; blocks that are there already are not simulated again.

    Raises:
        DescentflowError: If the flights cannot be simulated or prepared.

    Example:
        >>> make_descents(StudyPlan({"A320": 120}, store="descents.parquet"), "A320", Path("study_descents"))
        >>> "TAS" in read_descents("study_descents/descents.parquet").frame.columns
        False
    """
    folder.mkdir(parents=True, exist_ok=True)
    if plan.store is not None:
        source = read_descents(plan.store)
        chosen = Descents(source.frame.filter(typecode=typecode), source.metadata)
        _write_slim(chosen, folder / "descents.parquet")
        return
    rows, prepared = folder / "rows", folder / "prepared.parquet"
    rows.mkdir(exist_ok=True)
    for number, first in enumerate(range(0, plan.flights[typecode], BLOCK)):
        path = rows / f"{number:03d}.parquet"
        if not path.exists():
            _simulate(plan, typecode, number, min(BLOCK, plan.flights[typecode] - first), path)
    _write_slim(_prepared(rows, prepared, folder), folder / "descents.parquet")
    # The rows can be simulated again; at the paper's counts they take gigabytes.
    shutil.rmtree(rows)
    prepared.unlink()


def fit_and_score(plan: StudyPlan, name: str, folder: Path) -> None:
    """Leave ``model.ckpt`` of one model, its scores and, last, ``done`` in a folder of its own.

    The first of the plan's models fits split, components and bounds; the others take them from its checkpoint.

    Args:
        plan: The study.
        name: One of its models.
        folder: The type's folder, with its descents.

    Raises:
        DescentflowError: If the model cannot be fitted, or too few of its draws are plausible.

    Example:
        >>> plan, folder = StudyPlan({"A320": 120}, models=("gaussian",), n_samples=200), Path("study_model")
        >>> (folder / "gaussian").mkdir(parents=True)
        >>> _ = shutil.copy("descents.parquet", folder), shutil.copy("best.ckpt", folder / "gaussian" / "model.ckpt")
        >>> fit_and_score(plan, "gaussian", folder)  # fitted already: only the scores are left
        >>> sorted(path.name for path in (folder / "gaussian").glob("*.csv"))
        ['classifier.csv', 'intervals.csv', 'level_flight.csv', 'scores.csv']
    """
    from descentflow.evaluation.evaluate import evaluate
    from studies.paper.score_intervals import score_intervals

    model, descents = folder / name, folder / "descents.parquet"
    model.mkdir(exist_ok=True)
    if not (model / "model.ckpt").exists():
        first = folder / plan.models[0] / "model.ckpt"
        _fit(plan, name, descents, model, None if name == plan.models[0] else first)
    with logged_to(model / "scores.log"):
        scored = evaluate(model / "model.ckpt", descents, n=plan.n_samples, seed=plan.seed)
        scored.write(model, figures=False)
        transition_fl = scored.representation.decoder.transition_fl
        intervals = score_intervals(scored.scores, scored.samples, scored.real, transition_fl, plan.seed, RESAMPLES)
        write_table(pl.DataFrame([asdict(each) for each in intervals]).fill_nan(None), model / "intervals.csv")
        print(scored)
    (model / "done").touch()


def draw_type(plan: StudyPlan, typecode: str, folder: Path) -> None:
    """Leave the figures of one type, see :func:`studies.paper.type_figures.write_type_figures`.

    Args:
        plan: The study.
        typecode: One of its types.
        folder: The type's folder, with its descents and a checkpoint of every model.

    Raises:
        DescentflowError: If a checkpoint cannot be used, or too few of its draws are plausible.

    Example:
        >>> Path("study_figures").mkdir()
        >>> draw_type(StudyPlan({"A320": 120}), "A320", Path("study_figures"))  # no model is fitted yet
        Traceback (most recent call last):
            ...
        descentflow.core.errors.CheckpointError: ...study_figures/gaussian/model.ckpt...
    """
    from studies.paper.type_figures import write_type_figures

    with logged_to(folder / "figures.log"):
        write_type_figures(plan, folder, typecode)


def _simulate(plan: StudyPlan, typecode: str, block: int, number: int, path: Path) -> None:
    from descentflow.simulation.world import simulate

    # A seed for each block, so that flights have names of their own and a block can be made again alone.
    world = simulate(typecode, number, 1000 * plan.seed + block, plan.scenario)
    write_table(world.rows, path)


def _prepared(rows: Path, out: Path, folder: Path) -> Descents:
    from descentflow.surveillance.prepare import prepare

    with logged_to(folder / "prepare.log"):
        descents = prepare(rows, out=out)
        print(descents.report)
    write_whole(folder / "prepare.json", json.dumps(descents.metadata, indent=1))
    return descents


def _write_slim(descents: Descents, path: Path) -> None:
    frame: pl.DataFrame = descents.frame.drop(UNUSED, strict=False)
    write_descents(Descents(frame, descents.metadata), path)


def _fit(plan: StudyPlan, name: str, descents: Path, folder: Path, first: Path | None) -> None:
    from descentflow.training.fit import fit

    out, epochs, recipe = folder / "model.ckpt", plan.max_epochs, RECIPES[plan.recipe]
    # The study scores flights that no fit has seen: there is nothing to fit to all.
    options = {"seed": plan.seed, "max_epochs": epochs, "final": False, "checkpoint": first, **recipe.data}
    with logged_to(folder / "fit.log"):
        # The checkpoint of the first model brings split, components and bounds.
        print(fit(descents, recipe.models[name], out=out, **options))  # type: ignore[arg-type]
