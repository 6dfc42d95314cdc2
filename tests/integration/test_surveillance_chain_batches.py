"""Batches are a matter of speed: whatever their size, the same descents and the same account come out."""

from pathlib import Path

import polars as pl
import pytest
from surveillance_toys import fleet, written

from descentflow.surveillance.cleaning import chain as module
from descentflow.surveillance.prepare import prepare


@pytest.mark.parametrize("rows_at_a_time", [1, 300, 1000])
def test_descents_do_not_depend_on_batches(
    rows_at_a_time: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rows = fleet(7)
    # Some of everything to count: spikes, a flight that is too short, a missing rate.
    spiked = pl.when(pl.int_range(pl.len()) % 97 == 50).then(pl.col("altitude") + 4000).otherwise("altitude")
    rows = rows.with_columns(altitude=spiked).filter((pl.col("icao24") != "4ca003") | (pl.col("altitude") > 31_000))
    path = written(rows, tmp_path / "rows.parquet")
    whole = prepare([path])
    account = whole.report
    assert any(step.flights_dropped for step in account.steps)
    monkeypatch.setattr(module, "BATCH_ROWS", rows_at_a_time)
    said: list[str] = []
    parts = prepare([path], progress=said.append)
    assert parts.frame.equals(whole.frame)
    assert parts.report.as_dict() == account.as_dict()
    flights = next(step.flights_left for step in account.steps if step.step == "unknown_type")
    batches = sum(", part" in words for words in said)
    assert batches == flights if rows_at_a_time == 1 else 1 < batches <= 1 + len(rows) // rows_at_a_time
