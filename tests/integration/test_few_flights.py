"""Diagnoses of fewer than twenty flights: where and how much, and no cause that so few cannot tell."""

from dataclasses import replace
from pathlib import Path

import gap_toys
import polars as pl

from descentflow.diagnosis.diagnose import diagnose
from descentflow.diagnosis.report.page import summary
from descentflow.surveillance.descents.prepared_descents import Descents, read_descents


def some(descents: Path, count: int) -> Descents:
    """Flights of as many aircraft."""
    flights = read_descents(descents)
    first = flights.frame.unique("icao24", keep="first", maintain_order=True).head(count)
    return Descents(flights.frame.filter(pl.col("flight_id").is_in(first["flight_id"].implode())), flights.metadata)


def test_seven_flights_of_the_simulator_itself_show_no_certain_difference(descents: Path, tmp_path: Path) -> None:
    found = diagnose(some(descents, 7), gap_toys.flights(tmp_path, 60, seed=9))
    assert (found.verdict, found.causes) == ("none", [])
    assert found.is_few
    assert "No certain difference" in summary(replace(found, p_value=0.3))
    assert "at least 13 more are needed" in " ".join(summary(found).split())


def test_seven_flights_show_a_wrong_polar_as_time_and_name_no_cause(descents: Path) -> None:
    found = diagnose(some(descents, 7), "A320")  # nominal coefficients, which the world does not fly
    assert found.verdict in ("none", "unknown")
    assert found.causes == []
    time = next(cost for cost in found.costs if cost.name == "time_at_speed")
    assert time.before.ends
