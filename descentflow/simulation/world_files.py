"""The three files of a world: rows, truth, flights."""

from dataclasses import astuple, dataclass
from pathlib import Path

import polars as pl

from descentflow.core.errors import ConfigError
from descentflow.core.files import check_output, whole_file


@dataclass(frozen=True)
class WorldFiles:
    """Paths of a world's files."""

    rows: Path
    truth: Path
    flights: Path

    @classmethod
    def named(cls, out: str | Path, truth: str | Path | None = None) -> "WorldFiles":
        """Names for the tables, checked before minutes of flying go into them.

        Args:
            out: Of the rows, ``NAME.parquet``.
            truth: Of the truth; ``NAME_truth.parquet`` if not given.

        Raises:
            ConfigError: If a name does not end in .parquet, or two are the same.
            DataError: If one cannot be written.

        Example:
            >>> WorldFiles.named("rows.parquet").flights.name
            'rows_flights.parquet'
        """
        rows = Path(out)
        beside = Path(truth) if truth is not None else rows.parent / f"{rows.stem}_truth.parquet"
        files = cls(rows, beside, rows.parent / f"{rows.stem}_flights.parquet")
        paths: tuple[Path, ...] = astuple(files)
        if any(path.suffix != ".parquet" for path in paths) or len(set(paths)) < len(paths):
            raise ConfigError(
                f"outputs {', '.join(map(str, paths))}",
                expected="three different names that end in .parquet",
                mend="choose other names for --out and --truth",
            )
        for path in paths:
            check_output(path)
        return files

    def write(self, rows: pl.DataFrame, truth: pl.DataFrame, flights: pl.DataFrame) -> None:
        """Write each table whole or not at all."""
        for frame, path in ((rows, self.rows), (truth, self.truth), (flights, self.flights)):
            with whole_file(path) as temporary:
                frame.write_parquet(temporary)
