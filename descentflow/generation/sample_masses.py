"""The mass that samples are flown at: one for all, or the training flights' own."""

import torch
from torch import Tensor

from descentflow.core.errors import ConfigError
from descentflow.representation.own_mass import STANDARD, check_masses
from descentflow.representation.representation import Representation

TRAINING = "training"


def masses_asked(asked: float | str | None, representation: Representation) -> Tensor | None:
    """Masses (m,) to fly at, kg; None for the mass that the model flies.

    Args:
        asked: kg, ``standard`` or ``training``. If absent, ``training`` where the model knows the training flights'
            masses, else ``standard``.
        representation: The model's.

    Raises:
        ConfigError: If there is no such mass, or the model does not know drag at any mass.
        DataError: If it is no mass of the type in kg.

    Example:
        >>> from descentflow.representation.read_checkpoint import load_representation
        >>> masses_asked(None, load_representation("best.ckpt")) is None  # inferred at the reference mass
        True
    """
    kept = representation.mass
    if asked is None:
        asked = STANDARD if kept is None else TRAINING
    if asked == STANDARD:
        return None
    if kept is None:
        raise ConfigError(
            f"the mass {asked}, of a model whose drag holds what the masses of its flights did",
            expected="a model that was fitted with data.mass=COLUMN",
            mend="fit such a model, or leave the mass out",
        )
    if asked == TRAINING:
        return kept.training_kg
    try:
        mass = torch.tensor([float(asked)], dtype=torch.float64)
    except ValueError:
        raise ConfigError(
            f"the mass {asked!r}", expected=f"kg, {STANDARD} or {TRAINING}", mend="write for instance 62000"
        ) from None
    check_masses(mass, representation.decoder.aircraft)
    return mass
