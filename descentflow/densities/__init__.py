"""Latent densities over the weights: log density, sampling and checkpoints. No trainer is imported here.

Each is imported when it is first asked for: a checkpoint of one need not pay for the libraries of the others.
:mod:`descentflow.training` trains them.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from descentflow.densities.density import Density
    from descentflow.densities.flow import MaskedAffineFlowDensity, SplineFlowDensity
    from descentflow.densities.gaussian import GaussianDensity
    from descentflow.densities.mixture import GaussianMixtureDensity

__all__ = ["Density", "GaussianDensity", "GaussianMixtureDensity", "MaskedAffineFlowDensity", "SplineFlowDensity"]

MODULES = {
    "Density": "density",
    "GaussianDensity": "gaussian",
    "GaussianMixtureDensity": "mixture",
    "MaskedAffineFlowDensity": "flow",
    "SplineFlowDensity": "flow",
}


def __getattr__(name: str) -> Any:
    """Import a density on first use (PEP 562)."""
    if name not in MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{MODULES[name]}"), name)
