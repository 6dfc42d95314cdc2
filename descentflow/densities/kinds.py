"""The densities that come along: the one table of their names, classes, training and settings.

It imports no library, so a program that asks for one of them pays for no other.
"""

from typing import NamedTuple


class DensityKind(NamedTuple):
    """Classes, training and settings of a density.

    Example:
        >>> [kind.name for kind in KINDS if kind.model == "Gaussian"]
        ['gaussian']
    """

    name: str
    """Name by which users ask for it."""
    density: str
    """Class in :mod:`descentflow.densities`."""
    module: str
    """Module of the class there."""
    model: str
    """Class in :mod:`descentflow.training.models` that trains it."""
    trained_in: str
    """Module of the class there."""
    settings: str
    """Settings file in ``descentflow/configs/model`` with which it is trained."""


KINDS = (
    DensityKind("gaussian", "GaussianDensity", "gaussian", "Gaussian", "gaussian_model", "gaussian"),
    DensityKind("mixture", "GaussianMixtureDensity", "mixture", "GaussianMixture", "mixture_model", "gmm"),
    DensityKind("flow", "MaskedAffineFlowDensity", "flow", "MaskedAffineFlow", "flow_model", "flow"),
)
