"""Motion by what aircraft report: airspeed along the track, and turns with the induced drag that their bank adds."""

import math

import torch
from torch import Tensor

from descentflow.core.constants import G0_MPS2
from descentflow.core.units import FPM_MPS, KT_MPS
from descentflow.measurements.level_channels import LevelGrid
from descentflow.physics.airspeed import cas_to_mach, mach_to_tas_mps

FOR_AIR = ("IAS", "groundspeed", "track", "heading")
"""Channels by which a flight measures what the air adds to its speed."""


def level_part_kt(seen: dict[str, Tensor]) -> Tensor:
    """Horizontal part (n, L) of the true airspeed: a steeper descent must not pass for wind.

    Example:
        >>> float(level_part_kt({"TAS": torch.tensor(400.0), "vertical_rate": torch.tensor(-4051.0)}).round())
        398.0
    """
    fall_kt = seen["vertical_rate"] * FPM_MPS / KT_MPS
    return (seen["TAS"] ** 2 - fall_kt**2).clamp(min=0.0).sqrt()


def drift_cosine(seen: dict[str, Tensor]) -> Tensor:
    """Cosine (n, L) of the angle between heading and track; one where they are not reported.

    Example:
        >>> angles = {"heading": torch.tensor(350.0), "track": torch.tensor(10.0)}
        >>> round(float(drift_cosine({"TAS": torch.tensor(400.0), **angles})), 2)
        0.94
    """
    if "track" not in seen or "heading" not in seen:
        return torch.ones_like(seen["TAS"])
    cosine = torch.cos(torch.deg2rad(seen["heading"] - seen["track"]))
    return torch.where(cosine.isfinite(), cosine, 1.0)


def speed_by_air_kt(seen: dict[str, Tensor], altitude_m: Tensor) -> Tensor:
    r"""Speed over the ground along the heading beyond the true airspeed in standard air (n, L), without turns.

    By its change with altitude the air gives or takes energy, whatever part wind and temperature have in it. With the
    velocity over the ground :math:`G`, the wind :math:`W` and the unit vectors :math:`v` along the heading and
    :math:`n` to its right, :math:`dW \cdot v = d(G \cdot v) - (G \cdot n)\,d\psi - dV`: a turn in a steady wind changes
    :math:`G \cdot v`, and no energy. Calibrated airspeed gives V, for it has the finer steps.

    Args:
        seen: Channels (n, L), those of :data:`FOR_AIR` among them.
        altitude_m: (L,) pressure altitude, ascending.

    Example:
        >>> turn = {"heading": torch.tensor([[80.0, 90.0]]), "track": torch.tensor([[80.0, 90.0]])}
        >>> flown = {"IAS": torch.tensor([[0.0, 0.0]]), "groundspeed": torch.tensor([[30.0, 50.0]]), **turn}
        >>> speed_by_air_kt({name: x.double() for name, x in flown.items()}, torch.tensor([0.0, 30.0]).double())
        tensor([[30., 50.]], dtype=torch.float64)
    """
    drift = torch.deg2rad(seen["track"] - seen["heading"])
    along, across = seen["groundspeed"] * torch.cos(drift), seen["groundspeed"] * torch.sin(drift)
    known = across.isfinite()
    last = torch.where(known, torch.arange(known.shape[1]), -1).cummax(1).values.clamp(min=0)
    heading, across = (values.gather(1, last) for values in (torch.deg2rad(seen["heading"]), across))
    turned = torch.remainder(heading.diff(dim=1) + torch.pi, 2 * torch.pi) - torch.pi
    by_turns = ((across[:, 1:] + across[:, :-1]) / 2 * turned).nan_to_num(0.0).cumsum(1)
    standard = mach_to_tas_mps(cas_to_mach(seen["IAS"] * KT_MPS, altitude_m), altitude_m) / KT_MPS
    return along - torch.nn.functional.pad(by_turns, (1, 0)) - standard


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
