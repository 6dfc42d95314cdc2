"""Gap of a corrected simulator, judged by its flights beside those of the true effect."""

from pathlib import Path
from typing import Any, Final

import polars as pl
import torch
from torch import Tensor

from descentflow.aircraft_types.registry import aircraft as find_aircraft
from descentflow.evaluation.metrics.descent_set import DescentSet
from descentflow.representation.profiles import profiles_from_frame
from descentflow.surveillance.descents.prepared_descents import read_descents
from descentflow.surveillance.prepare import prepare

CLOSABLE: Final = 0.1
"""Standard deviations by which the true effect comes closer at a level where it acts; less is lost in the chance of
who flies: operators go by aircraft, and a hundred aircraft leave some knots between two fleets."""
MIN_CELLS: Final = 10
"""Levels of CAS and rate at which it has to act to be judged."""
MIN_FLIGHTS: Final = 50
"""Flights at a level for it to count."""
_QUANTILES: Final = torch.linspace(0.01, 0.99, 50, dtype=torch.float64)


def closing(rows: Path, simulator: Path, corrected: Path, true: Path, typecode: str) -> dict[str, Any]:
    """Distances of a simulator's flights from real ones, before and after correction, and with the true effect.

    The distance is the Wasserstein distance of CAS, and of rate, at every level, in standard deviations of the flights;
    it uses nothing of the diagnosis. The true effect's flights are the simulator's own, flown again with that effect.
    Compared is where these come closer: a window's effect would be lost in the mean over all levels.

    Args:
        rows: The real flights.
        simulator: Prepared descents of the simulator that was diagnosed.
        corrected: The same with the causes that were named.
        true: The same with the effect that was planted.
        typecode: Type whose coefficients the descents are read with; speeds and rates do not depend on them.

    Returns:
        Mean ``before``, ``after`` and ``true`` distances over the ``cells`` (levels of CAS and of rate) where the true
        effect acts, and ``of_true``: the share of what it closes there (None where it acts hardly anywhere).

    Example:
        >>> same = Path("descents.parquet")  # a correction that changes nothing closes nothing
        >>> closing(Path("rows.parquet"), same, same, same, "A320")["cells"]
        0
    """
    frames = {
        name: read_descents(path).frame for name, path in (("before", simulator), ("after", corrected), ("true", true))
    }
    bottom = int(frames["before"]["level_fl"].cast(pl.Int64).min())  # type: ignore[arg-type]
    top = int(frames["before"]["level_fl"].cast(pl.Int64).max())  # type: ignore[arg-type]
    aircraft = find_aircraft(typecode)

    def of(frame: pl.DataFrame) -> DescentSet:
        return DescentSet.of_profiles(profiles_from_frame(frame, aircraft, bottom, top))

    real = of(prepare(rows, bottom_fl=bottom).frame)
    found = {name: _distances(real, of(frame)) for name, frame in frames.items()}
    closable = found["before"] - found["true"]
    acts = closable >= CLOSABLE
    of_true = None
    if int(acts.sum()) >= MIN_CELLS:
        of_true = float((found["before"] - found["after"])[acts].sum() / closable[acts].sum())
    means = {name: float(cells[acts].mean()) if bool(acts.any()) else None for name, cells in found.items()}
    return {**means, "cells": int(acts.sum()), "of_true": of_true}


def _distances(real: DescentSet, made: DescentSet) -> Tensor:
    """Scaled Wasserstein distances of CAS and rate at every level; NaN where too few are seen."""
    parts = []
    for name in ("cas_mps", "rate_mps"):
        mine = torch.where(real.mask, getattr(real, name).double(), torch.nan)
        other = torch.where(made.mask, getattr(made, name).double(), torch.nan)
        enough = (mine.isfinite().sum(0) >= MIN_FLIGHTS) & (other.isfinite().sum(0) >= MIN_FLIGHTS)
        gap = (torch.nanquantile(mine, _QUANTILES, dim=0) - torch.nanquantile(other, _QUANTILES, dim=0)).abs().mean(0)
        centred = mine - mine.nanmean(0)
        parts.append(torch.where(enough, gap / centred.square().nanmean(0).sqrt(), torch.nan))
    return torch.cat(parts)
