"""Descents to hold against a model: cleaned as those that it was trained on."""

import warnings
from collections.abc import Callable
from typing import Any

from descentflow.core.errors import DescentflowWarning
from descentflow.representation.representation import Representation
from descentflow.surveillance.cleaning.thresholds import Cleaning
from descentflow.surveillance.descents.prepared_descents import Descents
from descentflow.surveillance.open_descents import open_descents


def comparable_descents(
    source: Any, representation: Representation, *, progress: Callable[[str], None] | None = None
) -> Descents:
    """Open descents that a model is held against; rows are cleaned with the settings of its training descents.

    A checkpoint that does not keep those settings (written before descentflow kept them, or trained on descents that do
    not say) is used all the same: rows are cleaned with the defaults, down to its lowest level, and a warning says so.

    Args:
        source: As :func:`~descentflow.surveillance.open_descents.open_descents` takes it.
        representation: The model's.
        progress: Called with what is being done.

    Raises:
        DataError: As :func:`~descentflow.surveillance.open_descents.open_descents`.

    Warns:
        DescentflowWarning: If the settings of either are unknown, or differ.

    Example:
        >>> from descentflow.representation.read_checkpoint import load_representation
        >>> parts = load_representation("best.ckpt")
        >>> comparable_descents("rows.parquet", parts).cleaning == parts.cleaning
        True
    """
    if representation.cleaning is not None:
        return open_descents(source, representation.cleaning, progress=progress)
    warnings.warn(
        "the cleaning settings of this model's training descents are unknown: rows are cleaned with the default "
        "settings, and prepared descents are taken as they are; fit the model again to have it keep its settings",
        DescentflowWarning,
        stacklevel=2,
    )
    lowest = Cleaning(bottom_fl=int(representation.decoder.levels_fl[0]))
    return open_descents(source, rows_cleaning=lowest, progress=progress)
