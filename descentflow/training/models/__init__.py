"""LightningModules that train the densities, one for each.

Reading order: :mod:`~descentflow.training.models.latent_model` (what all share),
:mod:`~descentflow.training.models.gaussian_model`, :mod:`~descentflow.training.models.mixture_model`,
:mod:`~descentflow.training.models.flow_model`, :mod:`~descentflow.training.models.optimizers`.

To train a new density, subclass :class:`LatentModel` in a file here and enter it in
:mod:`descentflow.densities.kinds`.

Each is imported when it is first asked for, so that training one need not pay for the libraries of the others.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from descentflow.densities.kinds import KINDS

if TYPE_CHECKING:
    from descentflow.training.models.latent_model import LatentModel as LatentModel

MODULES = {"LatentModel": "latent_model"} | {kind.model: kind.trained_in for kind in KINDS}


def __getattr__(name: str) -> Any:
    """Import a model on first use (PEP 562)."""
    if name not in MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{MODULES[name]}"), name)
