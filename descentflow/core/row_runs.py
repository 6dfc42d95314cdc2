"""Tables of millions of rows in which those of a flight stand together: questions flight by flight, without copies.

A hash of every row's text takes gigabytes for forty thousand flights. Runs of equal texts are found by one pass over
the rows, and only their beginnings are looked at more closely; a flight that has several runs is met in all of them.
"""

from collections.abc import Iterator

import numpy as np
import polars as pl

BATCH_ROWS = 1 << 18
"""Rows of a batch at least: some 30 MB, of 1,400 flights."""


def numbered(texts: pl.Series) -> tuple[pl.Series, np.ndarray]:
    """Distinct texts in ascending order, and which of them (n,) each row has."""
    runs = texts.rle().struct.unnest()
    names = runs["value"].unique().sort()
    of_run = runs["value"].rank("dense").to_numpy().astype(np.int32) - 1
    return names, np.repeat(of_run, runs["len"].to_numpy())


def first_rows(frame: pl.DataFrame, key: str) -> pl.DataFrame:
    """The first row of each text of a column, in the order in which they come."""
    lengths = frame[key].rle().struct.field("len").to_numpy().astype(np.int64)
    firsts: pl.DataFrame = frame[lengths.cumsum() - lengths]
    return firsts.unique(key, keep="first", maintain_order=True)


def batches(frame: pl.DataFrame, key: str, least: int = BATCH_ROWS) -> Iterator[pl.DataFrame]:
    """Parts of a table, one after the other, none of which has a text of a column that another has."""
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
