"""LightningModules that train the densities, one for each.

Reading order: :mod:`~descentflow.training.models.latent_model` (what all share),
:mod:`~descentflow.training.models.gaussian_model`, :mod:`~descentflow.training.models.mixture_model`,
:mod:`~descentflow.training.models.flow_model`, :mod:`~descentflow.training.models.optimizers`.

To train a new density, subclass :class:`LatentModel` in a file here and enter it in ``MODULES`` below.

Each is imported when it is first asked for, so that training one need not pay for the libraries of the others.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from descentflow.training.models.flow_model import MaskedAffineFlow, SplineFlow
    from descentflow.training.models.gaussian_model import Gaussian
    from descentflow.training.models.latent_model import LatentModel
    from descentflow.training.models.mixture_model import GaussianMixture

__all__ = ["Gaussian", "GaussianMixture", "LatentModel", "MaskedAffineFlow", "SplineFlow"]

MODULES = {
    "Gaussian": "gaussian_model",
    "GaussianMixture": "mixture_model",
    "LatentModel": "latent_model",
    "MaskedAffineFlow": "flow_model",
    "SplineFlow": "flow_model",
}


def __getattr__(name: str) -> Any:
    """Import a model on first use (PEP 562)."""
    if name not in MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{MODULES[name]}"), name)
