"""Learning with the density held, in the checkpoints that a fit has kept: once, when training has ended.

How flights differ by their entry level, and what the components of a mixture leave out, are no part of what an epoch
trains, and take as long to learn as one. So checkpoints of a fit that is going on say that they lack them.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import torch
from lightning.pytorch import Trainer
from lightning.pytorch.callbacks import ModelCheckpoint

from descentflow.core.files import whole_file
from descentflow.densities.checkpoint import UNFINISHED, section_of
from descentflow.representation.read_checkpoint import SECTION, read_checkpoint
from descentflow.training.models.latent_model import LatentModel


def complete_kept(model: LatentModel[Any], learn: Callable[[], None]) -> None:
    """Add what is learnt with the density held to every checkpoint that a fit which ends has kept.

    The model is left with the parameters of one of them.

    Args:
        model: Whose fit ends.
        learn: Learns it for the model's density as it is.

    Example:
        >>> from descentflow.training.fit import fit
        >>> from descentflow.training.models.mixture_model import GaussianMixture
        >>> model = fit("descents.parquet", GaussianMixture(n_clusters=2))  # reads its best epoch again
        >>> len(model.density.entry_gate.shares)  # bins of the entry level
        4
    """
    for path in _kept(model.trainer) if model.trainer.is_global_zero else ():
        content = read_checkpoint(path)
        model.load_state_dict(content["state_dict"])
        learn()
        content |= {SECTION: section_of(model.density), UNFINISHED: False}
        with whole_file(path) as temporary:
            torch.save(content, temporary)


def _kept(trainer: Trainer) -> list[Path]:
    """Files of the trainer's checkpoints, each once."""
    kept = [one for one in trainer.checkpoint_callbacks if isinstance(one, ModelCheckpoint)]
    names = {name for one in kept for name in (*one.best_k_models, one.best_model_path, one.last_model_path)}
    return [Path(name) for name in sorted(names) if name and Path(name).is_file()]
