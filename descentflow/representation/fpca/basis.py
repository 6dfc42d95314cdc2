"""A fitted functional basis as torch buffers: encodes gappy profiles to weights and decodes weights to profiles."""

from math import sqrt
from typing import Any, Self

import torch
from torch import Tensor, nn

from descentflow.representation.fpca.iterative import modewise_weights
from descentflow.representation.fpca.mask_groups import group_masks
from descentflow.representation.fpca.ppca import posterior


class FunctionalBasis(nn.Module):
    """Mean function and components, orthonormal over altitude (paper, equation 4).

    The components satisfy ``sum_i phi_k(h_i) phi_l(h_i) dh = delta_kl``, so a weight has the unit of the profile
    times the square root of a metre.

    Shapes: mean (L,), components (k, L), loadings (L, q) and noise variance () of the probabilistic PCA that
    completes gappy profiles; q = 0 selects the paper's mode-by-mode weights instead. The noise stays alike over
    ``noise_length`` () levels, which therefore count as one observation.

    Example:
        >>> from descentflow.representation.read_checkpoint import load_representation
        >>> basis = load_representation("best.ckpt").decoder.cas_basis
        >>> orthonormal = basis.components @ basis.components.T * basis.spacing_m
        >>> torch.allclose(orthonormal, torch.eye(basis.n_components).double())
        True
        >>> basis.decode(torch.zeros(1, basis.n_components)).shape == (1, len(basis.mean))
        True
    """

    spacing_m: float
    mean: Tensor
    components: Tensor
    loadings: Tensor
    noise_variance: Tensor
    noise_length: Tensor
    explained_variance: Tensor

    def __init__(
        self,
        mean: Tensor,
        components: Tensor,
        loadings: Tensor,
        noise_variance: Tensor,
        noise_length: Tensor,
        explained_variance: Tensor,
        spacing_m: float,
    ) -> None:
        super().__init__()
        self.spacing_m = spacing_m
        # Not persistent: the checkpoint holds the basis once, as the state of the decoder that owns it.
        for name, value in (
            ("mean", mean),
            ("components", components),
            ("loadings", loadings),
            ("noise_variance", noise_variance),
            ("noise_length", noise_length),
            ("explained_variance", explained_variance),
        ):
            self.register_buffer(name, value.to(torch.float64), persistent=False)

    @property
    def n_components(self) -> int:
        """Number of components k."""
        return self.components.shape[0]

    def decode(self, weights: Tensor) -> Tensor:
        """Profiles (n, L) of weights (n, k), in the weights' precision."""
        return self.mean.to(weights) + weights @ self.components.to(weights)

    def complete(self, values: Tensor, mask: Tensor) -> Tensor:
        """Profiles (n, L) with missing levels replaced by their expectation given the observed ones.

        Observed levels are returned as they are; masked values are ignored.
        """
        if self.loadings.shape[1] == 0 or bool(mask.all()):
            return torch.where(mask, values, self.decode(self.encode(values, mask)))
        centred = torch.where(mask, values - self.mean, 0.0)
        latent, _, _ = posterior(centred, group_masks(mask), self.loadings, self.noise_variance * self.noise_length)
        return torch.where(mask, values, self.mean + latent @ self.loadings.T)

    def encode(self, values: Tensor, mask: Tensor) -> Tensor:
        """Weights (n, k) of gappy profiles (n, L) with their mask of observed levels.

        With probabilistic PCA these are the expected weights given the observed levels, equal to the usual
        projections where nothing is missing.
        """
        values = values.to(torch.float64)
        if self.loadings.shape[1] == 0:
            root = sqrt(self.spacing_m)
            return modewise_weights(values - self.mean, mask, self.components.T * root) * root
        if not bool(mask.all()):
            values = self.complete(values, mask)
        weights: Tensor = (values - self.mean) @ self.components.T * self.spacing_m
        return weights

    def left_out(self) -> Tensor:
        """Loadings (L, q - k) of the directions of the probabilistic PCA beyond the kept components.

        Example:
            >>> from descentflow.representation.read_checkpoint import load_representation
            >>> basis = load_representation("best.ckpt").decoder.drag_basis
            >>> bool((basis.components @ basis.left_out()).abs().max() < 1e-6 * basis.loadings.norm())
            True
        """
        left, singular, _ = torch.linalg.svd(self.loadings, full_matrices=False)
        rest: Tensor = left[:, self.n_components :] * singular[self.n_components :]
        return rest

    def to_state(self) -> dict[str, Any]:
        """Tensors and primitives from which :meth:`from_state` rebuilds the basis."""
        return {
            **{name: buffer.cpu() for name, buffer in self.named_buffers(remove_duplicate=False)},
            "spacing_m": self.spacing_m,
        }

    @classmethod
    def from_state(cls, state: dict[str, Any]) -> Self:
        """Rebuild from :meth:`to_state`."""
        return cls(**state)
