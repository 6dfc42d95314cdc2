"""Real flights that each meet their own air, of which half use brakes: both found, and in as many flights."""

from pathlib import Path

import pytest

from descentflow.diagnosis.diagnose import diagnose
from descentflow.simulation.cause_values import Values
from descentflow.simulation.world import simulate
from descentflow.surveillance.descents.prepared_descents import write_descents
from descentflow.surveillance.prepare import prepare

pytestmark = pytest.mark.usefixtures("components_once", "worlds_once")

FLIGHTS = 150


def descents(folder: Path, name: str, seed: int, plant: dict[str, Values] | None = None) -> Path:
    rows, path = folder / f"{name}_rows.parquet", folder / f"{name}.parquet"
    simulate("A320", FLIGHTS, seed, plant=plant).rows.write_parquet(rows)
    write_descents(prepare(rows), path)
    return path


@pytest.mark.slow
def test_air_of_each_flights_own_is_not_taken_for_brakes(tmp_path: Path) -> None:
    """Were the air not looked at, flights would differ from each other by more than any brakes explain."""
    brakes: Values = {"factor": 1.6, "share": 0.5, "spread_fl": 15.0}
    plant = {"temperature": {"deviation_k": 8.0, "spread_k": 3.0}, "speed_brake": brakes}
    report = diagnose(descents(tmp_path, "real", 6, plant), descents(tmp_path, "simulated", 5), typecode="A320", seed=0)
    found = {cause.effect: cause for cause in report.causes}
    assert sorted(found) == ["speed_brake", "temperature"]
    assert report.verdict == "effect"
    assert found["speed_brake"].share_of_flights is not None
    # Four standard errors of a share of 150 flights, and of a mean of 150 temperatures with a spread of 3 K.
    assert found["speed_brake"].share_of_flights.estimate == pytest.approx(0.5, abs=0.16)
    assert found["temperature"].parameters["deviation_k"].estimate == pytest.approx(8.0, abs=1.0)
