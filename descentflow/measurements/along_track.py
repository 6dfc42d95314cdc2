"""Airspeed along the track, from what aircraft report."""

import torch
from torch import Tensor

from descentflow.core.units import FPM_MPS, KT_MPS


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
