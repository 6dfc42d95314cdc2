"""Whether a corrected simulator really comes closer: judged by what it generates, beside the true effect."""

from pathlib import Path
from typing import Any, Final

import torch
from torch import Tensor

from descentflow.densities.checkpoint import load_model
from descentflow.evaluation.metrics.descent_set import DescentSet
from descentflow.generation.rejection import sample_descents
from descentflow.representation.profiles import Profiles, profiles_from_frame
from descentflow.surveillance.prepare import prepare

SAMPLES: Final = 2000
CLOSABLE: Final = 0.1
"""Standard deviations by which the true effect comes closer at a level where it acts; less is lost in the chance of
who flies: operators go by aircraft, and a hundred aircraft leave some knots between two fleets."""
MIN_CELLS: Final = 10
"""Levels of CAS and rate at which it has to act to be judged."""
MIN_FLIGHTS: Final = 50
"""Flights at a level for it to count."""
_QUANTILES: Final = torch.linspace(0.01, 0.99, 50, dtype=torch.float64)


def closing(rows: Path, simulator: Path, corrected: Path, true: Path) -> dict[str, Any]:
    """Distances of generated descents from the flights, before and after correction, and with the true effect.

    The distance is the Wasserstein distance of CAS, and of rate, at every level, in standard deviations of the flights;
    it uses nothing of the diagnosis. The true effect's simulator was trained on the same aircraft with that effect.
    Compared is where that one comes closer: a window's effect would be lost in the mean over all levels.

    Args:
        rows: The flights.
        simulator: Checkpoint that was diagnosed.
        corrected: The same with the causes that were named.
        true: Checkpoint trained with the effect.

    Returns:
        Mean ``before``, ``after`` and ``true`` distances over the ``cells`` (levels of CAS and of rate) where the true
        effect acts, and ``of_true``: the share of what it closes there (None where it acts hardly anywhere).

    Example:
        >>> same = Path("best.ckpt")  # a correction that changes nothing closes nothing
        >>> closing(Path("rows.parquet"), same, same, same)["cells"]
        0
    """
    models = {"before": load_model(simulator), "after": load_model(corrected), "true": load_model(true)}
    decoders = [model.representation.decoder for model in models.values()]
    bottom = max(int(decoder.levels_fl[0]) for decoder in decoders)
    top = min(int(decoder.levels_fl[-1]) for decoder in decoders)
    frame = prepare(rows, bottom_fl=bottom).frame
    found: dict[str, Tensor] = {}
    for name, model in models.items():
        parts = model.representation
        grid = profiles_from_frame(
            frame, parts.decoder.aircraft, int(parts.decoder.levels_fl[0]), int(parts.decoder.levels_fl[-1])
        )
        samples = sample_descents(
            model, parts.decoder, parts.plausibility, SAMPLES, 0, entry=_padded(grid, parts.decoder.levels_fl)
        )
        generated = DescentSet.of_trajectories(samples.trajectories)
        found[name] = _distances(DescentSet.of_profiles(grid), generated, bottom, top)
    closable = found["before"] - found["true"]
    acts = closable >= CLOSABLE
    of_true = None
    if int(acts.sum()) >= MIN_CELLS:
        of_true = float((found["before"] - found["after"])[acts].sum() / closable[acts].sum())
    means = {name: float(cells[acts].mean()) if bool(acts.any()) else None for name, cells in found.items()}
    return {**means, "cells": int(acts.sum()), "of_true": of_true}


def _padded(grid: Profiles, levels_fl: Tensor) -> Tensor:
    """Entry levels of the flights, within the decoder's grid."""
    return grid.entry_level.clamp(max=len(levels_fl) - 1)


def _distances(real: DescentSet, generated: DescentSet, bottom: int, top: int) -> Tensor:
    """Scaled Wasserstein distances of CAS and rate at the levels from bottom to top; NaN where too few are seen."""
    at_real, at_made = (_levels(one.levels_fl, bottom, top) for one in (real, generated))
    parts = []
    for name in ("cas_mps", "rate_mps"):
        mine = torch.where(real.mask, getattr(real, name).double(), torch.nan)[:, at_real]
        made = torch.where(generated.mask, getattr(generated, name).double(), torch.nan)[:, at_made]
        enough = (mine.isfinite().sum(0) >= MIN_FLIGHTS) & (made.isfinite().sum(0) >= MIN_FLIGHTS)
        gap = (torch.nanquantile(mine, _QUANTILES, dim=0) - torch.nanquantile(made, _QUANTILES, dim=0)).abs().mean(0)
        centred = mine - mine.nanmean(0)
        parts.append(torch.where(enough, gap / centred.square().nanmean(0).sqrt(), torch.nan))
    return torch.cat(parts)


def _levels(levels_fl: Tensor, bottom: int, top: int) -> Tensor:
    return (levels_fl >= bottom) & (levels_fl <= top)
