"""Descents to hold against a model: cleaned as those that it was trained on."""

import warnings
from collections.abc import Callable, Mapping
from typing import Any

import polars as pl

from descentflow.core.errors import DescentflowWarning
from descentflow.representation.representation import Representation
from descentflow.surveillance.cleaning.thresholds import Cleaning
from descentflow.surveillance.descents.prepared_descents import Descents
from descentflow.surveillance.open_descents import open_descents


def comparable_descents(
    source: Any,
    representation: Representation,
    *,
    columns: Mapping[str, str] | None = None,
    progress: Callable[[str], None] | None = None,
) -> Descents:
    """Open descents that a model is compared with; rows are cleaned with the settings of its training descents.

    A checkpoint that does not keep those settings (written before descentflow kept them, or trained on descents that do
    not say) is used all the same: rows are cleaned with the defaults, down to its lowest level, with a warning.

    Args:
        source: As :func:`~descentflow.surveillance.open_descents.open_descents` takes it.
        representation: The model's.
        columns: Name in a row -> column of the rows' tables.
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
        return open_descents(source, representation.cleaning, columns=columns, progress=progress)
    warnings.warn(
        "the cleaning settings of this model's training descents are unknown: rows are cleaned with the default "
        "settings, and prepared descents are taken as they are; fit the model again to have it keep its settings",
        DescentflowWarning,
        stacklevel=2,
    )
    lowest = Cleaning(bottom_fl=int(representation.decoder.levels_fl[0]))
    return open_descents(source, rows_cleaning=lowest, columns=columns, progress=progress)


def tell_other_types(descents: pl.DataFrame, representation: Representation) -> None:
    """Warn of flights whose type the model does not know: that they descend otherwise is no fault of it.

    Args:
        descents: A table of prepared descents.
        representation: The model's.

    Warns:
        DescentflowWarning: If there are any.

    Example:
        >>> import warnings
        >>> from descentflow.representation.read_checkpoint import load_representation
        >>> others = pl.read_parquet("descents.parquet").with_columns(typecode=pl.lit("B738"))
        >>> with warnings.catch_warnings(record=True) as told:
        ...     warnings.simplefilter("always")
        ...     tell_other_types(others, load_representation("best.ckpt"))
        >>> print(told[0].message)
        120 flights of B738, and the model was trained on A320: what differs may be the type; leave them out unless...
    """
    known = representation.provenance.get("typecodes") or [representation.decoder.aircraft.typecode]
    flights = descents.group_by("typecode").agg(pl.col("flight_id").n_unique()).sort("flight_id", descending=True)
    others = [f"{n} flights of {name}" for name, n in flights.iter_rows() if name not in known]
    if others:
        warnings.warn(
            f"{', '.join(others[:8])}, and the model was trained on {', '.join(known)}: what differs may be the type; "
            "leave them out unless that is what you ask",
            DescentflowWarning,
            stacklevel=3,
        )
