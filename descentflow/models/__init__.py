"""Latent densities over the weights: Gaussian, Gaussian mixture and masked affine flow."""

from descentflow.models.base import LatentModel
from descentflow.models.flow import MaskedAffineFlow
from descentflow.models.gaussian import Gaussian
from descentflow.models.gmm import GaussianMixture

__all__ = ["Gaussian", "GaussianMixture", "LatentModel", "MaskedAffineFlow"]
