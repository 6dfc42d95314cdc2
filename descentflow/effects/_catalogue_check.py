"""Checks of a catalogue of effects: names, words, channels and parameters."""

from collections.abc import Mapping
from pathlib import Path
from typing import NoReturn

import torch

from descentflow.core.errors import ConfigError
from descentflow.effects._example_flights import example_flights
from descentflow.effects.effect import NOISE, Effect
from descentflow.measurements.quantity_registry import CHANNELS, QUANTITIES


def checked_catalogue(catalogue: Mapping[str, Effect]) -> Mapping[str, Effect]:
    """The catalogue, unless it cannot be used.

    Raises:
        ConfigError: If it is empty, an effect stands under another name than its own or has no parameters, names
            channels that do not exist, or shifts what cannot be shifted.

    Example:
        >>> from descentflow.effects import EFFECTS
        >>> checked_catalogue({"warm": EFFECTS["temperature"]})
        Traceback (most recent call last):
        ...
        descentflow.core.errors.ConfigError: effect 'temperature' under the name 'warm'; expected its own name; \
to mend it, write {effect.name: effect}
    """
    if not catalogue:
        raise ConfigError("an empty catalogue", expected="at least one effect", mend="pass EFFECTS, or some of them")
    for name, effect in catalogue.items():
        if effect.name != name:
            raise ConfigError(
                f"effect {effect.name!r} under the name {name!r}",
                expected="its own name",
                mend="write {effect.name: effect}",
            )
        if not effect.parameters:
            raise ConfigError(
                f"effect {name!r} without a parameter", expected="at least one, its size", mend="state `parameters`"
            )
        strange = [channel for channel in (*effect.needs, *effect.splits) if channel not in CHANNELS]
        if strange:
            raise ConfigError(
                f"channel {strange[0]!r} of effect {name!r}",
                expected=f"some of {', '.join(CHANNELS)}",
                mend="correct its `needs` or `splits`",
            )
        if not type(effect).__module__.startswith("descentflow."):
            _check_shift(effect)
    return catalogue


def _check_shift(effect: Effect) -> None:
    """Try the shift of an effect of the user's own on a few flights."""
    state, theta = example_flights(), effect.start() + torch.tensor([p.scale for p in effect.parameters]).double()
    shift = effect.shift(state, effect.clamp(theta))
    if not isinstance(shift, Mapping):
        _refuse(effect, f"a {type(shift).__name__}", "a dictionary of quantities")
    if all(name.startswith(NOISE) for name in shift):
        _refuse(effect, "noise alone", "a change of what is flown or reported: noise is listed next to the causes")
    n, bands = state.cas_mps.shape
    for name, change in shift.items():
        if name not in QUANTITIES:
            _refuse(effect, f"the quantity {name!r}", f"some of {', '.join(QUANTITIES)}")
        shape = (n, bands) if QUANTITIES[name].by_band else (n,)
        if not isinstance(change, torch.Tensor) or tuple(change.shape) != shape:
            got = tuple(change.shape) if isinstance(change, torch.Tensor) else type(change).__name__
            _refuse(effect, f"{got} for {name}", f"a tensor {shape}: flights{' and bands' if len(shape) > 1 else ''}")
        if not bool(change.isfinite().all()):
            _refuse(effect, f"NaN or infinity for {name}", "numbers")


def _refuse(effect: Effect, got: str, expected: str) -> NoReturn:
    """Raise an error with the line where the effect's shift begins."""
    code = type(effect).shift.__code__
    place = f"{Path(code.co_filename).name}, line {code.co_firstlineno}"
    raise ConfigError(f"{place}: shift of effect {effect.name!r} gives {got}", expected=expected, mend="correct it")
