"""Residual of the kept components in the training flights, which samples have with its own variance."""

import torch
from torch import Tensor

from descentflow.representation.decoder.descent_decoder import DescentDecoder
from descentflow.representation.fpca.basis import FunctionalBasis
from descentflow.representation.fpca.roughness import SPREAD_WEIGHT, smoother
from descentflow.representation.profiles import Profiles


def residual_drag(decoder: DescentDecoder, train: Profiles) -> Tensor:
    """Curves of drag (r, L), N on its scale, each of which samples have times a standard normal of its own.

    They are the directions of the probabilistic PCA beyond the kept components, which are smooth, made as large at each
    level as what flights show less their kept components. Where few flights show a level, as at the top, the model's
    are half as large again.

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
    kept, *_ = decoder.profiles(decoder.encode(train))
    shown = decoder.drag_scale.observed(train).values[0]
    return _as_large_as_left(decoder.drag_basis, shown - kept, train.mask)


def residual_speed(decoder: DescentDecoder, train: Profiles) -> Tensor:
    """Deviations of the CAS (s, L) in m/s, as :func:`residual_drag` has those of drag.

    Args:
        decoder: With the components kept, of a probabilistic PCA.
        train: Training flights on its grid.

    Example:
        >>> from descentflow.representation.encode_flights import encode_flights
        >>> from descentflow.representation.read_checkpoint import load_representation
        >>> import polars as pl
        >>> known = load_representation("best.ckpt")
        >>> train = encode_flights(pl.read_parquet("descents.parquet"), known)["train"].profiles
        >>> residual_speed(known.decoder, train).shape[1] == train.cas_mps.shape[1]
        True
    """
    _, kept = decoder.curves(decoder.encode(train))
    return _as_large_as_left(decoder.cas_basis, train.cas_mps - kept, train.mask)


def _as_large_as_left(basis: FunctionalBasis, left: Tensor, mask: Tensor) -> Tensor:
    """Directions that a basis leaves out, as large as ``left`` (n, L) of what flights show.

    They carry the noise of the probabilistic PCA as well, for it is how flights vary from one stretch of levels to the
    next. So they are made larger by it at the most; smaller as flights show.
    """
    curves, count = basis.left_out().T, mask.sum(0).to(left)
    model = curves.square().sum(0)
    shown = torch.where(mask, left, 0.0).square().sum(0) / count
    ratio = (torch.minimum(shown, model + basis.noise_variance) / model.clamp(min=1e-18)).sqrt()
    return (curves * (smoother(count, SPREAD_WEIGHT) @ ratio).clamp(min=0.0)).contiguous()
