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
from descentflow.air.weather_layout import names_weather
from descentflow.core.errors import ConfigError, DescentflowWarning
from descentflow.core.units import FL_M
from descentflow.generation.samples import Samples
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
    return not own and any((one.name, one.kind) == (NAME, "number") for one in representation.context.columns)


def given_deviation_k(representation: Representation, encoded: Tensor) -> Tensor:
    """Temperature deviations (m,) of encoded contexts (m, c), zero where one is missing or none is given.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> given_deviation_k(load_model("best.ckpt").representation, torch.zeros(1, 0))
        tensor([0.], dtype=torch.float64)
    """
    place, found = 0, torch.zeros(len(encoded), dtype=torch.float64)
    for column in representation.context.columns if gives_temperature(representation) else ():
        if column.name == NAME:
            found = encoded[:, place].detach().cpu().double() * column.scale + column.mean
            return torch.where(encoded[:, place + 1].cpu() > 0, 0.0, found) if column.indicator else found
        place += column.width
    return found


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
    if not bool(deviation_k.any()):
        return flown
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
    return replace(found, air=LevelAir(samples.air.deviation_k + own[:, None], samples.air.tailwind_mps))


def check_one_temperature(representation: Representation, asked: object, air: LevelAir | None) -> None:
    """Refuse a temperature beside that of the context, whose rate would have both; tell where one is not flown.

    Args:
        representation: The model's.
        asked: The air that was asked for, perhaps the path of a weather field; None for none.
        air: The same on the model's levels; None in standard air and in a field.

    Raises:
        ConfigError: If there are two.

    Warns:
        DescentflowWarning: If airs are drawn from the training flights' own, with other temperatures than the context.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> known = load_model("best.ckpt").representation  # knows no context
        >>> check_one_temperature(known, None, LevelAir.uniform(known.decoder.levels_fl, 15.0))
    """
    warm = names_weather(asked) or (air is not None and bool(air.deviation_k.any()))
    if gives_temperature(representation) and warm:
        raise ConfigError(
            f"a temperature of the air beside the context's {NAME}",
            expected=f"one of them: the model has learnt what {NAME} does to the rate, and TAS is that of the context",
            mend="leave the temperature out of the air (a tailwind may stay), or take a model without this context",
        )
    drawn = representation.air is not None and (asked is None or asked == "training")
    if drawn and NAME in representation.context.names:
        warnings.warn(
            f"samples are flown in airs drawn from the training flights' own, whatever the context's {NAME} is; to fly "
            f"them in that of the context, give the air too: {NAME}=VALUE, or a table by level",
            DescentflowWarning,
            stacklevel=3,
        )
