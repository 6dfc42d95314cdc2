"""Descents flown at another mass than the reference mass."""

from dataclasses import replace

import torch
from torch import Tensor

from descentflow.aircraft_types.aircraft import Aircraft
from descentflow.core.units import FL_M
from descentflow.physics.forces import descent_thrust_n
from descentflow.physics.mass_in_drag import slowness_at_mass
from descentflow.representation.decoder.trajectories import Trajectories


def flown_at(aircraft: Aircraft, flown: Trajectories, mass_kg: Tensor) -> Trajectories:
    """Descents that were flown at the reference mass in standard air, at the same speed with the drag of a mass.

    Rates are exact at levels; the time between two levels is that at the reference mass times the mean of both levels'
    ratio of slowness, see :func:`~descentflow.representation.decoder.flown_air.flown_in`.

    Args:
        aircraft: Coefficients that flew them.
        flown: n descents, with drag at the reference mass.
        mass_kg: (n,).

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> model = load_model("best.ckpt")
        >>> decoder = model.representation.decoder
        >>> flown = decoder(model.sample(2, seed=0))
        >>> heavy = flown_at(decoder.aircraft, flown, torch.tensor([70e3, 70e3]))
        >>> bool((heavy.time_s[:, 0] > flown.time_s[:, 0]).all())
        True
    """
    altitude_m, mass = (flown.levels_fl * FL_M).to(flown.cas_mps), mass_kg.to(flown.cas_mps)
    thrust = descent_thrust_n(aircraft, altitude_m, flown.tas_mps)
    drag, slower = slowness_at_mass(aircraft, flown.drag_n, thrust, flown.cas_mps, altitude_m, mass)
    return replace(slowed(flown, slower), drag_n=drag)


def slowed(flown: Trajectories, slower: Tensor) -> Trajectories:
    """Descents at other rates: those they had over ``slower`` (n, L), with the times that follow.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> model = load_model("best.ckpt")
        >>> flown = model.representation.decoder(model.sample(2, seed=0))
        >>> twice = slowed(flown, torch.full_like(flown.rate_mps, 2.0))
        >>> torch.allclose(twice.time_s[:, 0], 2 * flown.time_s[:, 0])
        True
    """
    legs = (flown.time_s[:, :-1] - flown.time_s[:, 1:]) * (slower[:, 1:] + slower[:, :-1]) / 2
    climbed = torch.nn.functional.pad(legs.cumsum(1), (1, 0))
    time_s = climbed.gather(1, flown.entry[:, None].to(climbed.device)) - climbed
    return replace(flown, time_s=time_s, rate_mps=flown.rate_mps / slower)
