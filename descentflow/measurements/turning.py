"""Turning of flights: the induced drag that a bank adds, from the change of heading over time."""

import math

import torch
from torch import Tensor

from descentflow.core.constants import G0_MPS2
from descentflow.core.units import KT_MPS
from descentflow.measurements.level_channels import LevelGrid

DIRECTIONS = (("heading", "TAS"), ("track", "groundspeed"))
"""Direction of the motion, and its speed; the first through the air, which a wind does not turn."""
STEPS = 6
"""Steps from level to level about a level, some 18 s, in which the direction changes: headings that are one degree off
then pass for a bank of 2 degrees, which adds a thousandth to induced drag."""
MOST_BANK_DEG = 35.0
"""More is a misread direction and no turn: autopilots bank by 30 degrees at most, and ground proximity warning systems
call out a bank from 35 degrees."""


def induced_by_turns(grid: LevelGrid) -> Tensor | None:
    r"""Share (n, L) by which turns raise the induced drag of flights, NaN where their direction is not known.

    In a coordinated turn at the bank :math:`\phi` the direction :math:`\psi` changes by :math:`\tan\phi = V \dot\psi /
    g`; lift is :math:`n = 1 / \cos\phi` times the weight and induced drag grows with its square, by
    :math:`n^2 - 1 = \tan^2\phi`.

    Returns:
        None where no flight reports a direction with its speed.

    Example:
        >>> from descentflow.surveillance.descents.prepared_descents import read_descents
        >>> names = ["IAS", "vertical_rate", "heading", "TAS"]
        >>> grid = LevelGrid.of_frame(read_descents("descents.parquet").frame, 150, 340, names)
        >>> bool(induced_by_turns(grid).nanmean() < 0.001)  # these flights keep their heading
        True
    """
    known = [pair for pair in DIRECTIONS if pair[0] in grid.values and pair[1] in grid.values]
    raised = None
    for direction, speed in known:
        by_this = _tan_bank(grid, grid.values[direction], grid.values[speed] * KT_MPS).square()
        raised = by_this if raised is None else torch.where(raised.isfinite(), raised, by_this)
    return raised


def _tan_bank(grid: LevelGrid, direction_deg: Tensor, speed_mps: Tensor) -> Tensor:
    """Tangent (n, L) of the bank that the change of a direction takes."""
    turned = (direction_deg[:, :-1] - direction_deg[:, 1:] + 180.0) % 360.0 - 180.0
    lasted = grid.time_s[:, :-1] - grid.time_s[:, 1:]
    seen = turned.isfinite() & lasted.isfinite() & (lasted > 0)
    both = torch.stack([torch.where(seen, turned, 0.0), torch.where(seen, lasted, 0.0), seen.to(lasted)])
    # Sums over the steps about each level.
    angle, elapsed, count = torch.nn.functional.pad(both, (STEPS // 2, STEPS // 2)).unfold(2, STEPS, 1).sum(-1)
    per_s = torch.deg2rad(angle) / torch.where(count >= STEPS // 2, elapsed, torch.nan)
    tangent = speed_mps * per_s / G0_MPS2
    return torch.where(tangent.atan().abs() <= math.radians(MOST_BANK_DEG), tangent, torch.nan)
