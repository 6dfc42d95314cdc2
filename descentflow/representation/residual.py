"""What the kept components leave of the training flights: it comes back in samples, with its own variance."""

import torch
from torch import Tensor

from descentflow.representation.decoder.descent_decoder import DescentDecoder
from descentflow.representation.fpca.basis import FunctionalBasis
from descentflow.representation.fpca.roughness import smoother
from descentflow.representation.profiles import Profiles

ROUGHNESS_WEIGHT = 1e5
"""Of the prior that smooths the ratio of both spreads over the levels, in flights: some 20 levels for 2,000 of them."""


def residual_drag(decoder: DescentDecoder, train: Profiles) -> Tensor:
    """Curves of drag (r, L), in N, each of which samples have times a standard normal of its own.

    They are the directions of the probabilistic PCA beyond the kept components, which are smooth, made smaller where
    their spread is above that of what flights show less their kept components: where few flights show a level, as at
    the top, the model's is half as large again. Those of a CAS profile stay away: CAS, of one component mostly, came
    out farther from flights with independent normals added. A Mach number and a CAS that are constants have them, see
    :func:`residual_speed`.

    Args:
        decoder: With the components kept, of a probabilistic PCA.
        train: Training flights on its grid.

    Example:
        >>> from descentflow.representation.encode_flights import encode_flights
        >>> from descentflow.representation.read_checkpoint import load_representation
        >>> import polars as pl
        >>> known = load_representation("best.ckpt")
        >>> train = encode_flights(pl.read_parquet("descents.parquet"), known)["train"].profiles
        >>> curves = residual_drag(known.decoder, train)
        >>> spread = curves.square().sum(0).sqrt()
        >>> bool((spread < train.drag_n[:, 0].std()).all())  # less than of the flights
        True
    """
    curves = decoder.drag_basis.left_out().T
    kept, _ = decoder.curves(decoder.encode(train))
    count = train.mask.sum(0).to(kept)
    left = (torch.where(train.mask, train.drag_n - kept, 0.0).square().sum(0) / count).sqrt()
    ratio = left / curves.square().sum(0).sqrt().clamp(min=1e-9)
    return (curves * (smoother(count, ROUGHNESS_WEIGHT) @ ratio.clamp(max=1.0)).clamp(0.0, 1.0)).contiguous()


def residual_speed(mach_basis: FunctionalBasis, cas_basis: FunctionalBasis) -> Tensor:
    """Deviations (s, 2 L) of the Mach number, then of the CAS in m/s, each times a standard normal in samples.

    Args:
        mach_basis: Of constants.
        cas_basis: Likewise.

    Example:
        >>> from descentflow.representation.fpca.constant_basis import fit_constant
        >>> seen = torch.ones(40, 20, dtype=torch.bool)
        >>> held = fit_constant(torch.randn(40, 1).double() + 0.1 * torch.randn(40, 20).double(), seen, 30.48)
        >>> residual_speed(held, held).shape  # three shapes each
        torch.Size([6, 40])
    """
    bases = (mach_basis, cas_basis)
    blocks: Tensor = torch.block_diag(*(basis.left_out().T for basis in bases))  # type: ignore[no-untyped-call]
    return blocks
