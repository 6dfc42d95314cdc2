"""Distance of both sides: Wasserstein distances of every entry, and their mean over quantities."""

from collections.abc import Iterable

import numpy as np
import torch
from torch import Tensor

from descentflow.diagnosis.inference.two_sides import Compared

QUANTILES = torch.linspace(0.02, 0.98, 25, dtype=torch.float64)
"""At which distributions are compared: beyond the outermost, a few flights would decide."""


def distances(y: Tensor, real: Tensor, scale: Tensor, counts: Tensor) -> Tensor:
    """Wasserstein distance (p,) of every entry between both sides, in spreads; against zero where there is one side.

    Of counts and lost times, which are zero for most flights, the difference of means (``counts`` (p,) bool): an effect
    moves some flights far and most not at all, which no shift of all flights undoes.

    Example:
        >>> y = torch.cat([torch.linspace(-1, 1, 50), torch.linspace(-1, 1, 50) + 0.5]).double()[:, None]
        >>> distances(y, torch.arange(100) >= 50, torch.ones(1).double(), torch.tensor([False]))
        tensor([0.5000], dtype=torch.float64)
    """
    mine = _quantiles(y[real])
    if bool(real.all()):
        return (mine.mean(0).abs() / scale).nan_to_num(0.0)
    apart = (mine - _quantiles(y[~real])).abs().mean(0)
    means = (y[real].nanmean(0) - y[~real].nanmean(0)).abs()
    return (torch.where(counts, means, apart) / scale).nan_to_num(0.0)


def _quantiles(values: Tensor) -> Tensor:
    """As :func:`torch.nanquantile` of values (n, p) along flights, by NumPy's sort, which takes a fifth of the time."""
    ordered = torch.from_numpy(np.sort(values.T.numpy(), axis=1))
    rank = (values.isfinite().sum(0) - 1).clamp(min=0)[:, None] * QUANTILES
    low, high = (ordered.gather(1, at.long()) for at in (rank.floor(), rank.ceil()))
    return torch.lerp(low, high, rank.frac()).T


def noise_floor(y: Tensor, real: Tensor, dealt: Iterable[Tensor], scale: Tensor, counts: Tensor) -> Tensor:
    """Distance (p,) that two samples of one population of these sizes show: the mean over flights dealt anew.

    What the sides differ by in their means is taken off before they are mixed, or it would blur the floor.

    Args:
        y: (n, p) flights.
        real: (n,) bool.
        dealt: Labellings (n,) of whole aircraft: bool, or signs where there is one side only.
        scale: (p,) spread between flights.
        counts: (p,) entries that are counts.

    Example:
        >>> generator = torch.Generator().manual_seed(0)
        >>> y, real = torch.randn(200, 1, generator=generator).double(), torch.arange(200) >= 100
        >>> dealt = [real[torch.randperm(200, generator=generator)] for _ in range(20)]
        >>> floor = noise_floor(y + 3.0 * real[:, None], real, dealt, torch.ones(1).double(), torch.tensor([False]))
        >>> bool(floor < 0.2)  # three spreads apart: none of it is noise
        True
    """
    one_side = bool(real.all())
    centred = y.clone()
    for side in (real,) if one_side else (real, ~real):
        centred[side] = y[side] - y[side].nanmean(0)
    if one_side:
        found = [distances(centred * signs[:, None], real, scale, counts) for signs in dealt]
    else:
        # A labelling that leaves a slice of the flights on one side says nothing of a distance.
        found = [distances(centred, side, scale, counts) for side in dealt if bool(side.any()) and not bool(side.all())]
    return torch.stack(found).mean(0) if found else torch.zeros_like(scale)


def mean_over_quantities(compared: Compared, values: Tensor, chosen: Tensor) -> Tensor:
    """Mean of the chosen entries' values (..., p) over quantities, each of which counts once.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_sides
        >>> from descentflow.effects import EFFECTS
        >>> sides = example_sides(EFFECTS["temperature"], [10.0])
        >>> ones = torch.ones(len(sides.entries)).double()
        >>> mean_over_quantities(sides, ones, sides.of("tas") | sides.of("rate"))
        tensor(1., dtype=torch.float64)
    """
    parts = []
    for quantity in compared.quantities():
        at = compared.columns(quantity)
        at = at[chosen[at]]
        if len(at):
            parts.append(values[..., at].mean(-1))
    return torch.stack(parts).mean(0) if parts else torch.zeros(values.shape[:-1])
