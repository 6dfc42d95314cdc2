"""The partitions that an engine (:mod:`descentflow.core.workers`) works on, and what is done with each."""

import json
from dataclasses import dataclass
from pathlib import Path

import polars as pl

from descentflow.core.files import whole_file
from descentflow.surveillance.cleaning.chain import Work, clean
from descentflow.surveillance.descents.prepared_descents import KEY
from descentflow.surveillance.descents.store import ROW_GROUP


@dataclass(frozen=True)
class Partition:
    """Rows of some aircraft in files, and the file that their descents go to."""

    files: tuple[Path, ...]
    target: Path

    @property
    def fates(self) -> Path:
        """File of the flights that are shown, where some are wanted."""
        return self.target.parent.parent / "fates" / self.target.name


def clean_partition(partition: Partition, work: Work) -> None:
    """Clean the rows of some aircraft into a file that appears whole; nothing if it is there already.

    The file's metadata hold the report and the rows of each type.
    """
    if partition.target.exists():
        return
    rows = pl.concat([pl.read_ipc(path) for path in partition.files], how="diagonal")
    outcome = clean(rows, work)
    if outcome.fates is not None:
        partition.fates.parent.mkdir(exist_ok=True)
        with whole_file(partition.fates) as temporary:
            outcome.fates.write_parquet(temporary)
    described = json.dumps({"report": outcome.report.as_dict(), "present": outcome.present})
    with whole_file(partition.target) as temporary:
        outcome.levels.write_parquet(temporary, metadata={KEY: described}, compression="lz4", row_group_size=ROW_GROUP)
