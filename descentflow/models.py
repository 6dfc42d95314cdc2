"""The models under their former name, for which settings files and checkpoints of older runs ask.

They live in :mod:`descentflow.training.models`; nothing of descentflow itself uses this name.
"""

import warnings
from importlib import import_module
from typing import Any

from descentflow.core.errors import DescentflowWarning

CLASSES = ("Gaussian", "GaussianMixture", "LatentModel", "MaskedAffineFlow", "SplineFlow")


def __getattr__(name: str) -> Any:
    """Find a model where it is now, and say so (PEP 562)."""
    if name not in CLASSES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    warnings.warn(
        f"descentflow.models.{name} is descentflow.training.models.{name} now: change class_path in config.yaml",
        DescentflowWarning,
        stacklevel=2,
    )
    return getattr(import_module("descentflow.training.models"), name)
