"""The description that prepared files and stores carry: schema version, inputs with hashes, settings, report."""

import json
from pathlib import Path
from typing import Any

from descentflow.core.errors import DataError

SCHEMA_VERSION = 1
KEY = "descentflow"
"""Key of the Parquet metadata that holds the description."""
MEND = "pass the Parquet file or the folder that `descentflow prepare` wrote"


def described(text: str, path: str | Path) -> dict[str, Any]:
    """The description of a prepared table.

    Args:
        text: JSON.
        path: Where it was read, for the message.

    Raises:
        DataError: If it is no JSON object.

    Example:
        >>> described('{"schema_version": 1}', "descents.parquet")
        {'schema_version': 1}
    """
    try:
        found = json.loads(text)
    except ValueError:
        found = None
    if not isinstance(found, dict):
        raise DataError(f"{path}: a damaged description", expected="a JSON object in the metadata", mend=MEND)
    return found
