"""Whatever the rows, their order and the files they come in: partitions make the descents of the whole."""

import tempfile
from pathlib import Path

import polars as pl
from hypothesis import given, settings
from hypothesis import strategies as st
from polars.testing import assert_frame_equal
from surveillance_toys import fleet

from descentflow.surveillance.descents.prepared_descents import read_descents
from descentflow.surveillance.prepare import prepare

FLEET = fleet(12, every_s=10.0)


@settings(max_examples=12, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    share=st.floats(0.3, 1.0),
    files=st.integers(1, 4),
    aircraft=st.integers(3, 9),
    memory=st.integers(350_000, 900_000),
    workers=st.integers(1, 3),
    named=st.booleans(),
)
def test_partitions_make_the_descents_of_the_whole(
    seed: int, share: float, files: int, aircraft: int, memory: int, workers: int, named: bool
) -> None:
    # Few addresses shared by many flights, and names of flights shared by aircraft.
    address = pl.format("4ca00{}", pl.col("icao24").str.slice(5).str.to_integer(strict=False) % aircraft)
    rows = FLEET.sample(fraction=share, shuffle=True, seed=seed).with_columns(icao24=address)
    if named:
        rows = rows.with_columns(flight_id=pl.format("F{}", pl.col("timestamp").dt.hour() % 3))
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "rows").mkdir()
        for number, part in enumerate(rows.iter_slices(len(rows) // files + 1)):
            part.write_parquet(folder / "rows" / f"{number}.parquet")
        whole = prepare([folder / "rows"])
        prepared = prepare([folder / "rows"], out=folder / "store", memory_bytes=memory, workers=workers)
        found = read_descents(folder / "store").frame
    assert_frame_equal(found, whole.frame, check_exact=True)
    assert prepared.report.as_dict() == whole.report.as_dict()
