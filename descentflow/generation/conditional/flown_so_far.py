"""What a flight has flown so far, from a table of its levels."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import polars as pl
import torch

from descentflow.core.errors import DataError
from descentflow.core.units import FPM_MPS, KT_MPS
from descentflow.generation.prediction.predictor import MIN_LEVELS
from descentflow.representation.decoder.descent_decoder import DescentDecoder
from descentflow.representation.profiles import Profiles, observed_profiles

FlownSoFar = pl.DataFrame | Mapping[str, Sequence[float]]
"""Columns ``level_fl``, ``CAS`` (kt; or ``IAS``) and ``vertical_rate`` (ft/min, negative), a row for each level."""


def flown_so_far(decoder: DescentDecoder, flown: FlownSoFar) -> Profiles:
    """One flight on a decoder's grid, its mask true at the levels flown; drag is inferred from the rate.

    Args:
        decoder: Whose aircraft flies, on whose grid. Levels beyond it are left out.
        flown: A table of levels, or its columns by name.

    Raises:
        DataError: If a column is absent, a number cannot be, or fewer than five levels lie on the grid.

    Example:
        >>> from descentflow.representation.read_checkpoint import load_representation
        >>> seen = {"level_fl": [330, 329, 328, 327, 326], "CAS": [280.0] * 5, "vertical_rate": [-1500.0] * 5}
        >>> one = flown_so_far(load_representation("best.ckpt").decoder, seen)
        >>> int(one.mask.sum()), int(one.entry_level)
        (5, 180)
    """
    names = flown.columns if isinstance(flown, pl.DataFrame) else list(flown)
    speed = "CAS" if "CAS" in names else "IAS"
    absent = [name for name in ("level_fl", speed, "vertical_rate") if name not in names]
    if absent:
        raise DataError(
            f"flown levels without {', '.join('CAS' if name == 'IAS' else name for name in absent)}",
            expected="columns level_fl, CAS (kt) and vertical_rate (ft/min), as tables of samples have them",
            mend="name the columns so",
        )
    level, cas_kt, rate_fpm = (_column(flown[name], name) for name in ("level_fl", speed, "vertical_rate"))
    if not len(level) == len(cas_kt) == len(rate_fpm):
        raise DataError("flown columns of different lengths", expected="a number for each level", mend="correct them")
    grid = decoder.levels_fl.detach().cpu().numpy()
    on = (level >= grid[0] - 0.5) & (level <= grid[-1] + 0.5)
    index = np.abs(level[on, None] - grid).argmin(1)
    mask = np.zeros((1, len(grid)), dtype=bool)
    mask[0, index] = True
    if mask.sum() < MIN_LEVELS:
        raise DataError(
            f"{int(mask.sum())} flown levels on FL{grid[0]:.0f} to FL{grid[-1]:.0f}",
            expected=f"at least {MIN_LEVELS}",
            mend="give more levels of the flight, or entry_fl alone",
        )
    cas, rate = np.full((1, len(grid)), 250.0), np.full((1, len(grid)), -1500.0)
    cas[0, index], rate[0, index] = cas_kt[on], rate_fpm[on]
    cas_mps, rate_mps = torch.from_numpy(cas * KT_MPS), torch.from_numpy(rate * FPM_MPS)
    seen, levels, time_s = torch.from_numpy(mask), decoder.levels_fl.cpu(), torch.zeros_like(cas_mps)
    return observed_profiles(decoder.aircraft, ("flown",), levels, time_s, cas_mps, rate_mps, seen, speed=decoder.speed)


def _column(values: Any, name: str) -> np.ndarray:
    try:
        found = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError):
        found = np.array([np.nan])
    if found.ndim != 1 or not np.isfinite(found).all() or (name in ("CAS", "IAS") and (found <= 0).any()):
        raise DataError(
            f"flown {name} that is no list of numbers, or holds one that no aircraft flies",
            expected="finite numbers, speeds above zero",
            mend="leave those levels out",
        )
    return found
