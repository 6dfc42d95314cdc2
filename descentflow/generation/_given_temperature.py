"""The temperature that a context gives: true airspeed in it, and no second temperature.

A model that was fitted with the context ``deviation_k`` and drag in standard air has learnt what temperature does to
the rate: its drag holds it. CAS, Mach number, rate and time of its samples are those of the context's air as they are.
True airspeed is not, for the decoder flies in standard air: at the same Mach number it goes with the root of the
temperature, and distances and groundspeed go with it.
"""

from dataclasses import replace

import torch
from torch import Tensor

from descentflow.core.units import FL_M
from descentflow.physics.atmosphere import isa_temperature_k
from descentflow.representation.decoder.trajectories import Trajectories
from descentflow.representation.representation import Representation

NAME = "deviation_k"
"""The column of a context that is a temperature: K from the standard atmosphere."""


def gives_temperature(representation: Representation) -> bool:
    """True if samples have the true airspeed of their context's temperature.

    Not where descents are flown in an air of their own in another way: by a model of drag in its flights' own air, and
    by a correction, which gives them the airspeed of the real flights' air.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> gives_temperature(load_model("best.ckpt").representation)
        False
    """
    own = representation.air is not None or representation.correction is not None
    return not own and any((column.name, column.kind) == (NAME, "number") for column in representation.context.columns)


def given_deviation_k(representation: Representation, encoded: Tensor) -> Tensor:
    """Temperature deviations (m,) of encoded contexts (m, c), zero where one is missing or none is given.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> given_deviation_k(load_model("best.ckpt").representation, torch.zeros(1, 0))
        tensor([0.], dtype=torch.float64)
    """
    place, deviation_k = 0, torch.zeros(len(encoded), dtype=torch.float64)
    for column in representation.context.columns if gives_temperature(representation) else ():
        if column.name == NAME:
            deviation_k = encoded[:, place].detach().cpu().double() * column.scale + column.mean
            return torch.where(encoded[:, place + 1].cpu() > 0, 0.0, deviation_k) if column.indicator else deviation_k
        place += column.width
    return deviation_k


def in_given_air(flown: Trajectories, deviation_k: Tensor) -> Trajectories:
    """Descents (n) with the true airspeed of their Mach number at temperature deviations (n,).

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> model = load_model("best.ckpt")
        >>> flown = model.representation.decoder(model.sample(2, seed=0))
        >>> warm = in_given_air(flown, torch.tensor([0.0, 10.0]))
        >>> (warm.tas_mps / flown.tas_mps)[:, 0].round(decimals=3)
        tensor([1.0000, 1.0190], dtype=torch.float64)
    """
    if not bool(deviation_k.any()):
        return flown
    share = deviation_k[:, None] / isa_temperature_k(flown.levels_fl.cpu().double() * FL_M)
    return replace(flown, tas_mps=flown.tas_mps * (1 + share).sqrt().to(flown.tas_mps))
