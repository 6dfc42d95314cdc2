"""Speed held as the training flights show it: a Mach number and a CAS where they show both, else one CAS profile."""

from dataclasses import replace
from pathlib import Path

import pytest
import torch
import toys

from descentflow.physics.airspeed import mach_to_cas_mps
from descentflow.representation.held_speed import as_held, shows_both
from descentflow.training.datamodule import DescentDataModule


@pytest.mark.parametrize(
    ("top_fl", "fpca", "speed"), [(370, "ppca", "mach_cas"), (240, "ppca", "cas"), (370, "iterative", "cas")]
)
@pytest.mark.filterwarnings("ignore:.*iteration.*")
def test_a_model_holds_what_its_flights_show(top_fl: int, fpca: str, speed: str, tmp_path: Path) -> None:
    """Below FL240 nobody has changed over; the paper's iteration has no constant of a flight."""
    path = toys.write_descents_file(tmp_path / "a320.parquet", 120, top_fl=top_fl)
    data = DescentDataModule(path, speed="auto", fpca=fpca)
    data.setup()
    assert data.representation.decoder.speed == speed
    plain = DescentDataModule(path, speed=speed, fpca=fpca)
    plain.setup()
    assert torch.equal(data.weights("train"), plain.weights("train"))


def test_what_was_chosen_is_said() -> None:
    said: list[str] = []
    high = toys.with_crossovers(toys.flights(60))
    assert as_held("auto", lambda speed: speed, lambda _: high, said.append) == "mach_cas"
    assert "Mach number above" in said.pop()
    low = toys.with_crossovers(toys.flights(60, top_fl=240))
    assert as_held("auto", lambda speed: speed, lambda _: low, said.append) == "cas"
    assert "one CAS profile" in said.pop()
    assert as_held("mach_cas", lambda speed: speed, lambda _: low, said.append) == "mach_cas"
    assert not said


def test_few_flights_show_nothing() -> None:
    flights = toys.with_crossovers(toys.flights(60))
    assert shows_both(flights)
    assert not shows_both(flights.subset(list(range(8))))


def test_one_mach_number_of_all_flights_is_nothing_to_fit() -> None:
    """So a simulator may fly; the CAS of such flights still differ."""
    flights = toys.with_crossovers(toys.flights(60))
    held = mach_to_cas_mps(torch.full_like(flights.cas_mps, 0.78), flights.altitude_m)
    assert flights.crossovers is not None
    same = replace(flights, cas_mps=torch.where(flights.crossovers.holds_mach, held, flights.cas_mps))
    assert not shows_both(same)
