"""Tables of rows as blocks of about equal size."""

import gc
from collections.abc import Iterator

import polars as pl


def even_blocks(tables: Iterator[pl.DataFrame], block_rows: int) -> Iterator[pl.DataFrame]:
    """Tables joined where they are small and divided where they are large.

    Example:
        >>> tables = [pl.DataFrame({"IAS": [250.0] * size}) for size in (1, 2, 7)]
        >>> [len(block) for block in even_blocks(iter(tables), 3)]
        [3, 3, 3, 1]
    """
    waiting: list[pl.DataFrame] = []
    count = 0
    for table in tables:
        for piece in table.iter_slices(block_rows):
            if count and count + len(piece) > block_rows:
                yield pl.concat(waiting, how="diagonal")
                waiting, count = [], 0
            waiting.append(piece)
            count += len(piece)
    if count:
        yield pl.concat(waiting, how="diagonal")


def without_cycle_search(blocks: Iterator[pl.DataFrame]) -> Iterator[pl.DataFrame]:
    """The same blocks; while one is made, Python does not look for cycles of references.

    JSON makes many objects and no cycles among them, and the search would take as long as the reading.

    Example:
        >>> [len(block) for block in without_cycle_search(iter([pl.DataFrame({"IAS": [250.0]})]))]
        [1]
    """
    while True:
        before = gc.isenabled()
        gc.disable()
        try:
            block = next(blocks, None)
        finally:
            if before:
                gc.enable()
        if block is None:
            return
        yield block
