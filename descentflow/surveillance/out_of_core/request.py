"""What is to be prepared, and all that the result depends on."""

import hashlib
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import polars as pl

from descentflow.core.workers import version
from descentflow.surveillance.cleaning.chain import Work
from descentflow.surveillance.cleaning.flights import names_shared
from descentflow.surveillance.cleaning.thresholds import Cleaning
from descentflow.surveillance.descents.prepared_descents import SCHEMA_VERSION
from descentflow.surveillance.out_of_core.intake import Intake


@dataclass(frozen=True)
class Request:
    """What is to be prepared, and how.

    Attributes:
        paths: Files or folders of rows.
        types: Table `icao24,typecode` for rows that do not name their type.
        typecodes: Types to keep; all if None.
        cleaning: Thresholds.
        format: Name of what the files are; found from their content if None.
        shown: Flights taken at random to show what became of their rows, besides those that each rule hit most.
    """

    paths: Sequence[str | Path]
    types: pl.DataFrame | None = None
    typecodes: Sequence[str] | None = None
    cleaning: Cleaning = field(default_factory=Cleaning)
    format: str | None = None
    shown: int = 0

    def work(self, intake: Intake) -> Work:
        """What is to be done with the rows that were read."""
        shared = tuple(names_shared(intake.names))
        wanted = None if self.typecodes is None else tuple(self.typecodes)
        return Work(self.cleaning, intake.columns, shared, wanted, self.types, self.shown)

    def facts(self, files: Sequence[Path]) -> dict[str, Any]:
        """All that the descents depend on."""
        types = None if self.types is None else hashlib.sha256(self.types.write_csv().encode()).hexdigest()
        return {
            "made_by": version(),
            "schema_version": SCHEMA_VERSION,
            "settings": asdict(self.cleaning),
            "typecodes": None if self.typecodes is None else sorted(self.typecodes),
            "types_sha256": types,
            "format": self.format,
            "inputs": [_provenance(path) for path in files],
        }


def _provenance(path: Path) -> dict[str, object]:
    with path.open("rb") as file:
        digest = hashlib.file_digest(file, "sha256").hexdigest()
    return {"name": path.name, "bytes": path.stat().st_size, "sha256": digest}
