"""Gaps put into flights, or closed: level-offs, and stretches at a held rate that cleaning cuts out."""

from collections.abc import Mapping
from dataclasses import replace

import torch
from torch import Tensor

from descentflow.core.counter_random import DrawNumbers
from descentflow.core.units import FL_M, FPM_MPS
from descentflow.measurements.level_channels import SHORT_GAP_LEVELS, LevelGrid, gaps_of, lost_in_jumps
from descentflow.surveillance.cleaning.thresholds import Cleaning

FIRST_STREAM = 1_000_000
"""Streams of random numbers from which gaps draw; effects draw from lower ones."""
USUAL_LEVEL_OFF_S = 60.0
"""Length of a level-off where only their total time is known."""
USUAL_STRETCH_FL = 50
"""Levels of a stretch at a held rate."""
MOST_GAPS = 4
"""Gaps of a kind that one flight is given at most."""


def with_gaps(grid: LevelGrid, change: Mapping[str, Tensor], draws: DrawNumbers, cleaning: Cleaning) -> LevelGrid:
    """The flights with more level-offs and held stretches, or less time in those that they have.

    Each flight is given a number of gaps with the mean asked for, at levels drawn within its own; around a level-off go
    the levels that are crossed within the cleaning's transient. Less time is taken off what the flights lose in gaps of
    the kind, by one factor for all.

    Args:
        grid: Flights on levels.
        change: Means over flights (n,) of what is to change, as effects shift it: ``level`` (seconds in level-offs),
            ``level_gaps`` (their number), ``slow`` (seconds lost in longer gaps), ``missing`` (share of the levels that
            these take).
        draws: By which flights and levels are drawn.
        cleaning: Settings by which flights were cleaned.

    Example:
        >>> from descentflow.measurements.quantities import CHANNELS, grid_of
        >>> from descentflow.surveillance.descents.prepared_descents import read_descents
        >>> grid = grid_of(read_descents("descents.parquet").frame, 150, 340, CHANNELS)
        >>> more = {"level": torch.full((120,), 40.0), "level_gaps": torch.full((120,), 0.5)}
        >>> added = with_gaps(grid, more, DrawNumbers(0), Cleaning())
        >>> lost = gaps_of(added)["level"].mean() - gaps_of(grid)["level"].mean()
        >>> abs(float(lost) - 40.0) < 12.0
        True
    """
    with_them, none = grid, torch.zeros(len(grid.time_s), dtype=torch.float64)
    if "level" in change:
        fall_mps = -grid.values["vertical_rate"].nanmedian(1).values * FPM_MPS
        cut = (2 * cleaning.transient_s * fall_mps / FL_M).round().clamp(1, SHORT_GAP_LEVELS - 1)
        number = change.get("level_gaps", none)
        number = number if bool((number > 0).any()) else change["level"] / USUAL_LEVEL_OFF_S
        with_them = _changed(with_them, change["level"], number, cut, draws, stream=FIRST_STREAM, kind="level")
    if "slow" in change or "missing" in change:
        cut = torch.full_like(none, float(USUAL_STRETCH_FL))
        number = change.get("missing", none) * grid.mask.sum(1).double() / USUAL_STRETCH_FL
        seconds = change.get("slow", none)
        with_them = _changed(with_them, seconds, number, cut, draws, stream=FIRST_STREAM + 1000, kind="slow")
    return with_them


def _changed(
    grid: LevelGrid, seconds: Tensor, number: Tensor, cut: Tensor, draws: DrawNumbers, stream: int, kind: str
) -> LevelGrid:
    """More gaps of a kind where their number grows; else only their time changes."""
    n = len(seconds)
    if float(number.mean()) <= 0:
        return _scaled(grid, seconds, kind)
    whole = number.clamp(min=0.0, max=float(MOST_GAPS))
    given = (whole + draws.uniform(n, stream)).floor().long()
    total = max(float(given.sum()), 1.0)
    # So that the mean over flights is what was asked for, whatever number was drawn.
    each = float(seconds.sum()) / total
    for place in range(int(given.max()) if n else 0):
        where = draws.uniform(n, stream + 1 + place)
        grid = _cut(grid, given > place, where, cut, each)
    return grid


def _cut(grid: LevelGrid, rows: Tensor, where: Tensor, cut: Tensor, seconds: float) -> LevelGrid:
    """Levels cut out of some flights (n,) around a place within each (n,), and all below later by some seconds."""
    levels = torch.arange(grid.mask.shape[1]).double()
    low = grid.mask.to(torch.int8).argmax(1)
    high = grid.mask.shape[1] - 1 - grid.mask.flip(1).to(torch.int8).argmax(1)
    room = (high - low - cut - 2).clamp(min=0)
    fits = rows & (room > 0)
    start = (low + 1 + where * room).floor()
    inside = fits[:, None] & (levels >= start[:, None]) & (levels < (start + cut)[:, None])
    below = fits[:, None] & (levels < start[:, None])
    time_s = torch.where(inside, torch.nan, grid.time_s + torch.where(below, seconds, 0.0))
    values = {name: torch.where(inside, torch.nan, value) for name, value in grid.values.items()}
    return replace(grid, time_s=time_s, values=values)


def _scaled(grid: LevelGrid, seconds: Tensor, kind: str) -> LevelGrid:
    """Time lost in gaps of a kind changed by one factor for all, at most to nothing."""
    has = float(gaps_of(grid)[kind].mean())
    if has <= 0:
        return grid
    keep = max(1 + float(seconds.mean()) / has, 0.0)
    _, missing, lost = lost_in_jumps(grid)
    of_kind = (missing <= SHORT_GAP_LEVELS) if kind == "level" else (missing > SHORT_GAP_LEVELS)
    off = torch.where(of_kind & (lost > 0), lost * (1 - keep), 0.0)
    # All below a gap comes earlier by what it loses.
    earlier = off.sum(1, keepdim=True) - off.cumsum(1)
    return replace(grid, time_s=grid.time_s - earlier)
