"""What flights are measured for a diagnosis."""

from pathlib import Path

import gap_toys
import polars as pl
import pytest

from descentflow.gap.quantities import _of_some_aircraft, reference_state
from descentflow.surveillance.descents import read_descents


def test_a_reference_takes_whole_aircraft(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    frame = read_descents(gap_toys.flights(tmp_path, 60, seed=5)).frame
    monkeypatch.setattr("descentflow.gap.quantities.LARGEST", 22)
    kept = _of_some_aircraft(frame, 22)
    assert kept["flight_id"].n_unique() == 22
    per_aircraft = kept.group_by("icao24").agg(pl.col("flight_id").n_unique())["flight_id"].sort().to_list()
    # Five flights an aircraft: the last one drawn is cut short and no other.
    assert per_aircraft == [2, 5, 5, 5, 5]
    assert len(reference_state(frame, 150, 340)["cluster"]) == 22
    assert _of_some_aircraft(frame, 60) is frame
