"""Cleaning settings as prepared files and checkpoints keep them: read back, compared, put into words."""

from collections.abc import Mapping
from dataclasses import asdict, fields
from typing import Any

from descentflow.core.errors import ConfigError
from descentflow.surveillance.cleaning.thresholds import Cleaning, cleaning_of


def kept_cleaning(settings: object) -> Cleaning | None:
    """The thresholds that a prepared file or a checkpoint was made with.

    Args:
        settings: Threshold names and values, as :func:`dataclasses.asdict` gives them.

    Returns:
        The thresholds; None if they are unknown: nothing is kept, a value is no threshold, or the names are not exactly
        those of this version (of a threshold that it did not have, another version has nothing).

    Example:
        >>> kept_cleaning(asdict(Cleaning(transient_s=60.0))).transient_s
        60.0
        >>> kept_cleaning({"transient_s": 60.0}) is None
        True
    """
    if not isinstance(settings, Mapping) or set(settings) != {field.name for field in fields(Cleaning)}:
        return None
    try:
        return cleaning_of(settings, "kept settings")
    except ConfigError:
        return None


def different_settings(first: Cleaning, second: Cleaning) -> dict[str, tuple[Any, Any]]:
    """Thresholds that differ between two cleanings, each with both values.

    Example:
        >>> different_settings(Cleaning(), Cleaning(slowest_fpm=1200.0))
        {'slowest_fpm': (500.0, 1200.0)}
    """
    values, others = asdict(first), asdict(second)
    return {name: (values[name], others[name]) for name in values if values[name] != others[name]}


def differences_in_words(differences: Mapping[str, tuple[Any, Any]], second: str, first: str) -> str:
    """Each setting that differs with both values, in one line.

    Args:
        differences: As :func:`different_settings` gives them.
        second: What was made with the second value of each.
        first: What was made with the first.

    Example:
        >>> differences_in_words({"slowest_fpm": (500.0, 1200.0)}, "in these descents", "in the training descents")
        'slowest_fpm is 1200 in these descents and 500 in the training descents'
    """
    return ", ".join(
        f"{name} is {_shown(there)} {second} and {_shown(here)} {first}" for name, (here, there) in differences.items()
    )


def _shown(value: float | None) -> str:
    return "off" if value is None else f"{value:g}"
