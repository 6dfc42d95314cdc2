"""Drag and CAS as linear functions of weights and residual components: what an observed part says of the whole."""

from dataclasses import dataclass

import torch
from torch import Tensor

from descentflow.core.errors import ConfigError
from descentflow.representation.decoder.descent_decoder import DescentDecoder
from descentflow.representation.fpca.basis import FunctionalBasis


@dataclass(frozen=True)
class LinearCurves:
    """``(drag, CAS) = offset + loadings u + noise`` with ``u = (w, r)``: weights, then residual components.

    The d weights w are those of the density. The residual components r, standard normal a priori and independent of
    w, are the directions of the probabilistic PCA that the explained-variance cut left out of the weights: without them
    a flight would be thought to follow the kept components to within white noise, and its future known too well.

    Shapes: ``offset`` and ``noise_variance`` (2 L,), ``loadings`` (2 L, d + r); drag stands before CAS.

    Example:
        >>> from descentflow.representation.read_checkpoint import load_representation
        >>> curves = linear_curves(load_representation("best.ckpt").decoder)
        >>> at_mean = torch.zeros(1, curves.loadings.shape[1], dtype=torch.float64)
        >>> drag_n, cas_mps = curves.profiles(at_mean)
        >>> precision, shift = curves.evidence(drag_n[0], cas_mps[0], torch.ones(drag_n.shape[1], dtype=torch.bool))
        >>> bool((shift.abs() < 1e-6).all())  # an observed mean profile does not move the weights
        True
    """

    offset: Tensor
    loadings: Tensor
    noise_variance: Tensor
    n_weights: int

    @property
    def n_residual(self) -> int:
        """Number of residual components."""
        return self.loadings.shape[1] - self.n_weights

    def evidence(self, drag_n: Tensor, cas_mps: Tensor, mask: Tensor) -> tuple[Tensor, Tensor]:
        """Information that observed levels hold on u, from white noise: precision (D, D) and shift (D,).

        The log-likelihood of u is ``shift' u - u' precision u / 2`` and a constant.

        Args:
            drag_n: (L,) of one flight.
            cas_mps: (L,).
            mask: (L,) observed.
        """
        seen = torch.cat([mask, mask])
        rows = self.loadings[seen]
        scaled = rows / self.noise_variance[seen, None]
        observed = torch.cat([drag_n, cas_mps])[seen] - self.offset[seen]
        return rows.T @ scaled, scaled.T @ observed

    def profiles(self, u: Tensor) -> tuple[Tensor, Tensor]:
        """Drag and CAS (n, L) of (n, D)."""
        both = self.offset + u @ self.loadings.T
        drag, cas = both.chunk(2, dim=1)
        return drag, cas


def linear_curves(decoder: DescentDecoder) -> LinearCurves:
    """The linear form of a decoder's bases and scaler.

    Raises:
        ConfigError: If the bases were fitted by the paper's iteration, which has no model of what they leave out.

    Example:
        >>> from descentflow.representation.read_checkpoint import load_representation
        >>> curves = linear_curves(load_representation("best.ckpt").decoder)
        >>> curves.loadings.shape[1] == curves.n_weights + curves.n_residual
        True
    """
    bases = (decoder.drag_basis, decoder.cas_basis)
    if any(basis.loadings.shape[1] == 0 for basis in bases):
        raise ConfigError(
            "components fitted by the paper's iteration (data.fpca: iterative)",
            expected="probabilistic PCA, which says how far flights stray from the components",
            mend="fit again with data.fpca: ppca",
        )
    n_drag = decoder.drag_basis.n_components
    parts = (slice(0, n_drag), slice(n_drag, None))
    kept = [basis.components.T for basis in bases]
    offsets = [basis.mean + k @ decoder.weight_mean[part] for basis, k, part in zip(bases, kept, parts, strict=True)]
    kept = [k * decoder.weight_scale[part] for k, part in zip(kept, parts, strict=True)]
    # Levels whose noise is alike tell together as much as one: the same as each with so many times the variance.
    noise = [(basis.noise_variance * basis.noise_length).expand(len(basis.mean)) for basis in bases]
    rest = [_residual(basis) for basis in bases]
    loadings = torch.cat([_two_blocks(*kept), _two_blocks(*rest)], 1)
    return LinearCurves(torch.cat(offsets), loadings, torch.cat(noise), decoder.dimension)


def _two_blocks(upper: Tensor, lower: Tensor) -> Tensor:
    """Block-diagonal matrix of two."""
    blocks: Tensor = torch.block_diag(upper, lower)  # type: ignore[no-untyped-call]
    return blocks


def _residual(basis: FunctionalBasis) -> Tensor:
    """Loadings (L, q - k) of the directions beyond the kept components."""
    left, singular, _ = torch.linalg.svd(basis.loadings, full_matrices=False)
    rest: Tensor = left[:, basis.n_components :] * singular[basis.n_components :]
    return rest
