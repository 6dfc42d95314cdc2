"""Figures of one type that show all models together, and their NLL on the held-out flights."""

import json
from pathlib import Path

import polars as pl
import torch

from descentflow.core.files import write_whole
from descentflow.core.tabular import write_table
from descentflow.densities.checkpoint import load_model
from descentflow.evaluation.figures.level_cuts import cuts_figure
from descentflow.evaluation.figures.profile_bands import profiles_figure
from descentflow.evaluation.metrics.descent_set import DescentSet
from descentflow.generation.rejection import sample_descents
from descentflow.physics.nominal_descent import nominal_descent
from descentflow.reporting.figure_file import write_figure
from descentflow.representation.representation import Representation
from descentflow.training.datamodule import DescentDataModule
from studies.paper.figures.mass_range import mass_range, mass_range_figure
from studies.paper.study_plan import LAST, MODELS, StudyPlan

DRAWN = 2_000
"""Samples behind a figure; the scores' own are more, and not kept."""


def write_type_figures(plan: StudyPlan, folder: Path, typecode: str) -> None:
    """Write a type's figures, the models' likelihoods, and what is known of the flights.

    ``nll.csv`` has the columns ``model nll error n`` (nats, standard error, flights); ``flights.json``, which is
    written last, has the part that BADA's mass explains of the held-out flights.

    Args:
        plan: The study.
        folder: The type's folder, with a checkpoint of every model.
        typecode: For titles.

    Raises:
        DescentflowError: If a checkpoint cannot be used, or too few of its draws are plausible.

    Example:
        >>> plan, folder = StudyPlan({"A320": 120}, models=("gaussian",), n_samples=100), Path("study_type")
        >>> (folder / "gaussian").mkdir(parents=True)
        >>> for source, name in (("descents.parquet", "descents.parquet"), ("best.ckpt", "gaussian/model.ckpt")):
        ...     _ = (folder / name).write_bytes(Path(source).read_bytes())
        >>> write_type_figures(plan, folder, "A320")
        >>> json.loads((folder / LAST).read_text())["prepared"]
        120
    """
    checkpoints = {name: folder / name / "model.ckpt" for name in plan.models}
    data = DescentDataModule(folder / "descents.parquet", checkpoint=next(iter(checkpoints.values())))
    data.setup()
    held_out = data.profiles("test")
    real, evidence = DescentSet.of_profiles(held_out), data.evidence("test")
    samples, likelihoods = {}, []
    for name, path in checkpoints.items():
        model = load_model(path)
        parts = model.representation
        n = min(DRAWN, plan.n_samples)
        drawn = sample_descents(model, parts, n, plan.seed, entry=held_out.entry_level)
        samples[MODELS[name]] = DescentSet.of_trajectories(drawn.trajectories)
        with torch.no_grad():
            nll = -model.log_observed(evidence).double()
        likelihoods.append((name, float(nll.mean()), float(nll.std() / len(nll) ** 0.5), len(nll)))
    decoder = data.representation.decoder
    nominal = DescentSet.of_nominal(nominal_descent(decoder.aircraft, real.levels_fl))
    figures = {
        "mass_range": mass_range_figure(real, decoder.aircraft, title=typecode),
        "profiles": profiles_figure(real, samples, nominal, title=typecode),
        "cuts": cuts_figure(real, samples, nominal, _cut_level_fl(real, decoder.transition_fl), title=typecode),
    }
    for name, figure in figures.items():
        write_figure(figure, folder / f"{name}.png", 100)
    write_table(pl.DataFrame(likelihoods, schema=["model", "nll", "error", "n"], orient="row"), folder / "nll.csv")
    write_whole(folder / LAST, json.dumps(_facts(real, data.representation), indent=1))


def _facts(real: DescentSet, parts: Representation) -> dict[str, object]:
    by_mass = mass_range(real, parts.decoder.aircraft)
    quantiles = torch.tensor([0.05, 0.5, 0.95], dtype=by_mass.time_s.dtype)
    return {
        "prepared": sum(len(ids) for ids in parts.split.to_state().values()),
        "bottom_fl": int(real.levels_fl[0]),
        "top_fl": int(real.levels_fl[-1]),
        "spanning": float(real.spans_grid().double().mean()),
        "from_fl": int(by_mass.levels_fl[-1]),
        "time_s": by_mass.time_s[:, 0].quantile(quantiles).tolist(),
        "bada_s": float(by_mass.reference_time_s[0]),
        "bada_range_s": list(by_mass.range_s),
        "explained": by_mass.explained,
    }


def _cut_level_fl(real: DescentSet, transition_fl: float) -> float:
    """The transition, as in the paper's figures 8 and 9; the middle of the grid where the grid has none."""
    levels = real.levels_fl
    inside = float(levels[0]) < transition_fl < float(levels[-1])
    return transition_fl if inside else float(levels[len(levels) // 2])
