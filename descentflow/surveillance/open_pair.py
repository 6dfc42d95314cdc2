"""Two sets of descents that are compared: both cleaned with one set of settings."""

import warnings
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

from descentflow.core.errors import DescentflowWarning
from descentflow.surveillance.cleaning.kept_settings import differences_in_words, different_settings
from descentflow.surveillance.cleaning.thresholds import Cleaning
from descentflow.surveillance.descents.prepared_descents import Descents
from descentflow.surveillance.open_descents import check_no_columns, cleaned_rows, prepared_descents

SIDES = ("the real descents", "the simulator's descents")
"""Names of the two sides in warnings."""


def open_pair(
    real: Any,
    simulator: Any,
    *,
    columns: Mapping[str, str] | None = None,
    simulator_columns: Mapping[str, str] | None = None,
    progress: Callable[[str], None] | None = None,
) -> tuple[Descents, Descents]:
    """Open real descents and those of a simulator, through the same cleaning.

    Rows of either side are cleaned with the settings of the other side's prepared descents; with the default settings
    where both are rows. Prepared descents are taken as they are.

    Args:
        real: As :func:`~descentflow.surveillance.open_descents.open_descents` takes it.
        simulator: The same, of the simulator.
        columns: Name in a row -> column of the real rows' tables.
        simulator_columns: The same of the simulator's rows.
        progress: Called with what is being done.

    Raises:
        ConfigError: If columns are named of descents that are prepared.
        DataError: If either cannot be read or used.

    Warns:
        DescentflowWarning: If both are prepared and were cleaned with different settings, each of which is named; or if
            the settings of either are unknown.

    Example:
        >>> real, simulator = open_pair("rows.parquet", "descents.parquet")
        >>> real.cleaning == simulator.cleaning, real.frame.equals(simulator.frame)
        (True, True)
    """
    found = [prepared_descents(real), prepared_descents(simulator)]
    settings = _settings(found)
    _compare(found)
    opened = []
    for source, named, descents in zip((real, simulator), (columns, simulator_columns), found, strict=True):
        if descents is not None:
            check_no_columns(named)
        opened.append(cleaned_rows(source, settings, progress, named) if descents is None else descents)
    return opened[0], opened[1]


def _settings(found: list[Descents | None]) -> Cleaning:
    """Settings for rows: those that prepared descents say, the simulator's first; else the defaults."""
    prepared = [descents for descents in reversed(found) if descents is not None]
    known = [descents.cleaning for descents in prepared if descents.cleaning is not None]
    if known:
        return known[0]
    # Of settings that are unknown, the lowest level at least shows in the descents.
    return replace(Cleaning(), bottom_fl=prepared[0].bottom_fl) if prepared else Cleaning()


def _compare(found: list[Descents | None]) -> None:
    prepared = [(name, descents) for name, descents in zip(SIDES, found, strict=True) if descents is not None]
    unknown = [name for name, descents in prepared if descents.cleaning is None]
    if unknown:
        warnings.warn(
            f"the cleaning settings of {' and '.join(unknown)} are unknown, so both sides may have been cleaned "
            "differently, which shows as a difference of flight; pass the rows of both, or the files that "
            "`descentflow prepare` wrote",
            DescentflowWarning,
            stacklevel=3,
        )
        return
    settings = [descents.cleaning for _, descents in prepared if descents.cleaning is not None]
    if len(settings) < 2:
        return
    differences = different_settings(settings[0], settings[1])
    if differences:
        words = differences_in_words(differences, f"in {SIDES[1]}", f"in {SIDES[0]}")
        warnings.warn(
            f"descents of different cleaning settings: {words}; what the settings change shows as a difference of "
            "flight; prepare the rows of both with the same settings, or pass the rows themselves",
            DescentflowWarning,
            stacklevel=3,
        )
