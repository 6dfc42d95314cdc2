"""How a trained density learns in what way its training flights differ by their entry level."""

from pathlib import Path
from typing import Any

import torch
from lightning.pytorch import Trainer
from lightning.pytorch.callbacks import ModelCheckpoint

from descentflow.core.files import whole_file
from descentflow.densities.checkpoint import LAW_DUE, section_of
from descentflow.densities.entry_law import EntryLaw
from descentflow.densities.learn_entry_law import learn_entry_law
from descentflow.representation.read_checkpoint import SECTION, read_checkpoint
from descentflow.training.models.latent_model import LatentModel, training_flights


def entry_law_of(model: LatentModel[Any]) -> EntryLaw | None:
    """The law of the normals behind a Gaussian or a flow, with the density as it is; None with a context.

    Example:
        >>> from descentflow.training.fit import fit
        >>> law = fit("descents.parquet", "gaussian").density.entry_law
        >>> law is None or len(law.shares) > 1
        True
    """
    evidence, context = training_flights(model)
    entry = model.trainer.datamodule.entries("train")  # type: ignore[attr-defined]
    return None if context is not None or entry is None else learn_entry_law(model.density, evidence, entry)


def learn_kept_laws(model: LatentModel[Any]) -> None:
    """Write the law by entry into every checkpoint that a fit which ends has kept; the density is left as the last one.

    Example:
        >>> from descentflow.training.fit import fit
        >>> from descentflow.training.models import MaskedAffineFlow
        >>> model = fit("descents.parquet", MaskedAffineFlow(n_flows=1), max_epochs=2)  # reads its best epoch again
        >>> model.density.settings()["entry_law"] is None or "shift" in model.density.settings()["entry_law"]
        True
    """
    for path in _kept(model.trainer) if model.trainer.is_global_zero else ():
        content = read_checkpoint(path)
        model.load_state_dict(content["state_dict"])
        model.density.entry_law = None
        model.density.entry_law = entry_law_of(model)
        content |= {SECTION: section_of(model.density), LAW_DUE: False}
        with whole_file(path) as temporary:
            torch.save(content, temporary)


def _kept(trainer: Trainer) -> list[Path]:
    """Files of the trainer's checkpoints, each once."""
    kept = [one for one in trainer.checkpoint_callbacks if isinstance(one, ModelCheckpoint)]
    names = {name for one in kept for name in (*one.best_k_models, one.best_model_path, one.last_model_path)}
    return [Path(name) for name in sorted(names) if name and Path(name).is_file()]
