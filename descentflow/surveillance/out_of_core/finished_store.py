"""A store that an earlier run has finished: the same rows and settings need no second run."""

from pathlib import Path
from typing import Any

from descentflow.core.errors import ConfigError
from descentflow.surveillance.descents import store
from descentflow.surveillance.descents.prepared_descents import Descents, read_descents
from descentflow.surveillance.out_of_core.job import fingerprint


def finished(out: Path, facts: dict[str, Any]) -> Descents | None:
    """The descents of a store that is finished already; None if there is none.

    Args:
        out: Folder of the store.
        facts: Inputs and settings (:meth:`~descentflow.surveillance.request.Request.facts`).

    Raises:
        ConfigError: If the folder is something else, or a store of other inputs or settings.

    Example:
        >>> finished(Path("not_there_yet"), {"settings": {"bottom_fl": 150}}) is None
        True
    """
    if not out.exists() or (out.is_dir() and not any(out.iterdir())):
        return None
    if not out.is_dir() or not (out / store.MANIFEST).is_file():
        raise ConfigError(
            f"output {out} exists and is no prepared store",
            expected="a name of its own for the store's folder, or a file that ends in .parquet",
            mend="choose another --out",
        )
    found = store.read_manifest(out)
    if found.get("fingerprint") != fingerprint(facts):
        raise ConfigError(
            f"{out} is a store of other inputs or settings",
            expected="those of its manifest, or a folder of its own",
            mend="delete it, or choose another --out",
        )
    flights = {file["typecode"]: file["flights_of_type"] for file in found["files"] if "flights_of_type" in file}
    described = {key: value for key, value in found.items() if key not in ("files", "columns")}
    return Descents(lambda: read_descents(out).frame, described, flights=flights)
