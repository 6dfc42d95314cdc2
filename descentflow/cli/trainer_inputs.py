"""A first look at the descents to fit: seconds before Lightning is imported, and by their description alone."""

from collections.abc import Mapping
from pathlib import Path

ABSENT = ("", "null")


def check_descents_to_fit(options: Mapping[str, str]) -> None:
    """Refuse descents that are not there or not prepared, and a type without coefficients.

    What is given in another way than as one file is left to the fit, which reads it: a store, or a list of files.

    Args:
        options: Names of options, without dashes, with their values.

    Raises:
        AircraftError: If the type has no coefficients.
        DataError: If the file is missing or is no prepared descents.

    Example:
        >>> check_descents_to_fit({"data.descents": "descents.parquet"})
        >>> check_descents_to_fit({"data.descents": "rows.parquet"})
        Traceback (most recent call last):
        descentflow.core.errors.DataError: rows.parquet: Parquet, but not prepared descents; expected ...
    """
    given = options.get("data.descents", "")
    # With a checkpoint's representation rows are taken, too.
    if given in ABSENT or given.startswith(("[", "{", "--")) or Path(given).is_dir() or "data.checkpoint" in options:
        return
    from descentflow.surveillance.descents.prepared_descents import read_description

    types = list(read_description(given).get("top_fl") or {})
    named = options.get("data.aircraft", "")
    if named in ABSENT and (len(types) != 1 or options.get("data.typecodes", "") not in ABSENT):
        return
    from descentflow.aircraft_types.registry import aircraft

    folder = options.get("data.bada_dir", "")
    aircraft(types[0] if named in ABSENT else named, None if folder in ABSENT else Path(folder))
