"""Sweeps next to a study: explained variance, gappy reconstruction, flow sizes (paper, appendices B, A and C).

They look at training flights of a finished study alone, at most so many of a type, and leave one file per job: a killed
sweep goes on with the files that are missing.
"""

import json
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import polars as pl
import torch

from descentflow.core.errors import ConfigError
from descentflow.core.files import write_whole
from descentflow.core.tabular import write_table
from descentflow.core.threads import one_thread
from descentflow.core.workers import Engine
from descentflow.reporting.figure_file import write_figure
from studies.paper.job_log import logged_to
from studies.paper.study_plan import StudyPlan, begin

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from torch import Tensor

    from descentflow.representation.profiles import Profiles

NAMES = ("variance", "gappy", "flow")
"""Appendix B, A and C."""
SHOWN = 5
"""Gappy flights in the figure, as in the paper's."""
COMPLETED = ("probabilistic PCA", "iteration (paper)")
"""Methods in that figure."""
PAPER_SIZE = (5, 2)
"""Flows, and hidden units per weight, that the paper settled on."""


@dataclass(frozen=True)
class SweepPlan:
    """All that decides the sweeps' results, next to the study's plan.

    Attributes:
        flights: Most training flights of a type.
        shares: Shares of variance to be explained.
        folds: Folds of the cross-validation.
        flows: Numbers of flows.
        hidden: Hidden units per weight.
        max_epochs: Bound on the epochs of every flow; its config's own if absent.

    Example:
        >>> plan = SweepPlan(flows=(5,), hidden=(1, 2))
        >>> len(_jobs_of("flow", "A320", plan)), len(_jobs_of("variance", "A320", plan))
        (2, 5)
    """

    flights: int = 4_000
    shares: tuple[float, ...] = (0.5, 0.6, 0.7, 0.75, 0.8, 0.85, 0.9, 0.95, 0.99)
    folds: int = 5
    flows: tuple[int, ...] = (2, 5, 8)
    hidden: tuple[int, ...] = (1, 2, 4)
    max_epochs: int | None = None


@dataclass(frozen=True)
class _SweepJob:
    """One file of a sweep: a fold of a type, a type, or a size of a type's flow."""

    sweep: str
    typecode: str
    fold: int = 0
    flows: int = 0
    hidden: int = 0

    def product(self, folder: Path) -> Path:
        """The file that the job leaves."""
        ending = {"variance": f"-{self.fold}.csv", "gappy": ".csv", "flow": f"-{self.flows}-{self.hidden}.json"}
        return folder / self.sweep / f"{self.typecode}{ending[self.sweep]}"


@dataclass(frozen=True)
class _Sweeps:
    """Inputs that all jobs share: the plans, the study's folder, and the sweeps' own within it."""

    study: StudyPlan
    sweep: SweepPlan
    folder: Path

    @property
    def own(self) -> Path:
        """The sweeps' folder."""
        return self.folder / "sweeps"

    def checkpoint(self, typecode: str) -> Path:
        """A checkpoint of the study, for its split and grid."""
        return self.folder / typecode / self.study.models[0] / "model.ckpt"


def run_sweeps(
    study: StudyPlan,
    sweep: SweepPlan,
    folder: Path,
    names: tuple[str, ...],
    engine: Engine,
    progress: Callable[[str], None],
) -> None:
    """Do what is missing of the sweeps of a finished study.

    Args:
        study: The study's plan.
        sweep: The sweeps' plan.
        folder: The study's folder.
        names: Some of :data:`NAMES`.
        engine: Who does the jobs.
        progress: Progress callback, called with a line of text.

    Raises:
        ConfigError: If a name is not among them, or the folder holds sweeps of another plan.

    Example:
        >>> from studies.process_engine import processes
        >>> run_sweeps(StudyPlan({"A320": 120}), SweepPlan(), Path("."), ("depth",), processes(1), print)
        Traceback (most recent call last):
            ...
        descentflow.core.errors.ConfigError: sweeps depth...
    """
    unknown = sorted(set(names) - set(NAMES))
    if unknown:
        raise ConfigError(f"sweeps {', '.join(unknown)}", expected=f"some of {', '.join(NAMES)}", mend="name others")
    common = _Sweeps(study, sweep, folder.resolve())
    begin(sweep, common.own)
    for typecode in study.flights:
        _training_flights(common, typecode)
    for name in names:
        jobs = [job for typecode in study.flights for job in _jobs_of(name, typecode, sweep)]
        missing = [job for job in jobs if not job.product(common.own).exists()]
        if missing:
            (common.own / name).mkdir(exist_ok=True)
            for done, _ in enumerate(engine.run(_do_job, missing, common, progress), 1):
                progress(f"sweep {name}: {done} of {len(missing)} done ({len(jobs) - len(missing)} were there)")


def _jobs_of(name: str, typecode: str, sweep: SweepPlan) -> list[_SweepJob]:
    """Jobs of one sweep and type."""
    if name == "variance":
        return [_SweepJob(name, typecode, fold=fold) for fold in range(sweep.folds)]
    if name == "flow":
        return [_SweepJob(name, typecode, flows=n, hidden=h) for n in sweep.flows for h in sweep.hidden]
    return [_SweepJob(name, typecode)]


def _do_job(job: _SweepJob, common: _Sweeps) -> None:
    """Do one job, with one thread; its output goes into a log next to its file."""
    with one_thread(), logged_to(job.product(common.own).with_suffix(".log")):
        {"variance": _variance, "gappy": _gappy, "flow": _flow}[job.sweep](job, common)


def _training_flights(common: _Sweeps, typecode: str) -> None:
    """Leave the descents of the type's training flights, at most so many, picked at random."""
    from descentflow.densities.checkpoint import load_model
    from descentflow.surveillance.descents.prepared_descents import read_descents, write_descents

    path = common.own / f"{typecode}.parquet"
    if path.exists():
        return
    train = load_model(common.checkpoint(typecode)).held_out_fit.representation.split.train
    order = torch.randperm(len(train), generator=torch.Generator().manual_seed(common.study.seed)).tolist()
    chosen = [train[k] for k in order[: common.sweep.flights]]
    source = read_descents(common.folder / typecode / "descents.parquet")
    write_descents(type(source)(source.frame.filter(pl.col("flight_id").is_in(chosen)), source.metadata), path)


def _variance(job: _SweepJob, common: _Sweeps) -> None:
    from descentflow.training.datamodule import DescentDataModule
    from studies.paper.variance import fold_scores

    data = DescentDataModule(common.own / f"{job.typecode}.parquet", checkpoint=common.checkpoint(job.typecode))
    data.setup()
    decoder = data.representation.decoder
    scores = fold_scores(
        data.profiles("train"),
        decoder.aircraft,
        decoder.transition_fl,
        job.fold,
        common.sweep.folds,
        common.sweep.shares,
    )
    write_table(scores, job.product(common.own))


def _gappy(job: _SweepJob, common: _Sweeps) -> None:
    from descentflow.core.units import KT_MPS
    from descentflow.training.datamodule import DescentDataModule
    from studies.paper.hidden_levels import PATTERNS, hidden_errors

    data = DescentDataModule(common.own / f"{job.typecode}.parquet", checkpoint=common.checkpoint(job.typecode))
    data.setup()
    real = data.profiles("train")
    curves = {"drag (kN)": real.drag_n / 1000, "CAS (kt)": real.cas_mps / KT_MPS}
    speed = (real.cas_mps * real.mask).sum(1) / real.mask.sum(1)
    rows = [
        {"quantity": name, **asdict(error)}
        for name, values in curves.items()
        for pattern in PATTERNS
        for error in hidden_errors(values, real.mask, pattern, speed=speed)
    ]
    write_figure(_completed(real, curves), job.product(common.own).with_suffix(".png"), 100)
    write_table(pl.DataFrame(rows), job.product(common.own))


def _completed(real: "Profiles", curves: "dict[str, Tensor]") -> "Figure":
    """A few flights that lack much, and what two methods make of the rest (paper, appendix A's figure)."""
    from studies.paper.figures.sweep_curves import completed_figure
    from studies.paper.hidden_levels import complete

    share = real.mask.double().mean(1)
    gappy = ((share > 0.3) & (share < 0.75)).nonzero()[:, 0][:SHOWN]
    whole = {
        name: {method: complete(method, values, real.mask)[gappy] for method in COMPLETED}
        for name, values in curves.items()
    }
    seen = {name: (values[gappy], real.mask[gappy]) for name, values in curves.items()}
    return completed_figure(real.levels_fl, seen, whole)


def _flow(job: _SweepJob, common: _Sweeps) -> None:
    """Fit a flow of one size, and keep its likelihood alone."""
    from descentflow.densities.checkpoint import load_model
    from descentflow.training.datamodule import DescentDataModule
    from descentflow.training.fit import fit
    from descentflow.training.training_settings import training_settings

    settings = training_settings("flow")
    sized = replace(settings, model={**settings.model, "n_flows": job.flows, "hidden_per_weight": job.hidden})
    descents, checkpoint = common.own / f"{job.typecode}.parquet", job.product(common.own).with_suffix(".ckpt")
    seed, epochs = common.study.seed, common.sweep.max_epochs
    print(fit(descents, sized.new_model(), out=checkpoint, seed=seed, max_epochs=epochs, final=False))
    data = DescentDataModule(descents, checkpoint=checkpoint)
    data.setup()
    model = load_model(checkpoint)
    with torch.no_grad():
        nll = -model.log_observed(data.evidence("test")).double()
    result = {"flows": job.flows, "hidden": job.hidden, "nll": float(nll.mean()), "n": len(nll)}
    result |= {"error": float(nll.std() / len(nll) ** 0.5), "parameters": sum(p.numel() for p in model.parameters())}
    write_whole(job.product(common.own), json.dumps(result))
    checkpoint.unlink()
