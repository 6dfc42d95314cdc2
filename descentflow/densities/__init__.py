"""Densities over the weights of a flight: log density, sampling and checkpoints; :mod:`descentflow.training` fits them.

Reading order: :mod:`~descentflow.densities.density` (what every density offers),
:mod:`~descentflow.densities.gaussian` (those that map standard normals, and the simplest of them),
:mod:`~descentflow.densities.one_gaussian` (the weights of gappy flights, which mixtures are fitted to),
:mod:`~descentflow.densities.mixture` (with :mod:`~descentflow.densities.mixture_parameters`),
:mod:`~descentflow.densities.em` (its fit; the steps are in :mod:`~descentflow.densities.em_steps`),
:mod:`~descentflow.densities.component_search` (how many mixture components), :mod:`~descentflow.densities.flow` (with
:mod:`~descentflow.densities.layers`), :mod:`~descentflow.densities.checkpoint`.

To add a density: a subclass of :class:`Density` with ``log_prob`` and ``draw`` in a file of its own, a LightningModule
that fits it in a file of :mod:`descentflow.training.models`, and a line in :mod:`~descentflow.densities.kinds`, with a
settings file. Sampling, evaluation, prediction, diagnosis and checkpoints then work with it, and so they do from one
file of yours (``--model my_density.py``), without any change here.

Each is imported on first use: a checkpoint of one need not pay for the libraries of the others, or for Lightning.

Example:
    >>> from descentflow.densities import GaussianDensity
    >>> GaussianDensity(dimension=3).sample(5, seed=0).shape
    torch.Size([5, 3])
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from descentflow.densities.kinds import KINDS

if TYPE_CHECKING:
    from descentflow.densities.density import Density as Density

MODULES = {"Density": "density"} | {kind.density: kind.module for kind in KINDS}


def __getattr__(name: str) -> Any:
    """Import a density on first use (PEP 562)."""
    if name not in MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{MODULES[name]}"), name)
