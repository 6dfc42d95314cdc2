"""Fit a model from Python, as `descentflow fit` does from the command line.

Where no model is named, it is the density under which flights of aircraft that it was not fitted to are most probable.
All kinds of density share the components of the training flights, so that their likelihoods compare. The aircraft are
split three times; each third left out is scored by fits to the others, flight by flight.
"""

import os
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from copy import deepcopy
from dataclasses import replace
from inspect import signature
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import RLock
from typing import Any, Literal

import torch
from lightning.fabric.plugins.environments.lightning import LightningEnvironment
from lightning.pytorch import Trainer, seed_everything
from lightning.pytorch.callbacks import ModelCheckpoint
from lightning.pytorch.loggers import CSVLogger
from lightning.pytorch.utilities.seed import isolate_rng

from descentflow.core.arguments import Count, Output, Seed, checked_arguments
from descentflow.core.errors import ConfigError, DescentflowWarning, nearest
from descentflow.core.files import check_output
from descentflow.core.threads import one_thread
from descentflow.densities.density import Density
from descentflow.densities.kinds import KINDS
from descentflow.representation.read_checkpoint import read_checkpoint
from descentflow.surveillance.descents.prepared_descents import Descents
from descentflow.training.callbacks.show_progress import ShowProgress, quiet
from descentflow.training.data_settings import DataSettings
from descentflow.training.datamodule import DescentDataModule
from descentflow.training.final_fit import fit_to_all
from descentflow.training.models.latent_model import LatentModel
from descentflow.training.run_folders import check_new_run, write_settings
from descentflow.training.training_settings import TrainingSettings, settings_of, training_settings

OWN_OPTIONS = {"out", "seed", "max_epochs", "aircraft", "context", "final", "device"}
"""Options of :func:`fit` that are not the DataModule's."""

_ONE_AT_A_TIME = RLock()
"""Held while a model is trained: random numbers and the number of threads belong to the whole process."""


@checked_arguments
def fit(
    descents: str | Path | Sequence[str | Path] | Descents | DescentDataModule,
    model: str | LatentModel[Any] | None = None,
    *,
    out: Output | None = None,
    seed: Seed = 0,
    max_epochs: Count | None = None,
    aircraft: str | None = None,
    context: Sequence[str] | None = None,
    final: bool = True,
    device: Literal["cpu", "cuda"] = "cpu",
    **data_options: Any,
) -> LatentModel[Any]:
    """Train a model on prepared descents, score it on held-out ones, and fit it to all (paper, sections 2.2 and 2.3).

    The model returned knows two densities. ``density`` is the one of the best epoch, which never saw the held-out
    flights: :func:`~descentflow.evaluation.evaluate.evaluate` scores it. ``final`` is fitted again to all flights, with
    the same settings and choices: it is what is sampled, predicted with and exported.

    With a name, the model is what ``descentflow fit --config configs/model/...`` trains with the same seed: both take
    their settings from the same file. Torch's global random numbers are the same before and after. Fits that
    several threads begin wait for one another, for these numbers are the process's: each equals the fit alone.

    Args:
        descents: What :func:`~descentflow.surveillance.prepare.prepare` returned, the path of what it wrote (several
            that were prepared alike are taken together), or a DataModule with options of its own.
        model: ``mixture``, ``gaussian`` or ``flow`` (masked affine); a model that is not trained yet, with
            hyperparameters of its own; a YAML file as ``descentflow fit --config`` takes it; or a Python file with a
            density of your own and its model, which is run. If absent, the one of the three under which flights of
            held-out aircraft are most probable, which costs some three times a flow's fit.
        out: File to write, ``NAME.ckpt``, or a new folder for the whole run: both checkpoints, ``metrics.csv`` of the
            epochs, and ``config.yaml``, as ``descentflow fit`` leaves them.
        seed: Of initial parameters and the order of batches, ``--seed_everything`` of the command line. What splits the
            flights is the DataModule's own seed.
        max_epochs: Epochs at most; those of the model's settings if absent.
        aircraft: Type whose coefficients infer and fly the drag; the descents' own type if they have only one.
        context: Columns on which the density is conditioned.
        final: Whether to fit the model again to all flights; without it, it is sampled as it was scored.
        device: ``cpu`` or ``cuda``, which is no faster with a few weights a flight.
        **data_options: Other options of :class:`~descentflow.training.datamodule.DescentDataModule`, for instance
            ``split_by="aircraft"``; those of the model's settings if absent.

    Returns:
        The fitted LightningModule. It prints what it was trained on, and ``save(path)`` writes its checkpoint.

    Raises:
        DataError: If the descents cannot be read or are too few, or the output cannot be written.
        ConfigError: If there is no such model, option or device, or the options contradict the descents.

    Example:
        >>> model = fit("descents.parquet", "gaussian", out="fitted.ckpt")
        >>> print(model)
        Gaussian of ... weights (... of drag, ... of CAS) on FL150-..., A320
        86 flights trained it, 10 validated it: val/nll ... in epoch 1
        sampled: the final fit, to all 120 flights, none held out
    """
    if device == "cuda" and not torch.cuda.is_available():
        raise ConfigError("device 'cuda'", expected="a GPU that torch can use", mend="leave the device out")
    outputs = [] if out is None else [Path(out)]
    files = [path for path in outputs if path.suffix == ".ckpt"]
    runs = [path for path in outputs if path not in files]
    for path in outputs:
        check_output(path) if path in files else check_new_run(path)
    quiet()
    # Where the kind is chosen, only the flow is trained in batches: its settings hold.
    settings = _settings("flow" if model is None else model, max_epochs)
    columns = None if context is None else list(context)
    data = _data_module(descents, settings.data, _given(aircraft=aircraft, context=columns, **data_options))
    with _ONE_AT_A_TIME, isolate_rng(), nullcontext() if "OMP_NUM_THREADS" in os.environ else one_thread():
        chosen = ""
        if model is None:
            data.setup()

            def fitted(name: str, split: DescentDataModule) -> Density:
                best: Density = fit(split, name, seed=seed, max_epochs=max_epochs, final=False, device=device).density
                return best

            model, chosen = most_probable(data, fitted)
            settings = _settings(model, max_epochs)
        seed_everything(seed, workers=True, verbose=False)
        trained = model if isinstance(model, LatentModel) else settings.new_model()
        with _interruptible():
            _train(trained, data, settings, device, runs, final=final)
    trained.chosen = chosen
    for path in files:
        trained.save(path)
    for run in runs:
        write_settings(run, seed, trained, data, settings.as_sections())
        if trained.final is not None:
            trained.save(run / "checkpoints" / "final.ckpt")
    return trained


def _settings(model: str | LatentModel[Any], max_epochs: int | None) -> TrainingSettings:
    settings = settings_of(model) if isinstance(model, LatentModel) else training_settings(model)
    return replace(settings, trainer=settings.trainer | _given(max_epochs=max_epochs))


def _given(**options: Any) -> dict[str, Any]:
    """The options that were given."""
    return {name: value for name, value in options.items() if value is not None}


def _data_module(source: Any, settings: dict[str, Any], options: dict[str, Any]) -> DescentDataModule:
    """The DataModule that was passed, or one with the options of the call over those of the settings."""
    known = {*signature(DescentDataModule).parameters, *signature(DataSettings).parameters} - {"descents", "settings"}
    for name in options:
        if name not in known:
            raise _no_option(name, known | OWN_OPTIONS)
    if not isinstance(source, DescentDataModule):
        return DescentDataModule(source, **settings | options)
    if options:
        raise ConfigError(
            f"a DataModule and {', '.join(options)}",
            expected="a DataModule with options of its own, or descents and options",
            mend="pass the options to DescentDataModule",
        )
    return source


def _no_option(name: str, known: set[str]) -> ConfigError:
    near = nearest(name, known)
    return ConfigError(
        f"an option {name} of fit",
        expected=f"one of {', '.join(sorted(known))}",
        mend=f"did you mean {near}?" if near else "leave it out; a model's own are passed to it, as Gaussian(ridge=2)",
    )


@contextmanager
def _interruptible() -> Iterator[None]:
    """Leave Ctrl-C what it is in Python: Lightning's Trainer makes it the end of the process."""
    try:
        yield
    except SystemExit as ended:
        if isinstance(ended.__context__, KeyboardInterrupt):
            raise KeyboardInterrupt from None
        raise


def _train(
    model: LatentModel[Any],
    data: DescentDataModule,
    settings: TrainingSettings,
    device: str,
    runs: Sequence[Path],
    *,
    final: bool,
) -> None:
    """Train a model, put it back to its best epoch, and fit it again to all flights."""
    again = deepcopy(model)
    with TemporaryDirectory() as scratch:
        folder = [*(run / "checkpoints" for run in runs), Path(scratch)][0]
        best = ModelCheckpoint(folder, **settings.checkpoint)
        trainer = Trainer(
            plugins=LightningEnvironment(),  # of this process alone, on clusters too
            default_root_dir=scratch,  # on Slurm, a Trainer would resume what it finds in the working directory
            logger=[CSVLogger(run, name="", version="") for run in runs],
            callbacks=[*settings.new_callbacks(), best, ShowProgress()],
            enable_progress_bar=False,
            enable_model_summary=False,
            **settings.trainer | {"accelerator": device},
        )
        trainer.fit(model, datamodule=data)
        content = read_checkpoint(best.best_model_path)
    model.restore(content)
    if final:
        fit_to_all(model, again, data, trainer, content["global_step"])


SPLITS = 3
"""With a flow's three fits to less than two thirds each, a choice costs less than two fits of a flow."""


@torch.no_grad()
def most_probable(data: DescentDataModule, fitted: Callable[[str, DescentDataModule], Density]) -> tuple[str, str]:
    """Name of the best density by held-out likelihood, and a line that has by how much.

    Args:
        data: Set up, with the training flights.
        fitted: Fits a density of a name to the train part of data.

    Example:
        >>> from descentflow.training.fit import fit
        >>> data = DescentDataModule("descents.parquet")
        >>> data.setup()
        >>> name, why = most_probable(data, lambda name, split: fit(split, "gaussian", final=False).density)
        >>> print(why)  # of three that are alike the first
        chosen of gaussian, mixture, flow: gaussian, by 0.00 +- 0.00 nats a flight over mixture, of held-out aircraft
    """
    names, parts = [kind.name for kind in KINDS], []
    for seed in range(SPLITS):
        split = data.resplit(seed)
        evidence, context = split.evidence("test"), split.contexts("test")
        with warnings.catch_warnings():
            # What a fit to fewer flights warns of is no matter of the one that is made of all.
            warnings.simplefilter("ignore", DescentflowWarning)
            densities = [fitted(name, split) for name in names]
        parts.append(torch.stack([density.log_observed(evidence, context).double() for density in densities]))
    by_flight = torch.cat(parts, 1)
    # The first of those that are level has the fewest parameters.
    first, second = by_flight.mean(1).sort(descending=True, stable=True).indices[:2].tolist()
    gain = by_flight[first] - by_flight[second]
    error = gain.std() / len(gain) ** 0.5
    over = f"{names[first]}, by {gain.mean():.2f} +- {error:.2f} nats a flight over {names[second]}"
    return names[first], f"chosen of {', '.join(names)}: {over}, of held-out aircraft"
