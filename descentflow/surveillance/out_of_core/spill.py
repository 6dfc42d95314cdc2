"""Rows by aircraft within a bound on memory: held while they fit, else put into buckets on disk."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import polars as pl

from descentflow.core.errors import DataError

BUCKETS = 64
"""Buckets that rows are spread over by their address; one that is too large is spread again."""
PROGRAM_BYTES = 350_000_000
"""What the program and its libraries take before any row."""
LEAST_BYTES = 600_000_000
"""Least bound that can be kept; below it, it is that of the rows alone."""
WORK_FACTOR = 4
"""Bytes at work for each byte of rows while they are put into order and cleaned (measured: 2.6)."""
WRITTEN_AT = 3
"""Part of the rows held that waits to be written once rows are spread: each is there twice while it is written."""
ROW_BYTES = 200
"""About what a row takes."""
DEEPEST = 6
"""Times that buckets are spread again; 64^7 is more than there are addresses."""


@dataclass(frozen=True)
class Memory:
    """How much may be held at once, from a bound on the whole process.

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
    """Files of the rows of some aircraft, in the order of the input."""

    files: list[Path] = field(default_factory=list)
    rows: int = 0
    bytes: int = 0


class Spill:
    """Takes rows; holds them while they fit, and spreads them over buckets on disk from then on.

    Example:
        >>> spill = Spill(Path("work"), limit_bytes=1_000_000)
        >>> spill.add(rows)
        >>> spill.finish()
        >>> whole = spill.held if not spill.spilled else spill.buckets
    """

    def __init__(self, folder: Path, limit_bytes: int, *, level: int = 0, always: bool = False) -> None:
        """Begin empty.

        Args:
            folder: Where files go; made when the first is written.
            limit_bytes: Rows that are held.
            level: How often these rows were spread already (each time by another hash).
            always: Spread even what fits.
        """
        self.folder, self.limit_bytes, self.level = folder, limit_bytes, level
        self.spilled = always
        self.held: list[pl.DataFrame] = []
        self.buckets = [Bucket() for _ in range(BUCKETS)]
        self._waiting: list[list[pl.DataFrame]] = [[] for _ in range(BUCKETS)]
        self._bytes = 0
        self._number = 0

    @classmethod
    def unbounded(cls) -> "Spill":
        """One that holds all rows in memory."""
        return cls(Path(), limit_bytes=2**62)

    def add(self, rows: pl.DataFrame) -> None:
        """Take rows, after those taken before."""
        self.held.append(rows)
        if not self.spilled:
            self._bytes += size_of(rows)
            if self._bytes > self.limit_bytes:
                self.spilled = True
                self._bytes = 0
        while self.spilled and self.held:
            self._spread(self.held.pop(0))

    def finish(self) -> None:
        """Write what waits, if anything was written."""
        if self.spilled:
            self._write()

    def _spread(self, rows: pl.DataFrame) -> None:
        number = (pl.col("icao24").hash(self.level) % BUCKETS).cast(pl.Int32).alias("_bucket")
        parts = rows.with_columns(number).partition_by("_bucket", as_dict=True, include_key=False, maintain_order=True)
        for (bucket,), part in parts.items():
            self._waiting[bucket].append(part)
            self.buckets[bucket].rows += len(part)
            self.buckets[bucket].bytes += size_of(part)
        self._bytes += size_of(rows)
        if self._bytes > self.limit_bytes // WRITTEN_AT:
            self._write()

    def _write(self) -> None:
        self.folder.mkdir(parents=True, exist_ok=True)
        for number, (bucket, parts) in enumerate(zip(self.buckets, self._waiting, strict=True)):
            if parts:
                path = self.folder / f"{number:02d}-{self._number:06d}.arrow"
                pl.concat(parts, how="diagonal").write_ipc(path, compression="lz4")
                bucket.files.append(path)
                parts.clear()
        self._number += 1
        self._bytes = 0


def size_of(rows: pl.DataFrame) -> int:
    """Bytes that rows take: texts have a view of 16 bytes each besides their letters."""
    texts = sum(kind == pl.String for kind in rows.dtypes)
    return int(rows.estimated_size()) + 16 * texts * len(rows)


def joined(spills: Sequence[Sequence[Bucket]]) -> list[Bucket]:
    """Buckets of several spills of one level, one after the other."""
    together = [Bucket() for _ in range(BUCKETS)]
    for spill in spills:
        for whole, part in zip(together, spill, strict=True):
            whole.files += part.files
            whole.rows += part.rows
            whole.bytes += part.bytes
    return together


def partitions(
    buckets: Sequence[Bucket], folder: Path, partition_bytes: int, largest_bytes: int, *, level: int = 0
) -> Iterator[Bucket]:
    """Buckets joined where they are small, and spread again where they are large.

    Args:
        buckets: Of one level.
        folder: Where buckets spread again go.
        partition_bytes: Size aimed at.
        largest_bytes: Size of the largest aircraft that can be worked on.
        level: How often the rows were spread already.

    Raises:
        DataError: If one aircraft alone has more rows than can be worked on.
    """
    waiting = Bucket()
    for number, bucket in enumerate(buckets):
        if bucket.bytes > partition_bytes and not _is_one_aircraft(bucket, largest_bytes):
            if level == DEEPEST:
                raise DataError(
                    f"{bucket.rows:,} rows ({bucket.bytes / 1e6:,.0f} MB) of too few aircraft to be divided",
                    expected=f"at most {largest_bytes / 1e6:,.0f} MB for each aircraft",
                    mend="raise --memory, or prepare shorter periods one by one",
                )
            again = Spill(folder / f"{level}-{number:02d}", partition_bytes, level=level + 1, always=True)
            for path in bucket.files:
                again.add(pl.read_ipc(path))
            again.finish()
            yield from partitions(again.buckets, again.folder, partition_bytes, largest_bytes, level=level + 1)
        elif waiting.rows and waiting.bytes + bucket.bytes > partition_bytes:
            yield waiting
            waiting = bucket
        elif bucket.rows:
            waiting = Bucket(waiting.files + bucket.files, waiting.rows + bucket.rows, waiting.bytes + bucket.bytes)
    if waiting.rows:
        yield waiting


def _is_one_aircraft(bucket: Bucket, largest_bytes: int) -> bool:
    """Whether a bucket cannot be spread further.

    Raises:
        DataError: If it cannot, and is too large to be worked on.
    """
    addresses: set[str] = set()
    for path in bucket.files:
        addresses |= set(pl.scan_ipc(path).select(pl.col("icao24").unique()).collect().to_series())
        if len(addresses) > 1:
            return False
    if bucket.bytes > largest_bytes:
        raise DataError(
            f"aircraft {addresses.pop()} has {bucket.rows:,} rows ({bucket.bytes / 1e6:,.0f} MB in memory)",
            expected=f"at most {largest_bytes / 1e6:,.0f} MB for each aircraft within the memory allowed",
            mend="raise --memory, or prepare shorter periods one by one",
        )
    return True
