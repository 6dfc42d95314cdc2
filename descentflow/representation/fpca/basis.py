"""A fitted functional basis as torch buffers: encodes gappy profiles to weights and decodes weights to profiles."""

from math import sqrt
from typing import Any, Self

import torch
from torch import Tensor, nn

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
        >>> from descentflow.densities.checkpoint import load_model
        >>> basis = load_model("best.ckpt").representation.decoder.cas_basis
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
        return torch.addmm(self.mean.to(weights), weights, self.components.to(weights))

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
            >>> from descentflow.densities.checkpoint import load_model
            >>> basis = load_model("best.ckpt").representation.decoder.drag_basis
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


ROUNDING = 1e-12
"""A share that misses the one asked for by rounding alone explains it."""


def explained_share(eigenvalues: Tensor) -> Tensor:
    """Share of the variance that the first k components explain together, for each k.

    Args:
        eigenvalues: (L,) in descending order; negative ones (of a covariance estimated pairwise) count as 0.

    Returns:
        (L,) ascending to one.

    Example:
        >>> explained_share(torch.tensor([6.0, 3.0, 1.0]))
        tensor([0.6000, 0.9000, 1.0000])
    """
    positive = eigenvalues.clamp(min=0)
    return positive.cumsum(0) / positive.sum()


def number_of_components(share: Tensor, explained_variance: float) -> int:
    """The fewest components that explain a share of the variance (paper, section 2.2: 80 %).

    Args:
        share: (L,) of :func:`explained_share`.
        explained_variance: Share asked for, between 0 and 1: the option ``data.explained_variance``.

    Example:
        >>> number_of_components(explained_share(torch.tensor([6.0, 3.0, 1.0])), 0.8)
        2
    """
    return int((share < explained_variance - ROUNDING).sum()) + 1


def modewise_weights(centred: Tensor, mask: Tensor, modes: Tensor) -> Tensor:
    """Weights (n, k) of unit-norm modes (L, k), one mode after the other on the observed levels (appendix A, 3).

    Args:
        centred: (n, L) values minus the mean; masked values are ignored.
        mask: (n, L) observed.
        modes: (L, k) eigenvectors.

    Example:
        >>> mode = torch.tensor([[0.6], [0.8]])
        >>> modewise_weights(torch.tensor([[3.0, 999.0]]), torch.tensor([[True, False]]), mode)  # 3 / 0.6
        tensor([[5.]])
    """
    seen = mask.to(centred.dtype)
    rest = torch.where(mask, centred, 0.0)
    weights = []
    for mode in modes.T:
        length = (seen @ mode.square()).clamp(min=1e-12)
        weight = (rest @ mode) / length
        rest = rest - weight[:, None] * mode * seen
        weights.append(weight)
    return torch.stack(weights, 1)
