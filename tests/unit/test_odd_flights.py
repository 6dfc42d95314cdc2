"""Flights worth a look: those that have what is left, by their own identifiers, in aviation units."""

from dataclasses import replace
from datetime import UTC, datetime

import polars as pl
import pytest
import torch
from example_sides import example_sides

from descentflow.diagnosis.findings.costs_found import LevelMeans
from descentflow.diagnosis.gap._what_is_left import flights_worth_a_look
from descentflow.diagnosis.sides.two_sides import Compared
from descentflow.measurements.quantities import CHANNELS, quantities_of

HAVING = range(1, 80, 4)
"""Real flights (of 80) that have something no effect names."""


def some() -> Compared:
    """Twenty of eighty flights come down a quarter faster in three bands."""
    sides = example_sides()
    y = sides.y.clone()
    at = [i for i, e in enumerate(sides.entries) if e.quantity == "rate" and e.band in (4, 5, 6)]
    for flight in HAVING:
        y[80 + flight, at] += 0.25
    return replace(sides, y=y, names=tuple(f"flight-{i}" for i in range(80)))


def test_flights_that_have_what_is_left_come_first() -> None:
    sides = some()
    profile = [LevelMeans(160.0 + 20 * k, 2000.0, 280.0, 380.0) for k in range(11)]
    found = flights_worth_a_look(sides, sides.y, profile)
    assert len(found) == 10
    assert {one.flight for one in found} <= {f"flight-{i}" for i in HAVING}
    # In the three bands, give or take one by chance, and of the size that was given.
    assert found[0].quantity == "rate"
    assert found[0].low_fl >= 210.0
    assert found[0].high_fl <= 310.0
    assert all(one.unit == "ft/min" for one in found)
    mean = sum(one.excess for one in found) / len(found)
    assert mean == pytest.approx(2000 * 0.284, rel=0.2)


def test_without_identifiers_none_is_named() -> None:
    sides = some()
    assert flights_worth_a_look(replace(sides, names=()), sides.y, []) == []


def test_identifiers_stay_with_their_flights() -> None:
    frame = pl.DataFrame(
        {
            "flight_id": [f"f{i}" for i in range(3) for _ in range(40)],
            "icao24": "4b1800",
            "level_fl": [150 + k for _ in range(3) for k in range(40)],
            "time_s": [300.0 - 3 * k for _ in range(3) for k in range(40)],
            "timestamp": [datetime(2026, 1, 1 + i, tzinfo=UTC) for i in range(3) for _ in range(40)],
            "IAS": [280.0 + i for i in range(3) for _ in range(40)],
            "vertical_rate": -2000.0,
        }
    )
    # The second flight shows nothing on the grid.
    frame = frame.filter((pl.col("flight_id") != "f1") | (pl.col("level_fl") < 152))
    found = quantities_of(frame, 150, 189, CHANNELS)
    assert found.names == ("f0", "f2")
    assert found.day is not None
    assert found.day.diff().tolist() == [2]
    assert found.values["cas"].nanmean(1).tolist() == pytest.approx([280.0, 282.0])
    assert found.rows(torch.tensor([False, True])).names == ("f2",)
    assert found.rows(torch.tensor([1, 0, 1])).names == ("f2", "f0", "f2")
