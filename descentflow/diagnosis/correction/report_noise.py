"""Short-scale noise added to reports, so much that their measured noise grows by a factor."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import torch
from torch import Tensor

from descentflow.core.units import FPM_MPS
from descentflow.measurements.level_channels import LevelGrid, short_scale_noise

CHANNELS = {"rate": "vertical_rate", "cas": "IAS", "mach": "Mach", "tas": "TAS", "groundspeed": "groundspeed"}
"""Name of a noise -> the channel that has it; that of the altitude is in the times at which levels are crossed."""
OF_A_STENCIL = 1.5
"""Variance of a report minus the mean of two others, in the variance of independent reports."""


def with_noise(grid: LevelGrid, ln_ratio: Mapping[str, Tensor], seed: int) -> LevelGrid:
    """The flights with noisier reports; a flight whose noise would have to shrink keeps its own.

    Independent noise of variance v adds 1.5 v to the variance that
    :func:`~descentflow.measurements.level_channels.short_scale_noise` measures: so much is added to each flight that
    its own noise m becomes m exp(ln_ratio).

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
    own, generator = short_scale_noise(grid), np.random.default_rng(seed)
    values, time_s = dict(grid.values), grid.time_s
    for name, ratio in ln_ratio.items():
        if f"noise_{name}" not in own:
            continue
        size = own[f"noise_{name}"].exp() * (((2 * ratio).exp() - 1).clamp(min=0.0) / OF_A_STENCIL).sqrt()
        drawn = torch.from_numpy(generator.standard_normal(tuple(time_s.shape))) * size.nan_to_num(0.0)[:, None]
        if name == "altitude":
            fall = (-values["vertical_rate"] * FPM_MPS).nanmedian(1, keepdim=True).values.clamp(min=1.0)
            time_s = _falling(time_s + drawn / fall)
        else:
            values[CHANNELS[name]] = values[CHANNELS[name]] + drawn
    return replace(grid, values=values, time_s=time_s)


def _falling(time_s: Tensor) -> Tensor:
    """Times that fall with the level: a level that would be crossed before a higher one is crossed with it."""
    latest = torch.where(time_s.isfinite(), time_s, -torch.inf).flip(1).cummax(1).values.flip(1)
    return torch.where(time_s.isfinite(), latest, torch.nan)
