"""What flights are measured for a diagnosis."""

from pathlib import Path

import gap_toys
import polars as pl
import pytest
import torch

from descentflow.measurements.level_channels import LevelGrid, short_scale_noise
from descentflow.measurements.quantities import of_some_aircraft, reference_state
from descentflow.surveillance.descents.prepared_descents import read_descents

pytestmark = pytest.mark.usefixtures("worlds_once")


def test_a_reference_takes_whole_aircraft(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    frame = read_descents(gap_toys.flights(tmp_path, 60, seed=5)).frame
    monkeypatch.setattr("descentflow.measurements.quantities.MAX_REFERENCE", 22)
    everyone = frame["flight_id"].unique().to_list()
    kept = of_some_aircraft(frame, everyone, 22)
    assert kept["flight_id"].n_unique() == 22
    per_aircraft = kept.group_by("icao24").agg(pl.col("flight_id").n_unique())["flight_id"].sort().to_list()
    # Five flights an aircraft: the last one drawn is cut short and no other.
    assert per_aircraft == [2, 5, 5, 5, 5]
    assert len(reference_state(frame, 150, 340, everyone)["cluster"]) == 22
    assert of_some_aircraft(frame, everyone, 60).equals(frame)
    assert set(of_some_aircraft(frame, everyone[:7], 60)["flight_id"]) == set(everyone[:7])


def test_the_change_over_a_band_is_that_between_its_edges() -> None:
    levels = torch.arange(150, 211, dtype=torch.float64)
    values = torch.where(levels < 171, 8.0, 10.0).double().expand(2, -1).clone()
    values[1, 13:18] = torch.nan
    grid = LevelGrid(levels, levels.expand(2, -1), {"vertical_rate": values}, torch.zeros(2), ("a", "b"))
    change = grid.bands(15.0).change(values)
    # Bands FL150-165, 165-180, ...: the step lies within the second one; the other flight shows one level at an edge.
    torch.testing.assert_close(change[0], torch.tensor([0.0, 2.0, 0.0, 0.0], dtype=torch.float64))
    assert change[1, :2].isnan().all()
    assert change[1, 2:].isfinite().all()


def test_noise_below_the_rounding_of_a_report_counts_as_that(tmp_path: Path) -> None:
    """A simulator that writes a constant rate has the noise of a rounded one: 32 ft/min over the root of twelve."""
    frame = read_descents(gap_toys.flights(tmp_path, 20, seed=5)).frame.with_columns(vertical_rate=pl.lit(-1500.0))
    grid = LevelGrid.of_frame(frame, 150, 340, ["IAS", "vertical_rate"])
    found = short_scale_noise(grid)["noise_rate"]
    assert found[found.isfinite()].exp().tolist() == pytest.approx([32 / 12**0.5] * int(found.isfinite().sum()))
    assert int(found.isfinite().sum()) > 10
