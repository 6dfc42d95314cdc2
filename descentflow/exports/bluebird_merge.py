"""Descents of samples put into tables of bluebird-dt that have climbs and cruises."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from descentflow.core.errors import ConfigError, DataError

Array = NDArray[np.float64]
Tables = dict[str, dict[str, Any]]
KINDS = ("profile", "uncertainty", "mapping")
CLIMB = ("rocd_cl", "cas_cl")


def merged(own: Tables, known: Tables) -> Tables:
    """Tables with all that others have, and the descents of our types.

    A type keeps climb, cruise, and descent below our lowest level of its entry there, or of the one that it is mapped
    to.

    Args:
        own: ``profile``, ``uncertainty`` and ``mapping`` as :func:`~.bluebird_export.tables_of_models` makes them.
        known: Those of bluebird-dt.

    Raises:
        DataError: If there are no climbs of a type.

    Example:
        >>> climbs = {"flight_level": [0, 400], "rocd_cl": 2000, "cas_cl": [250, 300], "rocd_des": [1500, 2500]}
        >>> known = {"profile": {"aircraft": {"MEDIUM": climbs}}, "uncertainty": {"aircraft": {}}}
        >>> ours = {"flight_level": [150, 350], "rocd_des": [1800, 2200]}
        >>> own = {"profile": {"aircraft": {"A320": ours}}, "uncertainty": {"aircraft": {"A320": {}}}}
        >>> both = merged(own | {"mapping": {"A320": "A320"}}, known | {"mapping": {"A320": "MEDIUM"}})
        >>> made = both["profile"]["aircraft"]["A320"]
        >>> made["flight_level"], made["rocd_des"], made["rocd_cl"]
        ([0, 149, 150, 350, 400], [1500.0, 1872.5, 1800.0, 2200.0, 2200.0], 2000)
    """
    found: Tables = {
        "profile": {"aircraft": dict(known["profile"]["aircraft"])},
        "uncertainty": {"aircraft": dict(known["uncertainty"]["aircraft"])},
        "mapping": known["mapping"] | {name: key for name, key in own["mapping"].items() if name != "DEFAULT"},
    }
    for typecode, ours in own["profile"]["aircraft"].items():
        key = known["mapping"].get(typecode, typecode)
        theirs = known["profile"]["aircraft"].get(key, {})
        if not all(name in theirs for name in ("flight_level", *CLIMB)):
            raise DataError(
                f"no climbs of {key} in the profile",
                expected=f"an entry with flight_level, {' and '.join(CLIMB)}",
                mend=f"add one, or map {typecode} to an entry that has them",
            )
        found["profile"]["aircraft"][typecode] = _profile(theirs, ours)
        spread = known["uncertainty"]["aircraft"].get(key, {})
        found["uncertainty"]["aircraft"][typecode] = spread | _descent(own["uncertainty"]["aircraft"][typecode])
    return found


def read_tables(files: Sequence[Path]) -> Tables:
    """Profile, uncertainty and mapping of bluebird-dt.

    Raises:
        ConfigError: If they are not three files.
        DataError: If one is not such a table.
    """
    if len(files) != len(KINDS):
        raise ConfigError(
            f"{len(files)} files to put descents into", expected=f"three: {', '.join(KINDS)}", mend="give all of them"
        )
    return dict(zip(KINDS, map(_read, files, KINDS), strict=True))


def _read(path: Path, kind: str) -> dict[str, Any]:
    try:
        found = json.loads(Path(path).read_text(encoding="utf-8"))
        (found if kind == "mapping" else found["aircraft"]).items()
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        shape = "a JSON object of types" if kind == "mapping" else "a JSON object with 'aircraft'"
        raise DataError(
            f"{path}, which is no {kind} of bluebird-dt: {error}",
            expected=shape,
            mend="give its profile, its uncertainty and its mapping, in this order",
        ) from error
    tables: dict[str, Any] = found
    return tables


def _profile(theirs: Mapping[str, Any], ours: Mapping[str, Any]) -> dict[str, Any]:
    """One entry on the levels of both."""
    lowest = ours["flight_level"][0]
    # Theirs ends a level below ours: bluebird draws a line between levels.
    ends = [lowest - 1] if theirs["flight_level"][0] < lowest else []
    levels = np.unique(np.concatenate([theirs["flight_level"], ours["flight_level"], ends]))
    found = {name: _at(levels, theirs, name) for name in theirs if name != "flight_level"}
    for name in _descent(ours):
        below = found.get(name, _at(levels, ours, name))
        found[name] = np.where(levels < lowest, below, _at(levels, ours, name))
    return {"flight_level": levels.tolist()} | {
        name: values if np.isscalar(values) else np.round(values, 4).tolist() for name, values in found.items()
    }


def _at(levels: Array, entry: Mapping[str, Any], name: str) -> Any:
    """Values by level as bluebird reads them: a single one at every level, and none at the bottom held from above."""
    if not isinstance(entry[name], list):
        return entry[name]
    known = [
        (level, value) for level, value in zip(entry["flight_level"], entry[name], strict=True) if value is not None
    ]
    return np.interp(levels, *np.transpose(known))


def _descent(entry: Mapping[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in entry.items() if name.endswith("_des")}
