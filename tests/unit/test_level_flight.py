"""Level flight in descents, beside twenty lines that follow EUROCONTROL's definition row by row, and the truth."""

import numpy as np
import polars as pl
import pytest

from descentflow.simulation.world import simulate
from descentflow.surveillance.cleaning.level_flight import level_flight, level_segments
from descentflow.surveillance.prepare import prepare


@pytest.fixture(scope="module")
def world():
    return simulate("A320", 60, seed=3, scenario="london-fir-2019")


def by_hand(rows: pl.DataFrame) -> dict[str, list[tuple[float, float]]]:
    """Seconds and mean altitude of the level segments of each flight that loses 5,000 ft."""
    found: dict[str, list[tuple[float, float]]] = {}
    for flight in rows.partition_by("flight_id", maintain_order=True):
        flight = flight.sort("timestamp")
        time = flight["timestamp"].dt.epoch("us").to_numpy() / 1e6
        altitude, rate = flight["altitude"].to_numpy(), flight["vertical_rate"].to_numpy()
        if altitude.max() - altitude.min() < 5000:
            continue
        segments, now = [], []
        top = max(i for i in range(len(time)) if altitude[i] >= altitude.max() - 200)
        for i in range(top, len(time)):
            if altitude[i] < 1800:
                continue
            level = abs(rate[i]) <= 300
            if now and (not level or time[i] - time[i - 1] > 60):
                segments, now = [*segments, now], []
            now += [i] if level else []
        for one in [*segments, now]:
            if one and time[one[-1]] - time[one[0]] >= 20:
                found.setdefault(flight["flight_id"][0], []).append(
                    (time[one[-1]] - time[one[0]], altitude[one].mean())
                )
        found.setdefault(flight["flight_id"][0], [])
    return found


def test_segments_and_flights_are_those_of_the_definition(world) -> None:
    wanted = by_hand(world.rows)
    segments, flights = level_segments(world.rows), level_flight(world.rows)
    assert sum(map(len, wanted.values())) > 10
    assert flights["flight_id"].to_list() == sorted(wanted)
    for row in flights.rows(named=True):
        own = segments.filter(flight_id=row["flight_id"])
        expected = np.reshape(wanted[row["flight_id"]], (-1, 2))
        np.testing.assert_allclose(own.select("level_s", "altitude_ft").to_numpy(), expected, rtol=1e-7)
        assert row["segments"] == len(own)
        assert row["level_s"] == pytest.approx(sum(seconds for seconds, _ in wanted[row["flight_id"]]))


def test_planned_level_offs_are_found_at_their_levels(world) -> None:
    planned = world.flights.filter(pl.col("level_off_s") >= 40).drop_nulls("level_off_fl")
    found = level_segments(world.rows).join(planned, on="flight_id")
    near = found.filter((pl.col("altitude_ft") / 100 - pl.col("level_off_fl")).abs() < 2)
    above = planned.filter(pl.col("level_off_fl") < pl.col("top_fl") - 5)
    assert near["flight_id"].n_unique() >= 0.9 * len(above) > 0


def test_the_distance_is_over_the_ground_or_else_through_the_air(world) -> None:
    segments = level_segments(world.rows)
    rows = world.rows
    mean = rows.filter(pl.col("vertical_rate").abs() < 300)["groundspeed"].mean()
    assert segments["distance_nm"].sum() == pytest.approx(segments["level_s"].sum() / 3600 * mean, rel=0.15)
    through = level_segments(rows.drop("groundspeed", "TAS"))["distance_nm"]
    assert through.to_numpy() == pytest.approx(
        level_segments(rows.drop("groundspeed"))["distance_nm"].to_numpy(), rel=0.08
    )
    assert level_segments(rows.select("flight_id", "timestamp", "altitude"))["distance_nm"].null_count() > 0


def test_prepare_counts_it(world) -> None:
    notes = prepare(world.rows, typecode="A320").report.notes
    flights = level_flight(world.rows)
    assert notes["flights that descend by 5,000 ft or more"] == len(flights)
    continuous = notes["of them without level flight (300 ft/min, 20 s)"]
    assert continuous == pytest.approx(int((flights["segments"] == 0).sum()), abs=1)
    seconds = sum(number for note, number in notes.items() if note.startswith("seconds level"))
    assert seconds == pytest.approx(flights["level_s"].sum(), rel=0.05)


def test_few_or_odd_rows_have_no_segment() -> None:
    empty = pl.DataFrame(schema={"flight_id": pl.String, "timestamp": pl.Datetime("us", "UTC"), "altitude": pl.Float64})
    assert level_segments(empty).is_empty()
    assert level_flight(empty).is_empty()
    one = simulate("A320", 1, seed=1).rows.head(1)
    assert level_flight(one).is_empty()
    assert np.isfinite(level_flight(simulate("A320", 2, seed=1).rows)["level_s"].to_numpy()).all()
