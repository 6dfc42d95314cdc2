"""The temperature that a context gives: true airspeed in it, and no second one beside it.

A model that was fitted with the context ``deviation_k`` and drag in standard air has learnt what temperature does to
the rate: its drag holds it. CAS, Mach number, rate and time of its samples are those of the context's air as they are.
True airspeed is not, for the decoder flies in standard air: at the same Mach number it goes with the root of the
temperature, and distances and groundspeed go with it.
"""

import warnings
from dataclasses import replace

import torch
from torch import Tensor

from descentflow.air.level_air import LevelAir
from descentflow.core.errors import ConfigError, DescentflowWarning
from descentflow.core.units import FL_M
from descentflow.generation.samples import Samples
from descentflow.physics.atmosphere import isa_temperature_k
from descentflow.representation.decoder.trajectories import Trajectories
from descentflow.representation.representation import Representation

NAME = "deviation_k"
"""The column of a context that is a temperature: K from the standard atmosphere."""


def given_deviation_k(representation: Representation, encoded: Tensor | None) -> Tensor | None:
    """Temperature deviations (m,) of encoded contexts (m, c), zero where one is missing; None where none is given.

    None also where descents are flown in another way in an air of their own: by a model of drag in its flights' own
    air, and by a correction, which gives them the airspeed of the real flights' air.

    Example:
        >>> from descentflow.representation.read_checkpoint import load_representation
        >>> given_deviation_k(load_representation("best.ckpt"), None) is None
        True
    """
    encoder = representation.context
    own = representation.air is not None or representation.correction is not None
    if encoder is None or encoded is None or own:
        return None
    place = 0
    for column in encoder.columns:
        if column.name == NAME and column.kind == "number":
            found = encoded[:, place].detach().cpu().double() * column.scale + column.mean
            return torch.where(encoded[:, place + 1].cpu() > 0, 0.0, found) if column.indicator else found
        place += column.width
    return None


def airspeed_ratio(deviation_k: Tensor, levels_fl: Tensor) -> Tensor:
    """True airspeed over that of the same Mach number in standard air: (n, L) of deviations (n,) on levels (L,).

    Example:
        >>> round(float(airspeed_ratio(torch.tensor([15.0]), torch.tensor([250.0]))), 4)
        1.031
    """
    return (1 + deviation_k[:, None] / isa_temperature_k(levels_fl.double() * FL_M)).sqrt()


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
    ratio = airspeed_ratio(deviation_k, flown.levels_fl.cpu()).to(flown.tas_mps)
    return replace(flown, tas_mps=flown.tas_mps * ratio)


def samples_in_given_air(samples: Samples, deviation_k: Tensor) -> Samples:
    """Samples with the true airspeed of their contexts' temperature; sample i has deviation (m,) i modulo m.

    Example:
        >>> from descentflow.generation.sample import sample
        >>> samples = sample("best.ckpt", 3, seed=0)
        >>> warm = samples_in_given_air(samples, torch.tensor([10.0]))
        >>> bool((warm.trajectories.tas_mps > samples.trajectories.tas_mps).all())
        True
    """
    own = deviation_k[torch.arange(len(samples)) % len(deviation_k)]
    found = replace(samples, trajectories=in_given_air(samples.trajectories, own))
    if samples.air is None:
        return found
    wind = samples.air.tailwind_mps
    return replace(found, air=LevelAir(own[:, None].expand(wind.shape).clone(), wind))


def check_one_temperature(deviation_k: Tensor | None, air: LevelAir | None, *, field: bool) -> None:
    """Refuse a temperature beside that of the context, whose rate would have both.

    Args:
        deviation_k: That of the contexts; None if they give none.
        air: What else is asked.
        field: Whether a weather field is asked, which has a temperature.

    Raises:
        ConfigError: If there are two.

    Example:
        >>> check_one_temperature(torch.tensor([15.0]), None, field=False)
        >>> check_one_temperature(torch.tensor([15.0]), LevelAir.uniform(torch.arange(150, 351), 15.0), field=False)
        Traceback (most recent call last):
        descentflow.core.errors.ConfigError: a temperature of the air beside the context's deviation_k; expected ...
    """
    if deviation_k is None or not (field or (air is not None and bool(air.deviation_k.any()))):
        return
    raise ConfigError(
        f"a temperature of the air beside the context's {NAME}",
        expected=f"one of them: the model has learnt what {NAME} does to the rate, and TAS is that of the context",
        mend="leave the temperature out of the air (a tailwind may stay), or take a model without this context",
    )


def tell_drawn_airs(representation: Representation, asked: object) -> None:
    """Tell where airs are drawn from the training flights' own beside a context that gives a temperature.

    Args:
        representation: The model's.
        asked: The air that was asked for; None for none.

    Warns:
        DescentflowWarning: If the airs have other temperatures than the context.

    Example:
        >>> from descentflow.representation.read_checkpoint import load_representation
        >>> tell_drawn_airs(load_representation("best.ckpt"), None)  # a model of drag in standard air
    """
    drawn = representation.air is not None and (asked is None or asked == "training")
    if drawn and representation.context is not None and NAME in representation.context.names:
        warnings.warn(
            f"samples are flown in airs drawn from the training flights' own, whatever the context's {NAME} is; to fly "
            f"them in that of the context, give the air too: {NAME}=VALUE, or a table by level",
            DescentflowWarning,
            stacklevel=3,
        )
