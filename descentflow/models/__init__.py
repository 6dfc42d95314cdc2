"""What trains the latent densities: one LightningModule for each.

Each is imported when it is first asked for, so that training one need not pay for the libraries of the others.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from descentflow.models.base import LatentModel
    from descentflow.models.flow import MaskedAffineFlow, SplineFlow
    from descentflow.models.gaussian import Gaussian
    from descentflow.models.gmm import GaussianMixture

__all__ = ["Gaussian", "GaussianMixture", "LatentModel", "MaskedAffineFlow", "SplineFlow"]

MODULES = {
    "Gaussian": "gaussian",
    "GaussianMixture": "gmm",
    "LatentModel": "base",
    "MaskedAffineFlow": "flow",
    "SplineFlow": "flow",
}


def __getattr__(name: str) -> Any:
    """Import a model on first use (PEP 562)."""
    if name not in MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{MODULES[name]}"), name)
