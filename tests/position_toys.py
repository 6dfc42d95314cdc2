"""Descents whose distances are known in closed form."""

import torch

from descentflow.representation.decoder.trajectories import Trajectories


def steady_descents(tas_mps: list[float], rate_mps: float = -10.0, entry: int = 200) -> Trajectories:
    """One descent for each airspeed, from FL350 (or another entry) to FL150, at constant airspeed and rate."""
    levels = torch.arange(150, 351, dtype=torch.float64)
    shape = (len(tas_mps), len(levels))
    tas = torch.tensor(tas_mps, dtype=torch.float64)[:, None].expand(shape)
    rate = torch.full(shape, rate_mps, dtype=torch.float64)
    time = ((levels[entry] - levels) * 30.48 / -rate_mps).expand(shape)
    filler = torch.full(shape, 0.7, dtype=torch.float64)
    return Trajectories(levels, torch.full((len(tas),), entry), time, tas, filler, tas, rate, filler)
