"""Hide observed levels, and choose by them how far the levels that are left are believed."""

from typing import Literal

import torch
from torch import Tensor

from descentflow.representation.fpca.ppca import group_masks, posterior

Pattern = Literal["top", "random"]
FEWEST = 0.1
"""Share of the flights that still show each level: the grid of a type ends where a quarter of them do."""
LENGTHS = (1.0, 3.0, 10.0, 30.0, 100.0, 300.0)
"""Levels that noise stays alike over, among which is chosen."""


def hide(mask: Tensor, pattern: Pattern, share: float, generator: torch.Generator) -> Tensor:
    """Levels (n, L) to hide of those observed.

    ``top`` hides from each flight's highest level down, a share drawn between zero and twice ``share``; ``random``
    hides single levels with probability ``share``. No flight loses all levels, and levels that less than a tenth of
    the flights would still show are not hidden from any.

    Example:
        >>> hide(torch.ones(5, 200, dtype=torch.bool), "top", 0.3, torch.Generator().manual_seed(0)).shape
        torch.Size([5, 200])
    """
    if pattern == "random":
        hidden = mask & (torch.rand(mask.shape, generator=generator) < share)
    else:
        part = 2 * share * torch.rand(len(mask), 1, generator=generator)
        from_top = mask.flip(1).cumsum(1).flip(1)
        hidden = mask & (from_top <= part * mask.sum(1, keepdim=True))
    hidden = hidden & (mask & ~hidden).any(1, keepdim=True)
    return hidden & ((mask & ~hidden).sum(0) >= FEWEST * len(mask))


def noise_length(centred: Tensor, mask: Tensor, hidden: Tensor, loadings: Tensor, noise: Tensor) -> Tensor:
    """Levels over which the noise of a probabilistic PCA stays alike, as the choice that fills hidden levels best.

    The model takes what its components leave over for white noise, level by level. It is smooth, so that neighbouring
    levels tell the same thing, and a flight's weights, believed to a precision that they do not have, run away above
    its highest level. So many levels are counted as one, that is, the noise variance is multiplied by their number.

    Args:
        centred: (n, L) values less the mean.
        mask: (n, L) levels that the model was fitted to.
        hidden: (n, L) levels that it was not fitted to.
        loadings: (L, q).
        noise: Noise variance.
    """
    groups = group_masks(mask)
    seen = torch.where(mask, centred, 0.0)

    def loss(length: float) -> float:
        latent, _, _ = posterior(seen, groups, loadings, noise * length)
        return float(torch.where(hidden, latent @ loadings.T - centred, 0.0).square().sum())

    return centred.new_tensor(min(LENGTHS, key=loss))
