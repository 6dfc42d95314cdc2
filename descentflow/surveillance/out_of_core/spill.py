"""Rows by aircraft in bounded memory: held while they fit, else spread over buckets on disk."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import polars as pl

from descentflow.core.errors import DataError

BUCKETS = 256
"""Number of buckets that rows are spread over by a hash of their address."""
PROGRAM_BYTES = 350_000_000
"""Memory of the program and its libraries without any row."""
LEAST_BYTES = 600_000_000
"""Smallest bound that can be kept; a smaller one is taken as that of the rows alone."""
WORK_FACTOR = 4
"""Bytes of memory per byte of rows while they are sorted and cleaned (measured: 2.6)."""
WRITTEN_AT = 3
"""Rows that are spread are written when they reach this fraction of the bound (one third): they are in memory twice
while they are written."""
ROW_BYTES = 200
"""Approximate bytes of a row."""


@dataclass(frozen=True)
class Memory:
    """Number of rows to hold at once, from a bound on the memory of the whole process.

    Example:
        >>> Memory(2_350_000_000).rows_bytes
        500000000
    """

    total_bytes: int

    @property
    def rows_bytes(self) -> int:
        """Rows held and cleaned at once."""
        beside = PROGRAM_BYTES if self.total_bytes >= LEAST_BYTES else 0
        return max((self.total_bytes - beside) // WORK_FACTOR, 1)

    @property
    def block_rows(self) -> int:
        """Rows that are read at a time: several copies of them exist while names, types and units are mended."""
        return min(max(self.rows_bytes // ROW_BYTES // 8, 10_000), 500_000)

    def partition_bytes(self, workers: int) -> int:
        """Rows of a partition, of which each worker holds one."""
        return max(self.rows_bytes // workers, 1)


@dataclass
class Bucket:
    """Files of the rows of some aircraft, in the order of the input.

    Example:
        >>> Bucket([Path("work/000-000000.arrow")], rows=1000, bytes=200_000).rows
        1000
    """

    files: list[Path] = field(default_factory=list)
    rows: int = 0
    bytes: int = 0


class Spill:
    """Holds the rows it is given while they fit in memory, and spreads all of them over buckets on disk from then on.

    Example:
        >>> spill = Spill(Path("work"), limit_bytes=1_000_000)
        >>> spill.add(pl.read_parquet("rows.parquet").head(1000))
        >>> spill.finish()
        >>> spill.spilled, len(spill.held)
        (False, 1)
    """

    def __init__(self, folder: Path, limit_bytes: int, *, always: bool = False) -> None:
        """Begin empty.

        Args:
            folder: Where files go; made when the first is written.
            limit_bytes: Rows that are held.
            always: Spread even what fits.
        """
        self.folder, self.limit_bytes = folder, limit_bytes
        self.spilled = always
        self.held: list[pl.DataFrame] = []
        self.buckets = [Bucket() for _ in range(BUCKETS)]
        self._waiting: list[list[pl.DataFrame]] = [[] for _ in range(BUCKETS)]
        self._bytes = 0
        self._number = 0

    def add(self, rows: pl.DataFrame) -> None:
        """Add rows after those added before."""
        self.held.append(rows)
        if not self.spilled:
            self._bytes += _size_of(rows)
            if self._bytes > self.limit_bytes:
                self.spilled = True
                self._bytes = 0
        while self.spilled and self.held:
            self._spread(self.held.pop(0))

    def finish(self) -> None:
        """Write the remaining rows, if any were written."""
        if self.spilled:
            self._write()

    def _spread(self, rows: pl.DataFrame) -> None:
        number = (pl.col("icao24").hash(0) % BUCKETS).cast(pl.Int32).alias("_bucket")
        parts = rows.with_columns(number).partition_by("_bucket", as_dict=True, include_key=False, maintain_order=True)
        for (bucket,), part in parts.items():
            self._waiting[bucket].append(part)
            self.buckets[bucket].rows += len(part)
            self.buckets[bucket].bytes += _size_of(part)
        self._bytes += _size_of(rows)
        if self._bytes > self.limit_bytes // WRITTEN_AT:
            self._write()

    def _write(self) -> None:
        self.folder.mkdir(parents=True, exist_ok=True)
        for number, (bucket, parts) in enumerate(zip(self.buckets, self._waiting, strict=True)):
            if parts:
                path = self.folder / f"{number:03d}-{self._number:06d}.arrow"
                pl.concat(parts, how="diagonal").write_ipc(path, compression="lz4")
                bucket.files.append(path)
                parts.clear()
        self._number += 1
        self._bytes = 0


def _size_of(rows: pl.DataFrame) -> int:
    """Bytes of rows in memory: texts have a view of 16 bytes each besides their letters."""
    texts = sum(kind == pl.String for kind in rows.dtypes)
    return int(rows.estimated_size()) + 16 * texts * len(rows)


def joined(spills: Sequence[Sequence[Bucket]]) -> list[Bucket]:
    """Buckets of several spills, joined.

    Example:
        >>> spill = [Bucket(rows=number) for number in range(BUCKETS)]
        >>> [bucket.rows for bucket in joined([spill, spill])][:3]
        [0, 2, 4]
    """
    together = [Bucket() for _ in range(BUCKETS)]
    for spill in spills:
        for whole, part in zip(together, spill, strict=True):
            whole.files += part.files
            whole.rows += part.rows
            whole.bytes += part.bytes
    return together


def partitions(buckets: Sequence[Bucket], partition_bytes: int, largest_bytes: int) -> Iterator[Bucket]:
    """Buckets joined where they are small.

    Args:
        buckets: Of all rows.
        partition_bytes: Intended size.
        largest_bytes: Largest size of a bucket that can be cleaned.

    Raises:
        DataError: If a bucket has more rows than can be cleaned.

    Example:
        >>> small = [Bucket(rows=10, bytes=2000) for _ in range(4)]
        >>> [bucket.rows for bucket in partitions(small, 5000, 10_000)]
        [20, 20]
    """
    waiting = Bucket()
    for bucket in buckets:
        if bucket.bytes > largest_bytes:
            aircraft = pl.concat([pl.scan_ipc(path).select("icao24") for path in bucket.files]).unique().collect()
            address, *_ = aircraft["icao24"].sort()
            raise DataError(
                f"{bucket.rows:,} rows ({bucket.bytes / 1e6:,.0f} MB in memory) of {len(aircraft):,} aircraft, such as "
                f"{address}, that are cleaned together",
                expected=f"at most {largest_bytes / 1e6:,.0f} MB for one of {BUCKETS} shares of the aircraft",
                mend="raise --memory, or prepare shorter periods one by one",
            )
        if waiting.rows and waiting.bytes + bucket.bytes > partition_bytes:
            yield waiting
            waiting = bucket
        elif bucket.rows:
            waiting = Bucket(waiting.files + bucket.files, waiting.rows + bucket.rows, waiting.bytes + bucket.bytes)
    if waiting.rows:
        yield waiting
