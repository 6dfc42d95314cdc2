"""Short-scale noise added to reports, so much that their measured noise grows by a factor."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import torch
from torch import Tensor

from descentflow.core.units import FPM_MPS
from descentflow.measurements.level_channels import NAMED, LevelGrid, least_noise, short_scale_noise

LEAST_GROWTH = 0.05
"""Logarithm of a factor from which noise is added: less than that is none to a simulator that has none."""
OF_A_STENCIL = 1.5
"""Variance of a report minus the mean of two others, in the variance of independent reports."""


def with_noise(grid: LevelGrid, ln_ratio: Mapping[str, Tensor], seed: int) -> LevelGrid:
    """The flights with noisier reports; a flight whose noise would have to shrink keeps its own.

    Independent noise of variance v adds 1.5 v to the variance that
    :func:`~descentflow.measurements.level_channels.short_scale_noise` measures: so much is added to each flight that
    its own noise m, or the least that is measured where it has less or none, becomes m exp(ln_ratio).

    Args:
        grid: Flights on levels.
        ln_ratio: Name of a noise (``rate``, ``cas``, ..., ``altitude``) -> (n,) logarithm of its factor.
        seed: Of the noise.

    Example:
        >>> from descentflow.measurements.quantities import CHANNELS, grid_of
        >>> from descentflow.surveillance.descents.prepared_descents import read_descents
        >>> grid = grid_of(read_descents("descents.parquet").frame, 150, 340, CHANNELS)
        >>> noisier = with_noise(grid, {"cas": torch.full((120,), 0.7)}, seed=0)
        >>> change = short_scale_noise(noisier)["noise_cas"] - short_scale_noise(grid)["noise_cas"]
        >>> abs(float(change.nanmean()) - 0.7) < 0.05
        True
    """
    if not ln_ratio:
        return grid
    own, generator = short_scale_noise(grid, least=False), np.random.default_rng(seed)
    values, time_s = dict(grid.values), grid.time_s
    for name, ratio in ln_ratio.items():
        if f"noise_{name}" not in own:
            continue
        has = own[f"noise_{name}"].exp()
        wanted = torch.where(ratio > LEAST_GROWTH, has.clamp(min=least_noise(name)) * ratio.exp(), has)
        size = ((wanted.square() - has.square()).clamp(min=0.0) / OF_A_STENCIL).sqrt()
        drawn = torch.from_numpy(generator.standard_normal(tuple(time_s.shape))) * size.nan_to_num(0.0)[:, None]
        if name == "altitude":
            fall = (-values["vertical_rate"] * FPM_MPS).nanmedian(1, keepdim=True).values.clamp(min=1.0)
            time_s = _falling(time_s + drawn / fall)
        else:
            values[NAMED[name]] = values[NAMED[name]] + drawn
    return replace(grid, values=values, time_s=time_s)


def _falling(time_s: Tensor) -> Tensor:
    """Times that fall with the level: a level that would be crossed before a higher one is crossed with it."""
    latest = torch.where(time_s.isfinite(), time_s, -torch.inf).flip(1).cummax(1).values.flip(1)
    return torch.where(time_s.isfinite(), latest, torch.nan)
