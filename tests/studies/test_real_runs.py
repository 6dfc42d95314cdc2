"""Runs of real flights: the error of the time against flights of known truth, and the shipped types at Bengaluru."""

import numpy as np
import pytest

import descentflow as df
from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
from descentflow.surveillance.formats.aircraft_json import embedded_rows, embedded_types
from studies.aircraft.real_runs import before, own_speed_error, runs_of


def test_flights_of_an_aircraft_take_its_own_time() -> None:
    world = df.simulate("A320", 30, seed=2)
    mean_kg = world.flights["mass_kg"].to_numpy().mean()
    runs = runs_of(df.prepare(world).frame, "world")
    errors = [own_speed_error(run, open_aircraft("A320").at_mass(mean_kg)) for run in runs]
    assert len(runs) >= 30
    assert abs(np.median(errors)) < 0.02


@pytest.mark.parametrize("typecode", ["A20N", "A21N", "AT76"])
def test_repaired_types_take_the_time_of_the_embedded_flights(typecode: str) -> None:
    frame = df.prepare(embedded_rows(), types=embedded_types(), typecode=typecode, bottom_fl=60).frame
    runs = runs_of(frame, "bengaluru")
    kinds = (open_aircraft(typecode), before(typecode))
    now, was = (np.median([own_speed_error(run, kind) for run in runs]) for kind in kinds)
    assert abs(now) < 0.06 < abs(was)
