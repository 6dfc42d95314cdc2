"""Tables of millions of rows in which those of a flight stand together: what is asked flight by flight, without copies.

A hash of every row's text takes gigabytes for forty thousand flights. Runs of equal texts are found by one pass over
the rows, and only their beginnings are looked at more closely; a flight that has several runs is met in all of them.
"""

from collections.abc import Iterator

import numpy as np
import polars as pl

BATCH_ROWS = 1 << 18
"""Rows of a batch at least: some 30 MB, of 1,400 flights."""


def numbered(texts: pl.Series) -> tuple[pl.Series, np.ndarray]:
    """Distinct texts in ascending order, and which of them (n,) each row has.

    Example:
        >>> names, number = numbered(pl.Series(["b", "b", "a", "b"]))
        >>> names.to_list(), number.tolist()
        (['a', 'b'], [1, 1, 0, 1])
    """
    runs = texts.rle().struct.unnest()
    names = runs["value"].unique().sort()
    of_run = runs["value"].rank("dense").to_numpy().astype(np.int32) - 1
    return names, np.repeat(of_run, runs["len"].to_numpy())


def first_rows(frame: pl.DataFrame, key: str) -> pl.DataFrame:
    """The first row of each text of a column, in the order in which they come.

    Example:
        >>> first_rows(pl.DataFrame({"flight_id": ["b", "b", "a", "b"], "IAS": [1, 2, 3, 4]}), "flight_id").rows()
        [('b', 1), ('a', 3)]
    """
    lengths = frame[key].rle().struct.field("len").to_numpy().astype(np.int64)
    firsts: pl.DataFrame = frame[lengths.cumsum() - lengths]
    return firsts.unique(key, keep="first", maintain_order=True)


def batches(frame: pl.DataFrame, key: str, least: int = BATCH_ROWS) -> Iterator[pl.DataFrame]:
    """Parts of a table, one after the other, none of which has a text of a column that another has.

    Args:
        frame: Sorted by the column where a text's rows do not stand together.
        key: The column.
        least: Rows of a part, and as many more as its last text needs.

    Example:
        >>> flights = pl.DataFrame({"flight_id": ["b", "b", "a", "a", "c"]})
        >>> [part["flight_id"].to_list() for part in batches(flights, "flight_id", least=3)]
        [['b', 'b', 'a', 'a'], ['c']]
    """
    runs = frame[key].rle().struct.unnest()
    if runs["value"].is_duplicated().any():
        frame = frame.sort(key, maintain_order=True)
        runs = frame[key].rle().struct.unnest()
    if frame.is_empty():
        yield frame
    start = 0
    for end in runs["len"].cast(pl.Int64).cum_sum().to_list():
        if end - start >= least or end == len(frame):
            yield frame.slice(start, end - start)
            start = end
