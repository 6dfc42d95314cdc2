"""Checks of a catalogue of effects: names, words, channels and parameters."""

from collections.abc import Mapping

from descentflow.core.errors import ConfigError
from descentflow.effects.effect import Effect
from descentflow.measurements.quantity_registry import CHANNELS


def checked_catalogue(catalogue: Mapping[str, Effect]) -> Mapping[str, Effect]:
    """The catalogue, unless it cannot be used.

    Raises:
        ConfigError: If it is empty, an effect stands under another name than its own or has no parameters, or names
            channels that do not exist.

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
    return catalogue
