"""Densities over the weights of a flight: log density, sampling and checkpoints; :mod:`descentflow.training` fits them.

Reading order: :mod:`~descentflow.densities.density` (what every density offers),
:mod:`~descentflow.densities.transformed` (those that map standard normals, with their law by the entry level,
:mod:`~descentflow.densities.entry_law`), :mod:`~descentflow.densities.gaussian`,
:mod:`~descentflow.densities.mixture` (with :mod:`~descentflow.densities.entry_gate` and
:mod:`~descentflow.densities.mixture_parameters`), :mod:`~descentflow.densities.em` (its fit; the steps are in
:mod:`~descentflow.densities.gaussian_steps` and :mod:`~descentflow.densities.regression_steps`),
:mod:`~descentflow.densities.component_search` (how many mixture components), :mod:`~descentflow.densities.flow` (with
:mod:`~descentflow.densities.layers`), :mod:`~descentflow.densities.checkpoint` (what it holds:
:mod:`~descentflow.densities.checkpoint_summary`).

To add a density: write a subclass of :class:`Density` with ``log_prob`` and ``draw`` in a file of its own, enter it in
``MODULES`` below, and add a LightningModule that fits it to :mod:`descentflow.training.models` (enter it in ``MODULES``
there). Sampling, evaluation, prediction, diagnosis and checkpoints then work with it.

Each is imported on first use: a checkpoint of one need not pay for the libraries of the others, or for Lightning.

Example:
    >>> from descentflow.densities import GaussianDensity
    >>> GaussianDensity(dimension=3).sample(5, seed=0).shape
    torch.Size([5, 3])
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
