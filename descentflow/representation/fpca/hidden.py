"""Hide observed levels, and choose by them how precisely the remaining levels determine the weights."""

from typing import Literal

import torch
from torch import Tensor

from descentflow.core.errors import ConfigError
from descentflow.representation.fpca.ppca import group_masks, posterior

Pattern = Literal["top", "random", "slow"]
MOST_HIDDEN = 0.9
"""Share of its levels that a flight loses at most."""
MIN_SHARE_SHOWN = 0.1
"""Share of the flights that still show each level: the grid of a type ends where a quarter of them do."""
LENGTHS = (1.0, 3.0, 10.0, 30.0, 100.0, 300.0)
"""Correlation lengths of the noise in levels, among which one is chosen."""


def hide(
    mask: Tensor, pattern: Pattern, share: float, generator: torch.Generator, speed: Tensor | None = None
) -> Tensor:
    """Levels (n, L) to hide of those observed.

    ``top`` hides from each flight's highest level down, a share drawn between zero and twice ``share``; ``random``
    hides single levels with probability ``share``; ``slow`` hides tops of the slower half of the flights alone, twice
    as much of each, as where slow operators cruise low: what is hidden then depends on what is shown. No flight loses
    all levels, and levels that less than a tenth of the flights would still show are not hidden from any.

    Args:
        mask: (n, L) observed.
        pattern: Which levels.
        share: How many.
        generator: Of the draws.
        speed: (n,) by which flights are slow, for ``slow``.

    Raises:
        ConfigError: If ``slow`` is asked for without speeds.

    Example:
        >>> hide(torch.ones(5, 200, dtype=torch.bool), "top", 0.3, torch.Generator().manual_seed(0)).shape
        torch.Size([5, 200])
    """
    if pattern == "random":
        hidden = mask & (torch.rand(mask.shape, generator=generator) < share)
    else:
        part = 2 * share * torch.rand(len(mask), 1, generator=generator)
        if pattern == "slow":
            if speed is None:
                raise ConfigError("the pattern 'slow' without speeds", expected="a speed a flight", mend="pass speed")
            part = torch.where((speed < speed.median())[:, None], (2 * part).clamp(max=MOST_HIDDEN), 0.0)
        from_top = mask.flip(1).cumsum(1).flip(1)
        hidden = mask & (from_top <= part * mask.sum(1, keepdim=True))
    hidden = hidden & (mask & ~hidden).any(1, keepdim=True)
    return hidden & ((mask & ~hidden).sum(0) >= MIN_SHARE_SHOWN * len(mask))


def noise_length(centred: Tensor, mask: Tensor, hidden: Tensor, loadings: Tensor, noise: Tensor) -> Tensor:
    """Correlation length (levels) of the noise of a probabilistic PCA: the choice that predicts hidden levels best.

    The model takes the residual of its components for white noise, independent from level to level. It is smooth:
    neighbouring levels carry the same information, and a flight's weights, trusted to a precision that they do not
    have, diverge above its highest level. So that many levels count as one: the noise variance is multiplied by their
    number.

    Args:
        centred: (n, L) values minus the mean.
        mask: (n, L) levels that the model was fitted to.
        hidden: (n, L) levels that it was not fitted to.
        loadings: (L, q).
        noise: Noise variance.

    Example:
        >>> shape = torch.ones(20, 1).double()
        >>> centred = torch.randn(50, 1).double() @ shape.T + 0.1 * torch.randn(50, 20).double()
        >>> seen = torch.arange(20).expand(50, 20) < 15
        >>> float(noise_length(centred, seen, ~seen, shape, torch.tensor(0.01).double())) in LENGTHS
        True
    """
    groups = group_masks(mask)
    seen = torch.where(mask, centred, 0.0)

    def loss(length: float) -> float:
        latent, _, _ = posterior(seen, groups, loadings, noise * length)
        return float(torch.where(hidden, latent @ loadings.T - centred, 0.0).square().sum())

    return centred.new_tensor(min(LENGTHS, key=loss))
