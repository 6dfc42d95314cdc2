"""What a run of `prepare` leaves, and what an earlier one has left."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import polars as pl

from descentflow.core.errors import ConfigError
from descentflow.surveillance.descents import store
from descentflow.surveillance.out_of_core.job import fingerprint
from descentflow.surveillance.rows.drop_report import DropReport


@dataclass(frozen=True)
class Prepared:
    """What was written.

    Attributes:
        metadata: The description that stands in the output.
        report: Of everything dropped.
        flights: Descents of each type.
        fates: Rows of some flights and why they were dropped, if some are to be shown.
        written: False if a store of the same inputs and settings was there already.
    """

    metadata: dict[str, Any]
    report: DropReport
    flights: dict[str, int]
    fates: pl.DataFrame | None = None
    written: bool = True


def finished(out: Path, facts: dict[str, Any]) -> Prepared | None:
    """What a store holds that is finished already; None if there is none.

    Args:
        out: Folder of the store.
        facts: Inputs and settings (:meth:`~descentflow.surveillance.out_of_core.request.Request.facts`).

    Raises:
        ConfigError: If the folder is something else, or a store of other inputs or settings.
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
    return Prepared(found, DropReport.from_dict(found["report"]), flights, written=False)
