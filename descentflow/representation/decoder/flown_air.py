"""Descents flown in another air than the standard one."""

from dataclasses import replace

import torch

from descentflow.air.energy_in_air import in_air, rate_in_air
from descentflow.air.level_air import LevelAir
from descentflow.core.units import FL_M
from descentflow.physics.performance_model import PerformanceModel
from descentflow.representation.decoder.trajectories import Trajectories


def flown_in(aircraft: PerformanceModel, flown: Trajectories, air: LevelAir) -> Trajectories:
    """Descents that were flown in standard air, at the same CAS and drag in the air of each.

    Rates are exact at levels. The time between two levels is that of standard air, jumps of the rate included, times
    the mean of both levels' ratio of slowness: within 0.05 s of a descent from FL350, for the ratio hardly jumps.

    Args:
        aircraft: Coefficients that flew them; its reference mass is the mass.
        flown: n descents.
        air: Of the n descents, or one for all, on their levels.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> model = load_model("best.ckpt")
        >>> decoder = model.representation.decoder
        >>> flown = decoder(model.sample(5, seed=0))
        >>> warm = flown_in(decoder.aircraft, flown, LevelAir.uniform(decoder.levels_fl, deviation_k=10.0))
        >>> directly = decoder(model.sample(5, seed=0), deviation_k=torch.tensor(10.0))
        >>> torch.allclose(warm.rate_mps, directly.rate_mps), bool((warm.time_s - directly.time_s).abs().max() < 0.05)
        (True, True)
    """
    altitude_m = (flown.levels_fl * FL_M).to(flown.cas_mps)
    found = in_air(aircraft, flown.cas_mps, altitude_m, air)
    rate = rate_in_air(aircraft, flown.rate_mps, flown.drag_n, found)
    tas = flown.tas_mps * found.tas_mps / found.standard_tas_mps
    slower = flown.rate_mps / rate
    legs = (flown.time_s[:, :-1] - flown.time_s[:, 1:]) * (slower[:, 1:] + slower[:, :-1]) / 2
    climbed = torch.nn.functional.pad(legs.cumsum(1), (1, 0))
    time_s = climbed.gather(1, flown.entry[:, None].to(climbed.device)) - climbed
    return replace(flown, time_s=time_s, tas_mps=tas, rate_mps=rate)
