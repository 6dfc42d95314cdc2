"""Request of a preparation, with all that the result depends on, and the description that the result carries."""

import hashlib
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import polars as pl

from descentflow.core.version import __version__
from descentflow.core.workers import version
from descentflow.surveillance.cleaning._flights import names_shared
from descentflow.surveillance.cleaning._neighbour_air import observed
from descentflow.surveillance.cleaning.chain import Work
from descentflow.surveillance.cleaning.drop_report_checks import NONE_OF, asked_in_vain, check_left, check_report
from descentflow.surveillance.cleaning.idle import check_power
from descentflow.surveillance.cleaning.thresholds import Cleaning
from descentflow.surveillance.descents.prepared_descents import top_levels
from descentflow.surveillance.descents.store import SCHEMA_VERSION
from descentflow.surveillance.formats._known_formats import ACCEPTED
from descentflow.surveillance.read_rows import TABLE_IN_MEMORY, Source
from descentflow.surveillance.rows._column_names import check_named
from descentflow.surveillance.rows.airspeed_source import NEIGHBOURS, AirspeedSource
from descentflow.surveillance.rows.drop_report import DropReport
from descentflow.surveillance.rows.schema import AIRSPEEDS, COLUMNS
from descentflow.surveillance.unpacking import files_of

HASHED_ROWS = 100_000
"""Rows of a table in memory that are hashed at a time."""


@dataclass(frozen=True)
class PreparationRequest:
    """Inputs and settings of a preparation.

    Attributes:
        rows: Files or folders of rows, and tables in memory.
        types: Table `icao24,typecode` for rows that do not name their type.
        typecodes: Types to keep; all if empty.
        cleaning: Thresholds.
        format: Name of the files' format; recognised from their content if None.
        shown: Number of random flights whose dropped rows are kept, besides the flight that each filter hit most.
        columns: Name in a row -> column of the rows' tables, where it has another name there.
        airspeeds: Source of wind and temperature for rows without airspeeds; None where rows must have them.

    Example:
        >>> request = PreparationRequest(["rows.parquet"], cleaning=Cleaning(bottom_fl=200))
        >>> request.files(), request.facts([])["settings"]["bottom_fl"]
        ([PosixPath('rows.parquet')], 200)
    """

    rows: Sequence[Source]
    types: pl.DataFrame | None = None
    typecodes: Sequence[str] = ()
    cleaning: Cleaning = field(default_factory=Cleaning)
    format: str | None = None
    shown: int = 0
    columns: Mapping[str, str] = field(default_factory=dict)
    airspeeds: AirspeedSource | None = None

    def __post_init__(self) -> None:
        check_named(self.columns)

    @property
    def tables(self) -> list[pl.DataFrame]:
        """Rows that are given in memory."""
        return [source for source in self.rows if isinstance(source, pl.DataFrame)]

    def files(self) -> list[Path]:
        """Files of the paths, those of folders included.

        Raises:
            DataError: If a path does not exist, or there are neither files nor tables.
        """
        paths = [source for source in self.rows if not isinstance(source, pl.DataFrame)]
        return files_of(paths, ACCEPTED) if paths or not self.rows else []

    def work(self, columns: tuple[str, ...], names: pl.DataFrame, parts: Iterable[pl.DataFrame]) -> Work:
        """Work on the rows of any aircraft.

        Args:
            columns: Of all rows that were read.
            names: Flight names in them (``names_given``).
            parts: These rows, which are read where neighbours are the source of airspeeds.

        Raises:
            DataError: If no aircraft reports what neighbours are to report.
        """
        if self.cleaning.idle_only is not None:
            check_power(columns)
        shared = tuple(names_shared(names))
        if self.airspeeds:
            made = {*columns, *AIRSPEEDS, *self.airspeeds.needed}
            columns = tuple(name for name in COLUMNS if name in made)
        seen = observed(parts) if self.airspeeds and self.airspeeds.kind == NEIGHBOURS else None
        return Work(self.cleaning, columns, shared, tuple(self.typecodes), self.types, self.shown, self.airspeeds, seen)

    def facts(self, files: Sequence[Path]) -> dict[str, Any]:
        """All that the descents depend on.

        Args:
            files: Those of :meth:`files` that are read.
        """
        types = None if self.types is None else hashlib.sha256(self.types.write_csv().encode()).hexdigest()
        given: dict[str, Any] = {"columns": dict(sorted(self.columns.items()))} if self.columns else {}
        if self.airspeeds:
            given["airspeeds_from"] = [_file_provenance(path) for path in self.airspeeds.files()] or self.airspeeds.kind
        return {
            "made_by": version(),
            "schema_version": SCHEMA_VERSION,
            "settings": asdict(self.cleaning),
            "typecodes": sorted(self.typecodes) or None,
            "types_sha256": types,
            "format": self.format,
            **given,
            "inputs": [*map(_table_provenance, self.tables), *map(_file_provenance, files)],
        }

    def account(self, report: DropReport, parts: Sequence[tuple[DropReport, dict[str, int], dict[str, int]]]) -> None:
        """Add the reports of the parts that were cleaned.

        Args:
            report: Of reading; takes the steps of the parts.
            parts: Report of each part, its rows per type, and its rows per address where the table of types names none.

        Raises:
            DataError: If no usable row was left before the filters, or most of them contradict themselves.

        Warns:
            DescentflowWarning: Of notes for which there is advice.
        """
        report.extend([part for part, _, _ in parts])
        present = sum((Counter(types) for _, types, _ in parts), Counter[str]())
        untyped = sum((Counter(addresses) for _, _, addresses in parts), Counter[str]())
        check_left(report, self.typecodes, present, self.types, untyped)
        if present:
            absent = asked_in_vain(self.typecodes, present)
            report.note(f"{NONE_OF}{', '.join(absent)}", len(absent))
        check_report(report, self.cleaning)


def description(facts: dict[str, Any], report: DropReport, levels: pl.DataFrame) -> dict[str, Any]:
    """The description that prepared descents carry."""
    return {
        "schema_version": SCHEMA_VERSION,
        "descentflow": __version__,
        "bottom_fl": facts["settings"]["bottom_fl"],
        "top_fl": top_levels(levels),
        "settings": facts["settings"],
        "typecodes": facts["typecodes"],
        "inputs": facts["inputs"],
        **({"airspeeds_from": facts["airspeeds_from"]} if "airspeeds_from" in facts else {}),
        "report": report.as_dict(),
    }


def _table_provenance(table: pl.DataFrame) -> dict[str, object]:
    digest = hashlib.sha256(repr(table.schema).encode())
    for part in table.iter_slices(HASHED_ROWS):
        digest.update(part.rechunk().write_ipc(None, compression="uncompressed").getvalue())
    return {"name": TABLE_IN_MEMORY, "rows": len(table), "sha256": digest.hexdigest()}


def _file_provenance(path: Path) -> dict[str, object]:
    with path.open("rb") as file:
        digest = hashlib.file_digest(file, "sha256").hexdigest()
    return {"name": path.name, "bytes": path.stat().st_size, "sha256": digest}
