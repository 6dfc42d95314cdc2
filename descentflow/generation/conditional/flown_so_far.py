"""Flown part of a flight, from a table of its levels."""

from collections.abc import Mapping
from typing import Annotated, Any

import numpy as np
import polars as pl
import torch

from descentflow.core.errors import DataError
from descentflow.core.units import FPM_MPS, KT_MPS
from descentflow.representation.decoder.descent_decoder import DescentDecoder
from descentflow.representation.plausibility import Plausibility
from descentflow.representation.profiles import Profiles, profiles_with_drag

FlownSoFar = Annotated[pl.DataFrame | Mapping[str, Any], "a table of levels, or its columns by name"]
"""Columns ``level_fl``, ``CAS`` (kt; or ``IAS``) and ``vertical_rate`` (ft/min, negative), a row for each level."""


def flown_so_far(decoder: DescentDecoder, flown: FlownSoFar, bounds: Plausibility | None = None) -> Profiles:
    """One flight on a decoder's grid, its mask true at the levels flown; drag is inferred from the rate.

    Args:
        decoder: Whose aircraft flies, on whose grid. Levels beyond it are left out.
        flown: A table of levels, or its columns by name.
        bounds: Of the training flights. What lies further outside of them than they are wide, at most levels, has other
            units or is of another aircraft. Nothing of the kind is looked for if absent.

    Raises:
        DataError: If a column is absent, a number cannot be, no level lies on the grid, a level comes
            twice, it does not descend, or is far out of the bounds.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> seen = {"level_fl": [330, 329, 328, 327, 326], "CAS": [280.0] * 5, "vertical_rate": [-1500.0] * 5}
        >>> one = flown_so_far(load_model("best.ckpt").representation.decoder, seen)
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
    _check_one_descent(level, rate_fpm)
    grid = decoder.levels_fl.detach().cpu().numpy()
    on = (level >= grid[0] - 0.5) & (level <= grid[-1] + 0.5)
    index = np.abs(level[on, None] - grid).argmin(1)
    mask = np.zeros((1, len(grid)), dtype=bool)
    mask[0, index] = True
    if not mask.any():
        raise DataError(
            f"no flown level on FL{grid[0]:.0f} to FL{grid[-1]:.0f}",
            expected="at least one",
            mend="give a level of the flight that the model has, or entry_fl alone",
        )
    cas, rate = np.full((1, len(grid)), 250.0), np.full((1, len(grid)), -1500.0)
    cas[0, index], rate[0, index] = cas_kt[on], rate_fpm[on]
    cas_mps, rate_mps = torch.from_numpy(cas * KT_MPS), torch.from_numpy(rate * FPM_MPS)
    seen, levels, time_s = torch.from_numpy(mask), decoder.levels_fl.cpu(), torch.zeros_like(cas_mps)
    so_far = profiles_with_drag(decoder.aircraft, ("flown",), levels, time_s, cas_mps, rate_mps, seen)
    if bounds is not None:
        _check_units(so_far, bounds)
    return so_far


def _check_one_descent(level: np.ndarray, rate_fpm: np.ndarray) -> None:
    each, times = np.unique(level, return_counts=True)
    if (times > 1).any():
        raise DataError(
            f"flown levels that come twice, FL{each[times > 1][0]:g} among them",
            expected="one flight, a row for each level",
            mend="pass the rows of one flight alone",
        )
    if len(rate_fpm) and np.median(rate_fpm) >= 0:
        raise DataError(
            f"flown vertical_rate of {np.median(rate_fpm):+.0f} ft/min (median)",
            expected="ft/min, negative in a descent",
            mend="change its sign, or wait until the aircraft descends",
        )


def _check_units(so_far: Profiles, bounds: Plausibility) -> None:
    """Half the slowest rate, or further outside than the bounds are wide at most levels: m/s, or another aircraft."""
    seen = so_far.mask[0].cpu()
    rate, slowest = so_far.rate_mps[0].cpu()[seen].median(), bounds.slowest_rate_mps.cpu()
    if rate > slowest / 2:
        raise DataError(
            f"flown vertical_rate of {rate / FPM_MPS:.0f} ft/min (median) where no training flight had more than "
            f"{slowest / FPM_MPS:.0f}",
            expected="ft/min, of an aircraft that descends",
            mend="convert the column, or wait until the aircraft descends",
        )
    quantities = (
        ("CAS", "kt", KT_MPS, so_far.cas_mps, bounds.cas_low, bounds.cas_high),
        ("drag from CAS and vertical_rate", "kN", 1000.0, so_far.drag_n, bounds.drag_low, bounds.drag_high),
    )
    for name, unit, size, values, low, high in quantities:
        mine, low, high = (v.cpu()[seen] / size for v in (values[0], low, high))
        outside = ((low - mine) > high - low) | ((mine - high) > high - low)
        if outside.double().mean() > 0.5:
            raise DataError(
                f"flown {name} of {mine.median():.0f} {unit} (median) where the training flights had "
                f"{low.median():.0f} to {high.median():.0f}",
                expected="CAS in kt and vertical_rate in ft/min, of an aircraft of the model's type",
                mend="convert the columns, or take the model of this type",
            )


def _column(values: Any, name: str) -> np.ndarray:
    try:
        numbers = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError):
        numbers = np.array([np.nan])
    if numbers.ndim != 1 or not np.isfinite(numbers).all() or (name in ("CAS", "IAS") and (numbers <= 0).any()):
        raise DataError(
            f"flown {name} that is no list of numbers, or holds one that no aircraft flies",
            expected="finite numbers, speeds above zero",
            mend="leave those levels out",
        )
    return numbers
