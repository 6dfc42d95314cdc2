"""Figures of the study show the numbers that they are said to show."""

import torch
import toys

from descentflow.evaluation.metrics.descent_set import DescentSet
from descentflow.physics.nominal_descent import nominal_descent
from studies.paper.figures.mass_range import N_MASSES, mass_range

AIRCRAFT = toys.AIRCRAFT


def test_flights_that_are_badas_own_are_explained_by_mass_and_slower_ones_are_not() -> None:
    levels = torch.arange(150.0, 361.0, dtype=torch.float64)
    masses = torch.linspace(float(AIRCRAFT.mass_minimum_kg), float(AIRCRAFT.mass_maximum_kg), 12).double()
    sets = [DescentSet.of_nominal(nominal_descent(AIRCRAFT, levels, float(mass))) for mass in masses[1:-1]]
    columns = {
        name: torch.cat([getattr(one, name) for one in sets])
        for name in ("time_s", "cas_mps", "rate_mps", "drag_n", "mask")
    }
    own = DescentSet(levels, **columns)
    slower = DescentSet(levels, **{**columns, "time_s": 2 * columns["time_s"]})
    assert mass_range(own, AIRCRAFT).explained == 1
    found = mass_range(slower, AIRCRAFT)
    assert found.explained == 0
    assert found.nominal_time_s.shape == (N_MASSES, len(levels))
    assert found.range_s[0] < float(found.reference_time_s[0]) < found.range_s[1]
