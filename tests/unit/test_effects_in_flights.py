"""Effects put into a simulator's flights: closed forms, times that agree with rates, and shares of the flights."""

from collections.abc import Mapping
from dataclasses import replace

import pytest
import torch
from torch import Tensor

from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
from descentflow.core.units import FL_M, FPM_MPS, KT_MPS
from descentflow.diagnosis.correction.effects_in_flights import AddedEffects, filled, state_of_levels, with_effects
from descentflow.diagnosis.sides.two_sides import compare
from descentflow.effects import EFFECTS
from descentflow.effects.effect import Effect, Parameter
from descentflow.measurements.level_channels import LevelGrid, gaps_of
from descentflow.measurements.quantities import measured
from descentflow.physics.airspeed import cas_to_mach, mach_to_tas_mps
from descentflow.surveillance.cleaning.thresholds import Cleaning

A320 = open_aircraft("A320")


class FasterBy(Effect):
    """A rate that is larger by a factor, in a share of the flights."""

    name = "faster"
    parameters = (Parameter("ln_factor", -1.0, 1.0, "1", 0.1), Parameter("share", 0.0, 1.0, "1", 0.1))

    def shift(self, state: object, theta: Tensor) -> Mapping[str, Tensor]:
        return {"rate": theta[0] * torch.ones_like(state.cas_mps)}

    def mixture(self, theta: Tensor) -> tuple[float, Tensor]:
        return float(theta[1]), theta


def flights(n: int = 8, rate_fpm: float = -1500.0, gap: slice | None = None) -> LevelGrid:
    """Constant rate and CAS from FL350 to FL150 in still standard air, every report without noise."""
    levels = torch.arange(150, 351, dtype=torch.float64)
    shape = (n, len(levels))
    cas = torch.full(shape, 270.0, dtype=torch.float64)
    mach = cas_to_mach(cas * KT_MPS, levels * FL_M)
    tas = mach_to_tas_mps(mach, levels * FL_M) / KT_MPS
    rate = torch.full(shape, rate_fpm, dtype=torch.float64)
    time_s = (350 - levels) * FL_M / (-rate_fpm * FPM_MPS) * torch.ones(shape).double()
    level_part = (tas**2 - (rate * FPM_MPS / KT_MPS) ** 2).sqrt()
    values = {
        "IAS": cas,
        "Mach": mach,
        "vertical_rate": rate,
        "TAS": tas,
        "groundspeed": level_part,
        "geoaltitude": levels * 100 + 0 * cas,
    }
    if gap is not None:
        values = {name: value.clone() for name, value in values.items()}
        for value in (time_s, *values.values()):
            value[:, gap] = torch.nan
    return LevelGrid(levels, time_s, values, torch.arange(n) // 2, tuple(f"f{i:03d}" for i in range(n)))


def put(grid: LevelGrid, *names_and_theta: tuple[Effect, list[float]], seed: int = 0) -> LevelGrid:
    catalogue = {effect.name: effect for effect, _ in names_and_theta}
    theta = {effect.name: torch.tensor(values).double() for effect, values in names_and_theta}
    return with_effects(grid, A320, AddedEffects(catalogue, theta, 60e3, Cleaning(), seed))


def test_a_rate_doubled_halves_the_time_and_nothing_else() -> None:
    grid = flights()
    changed = put(grid, (FasterBy(), [float(torch.log(torch.tensor(2.0))), 1.0]))
    torch.testing.assert_close(changed.values["vertical_rate"], 2 * grid.values["vertical_rate"])
    torch.testing.assert_close(changed.time_s, grid.time_s / 2)
    torch.testing.assert_close(changed.values["IAS"], grid.values["IAS"])


def test_what_a_flight_loses_in_a_gap_stays_lost() -> None:
    """Twenty levels cut out, and 100 s spent there beside the descent: half the descent's time, and all of the 100."""
    grid = flights(gap=slice(100, 120))
    later = torch.where(torch.arange(201) < 100, 100.0, 0.0)
    grid = LevelGrid(grid.levels_fl, grid.time_s + later, grid.values, grid.airframe, grid.flight_ids)
    changed = put(grid, (FasterBy(), [float(torch.log(torch.tensor(2.0))), 1.0]))
    torch.testing.assert_close(changed.time_s[:, 0], (grid.time_s[:, 0] - 100.0) / 2 + 100.0)
    assert float(gaps_of(changed)["level"].mean()) == pytest.approx(100.0)


def test_a_share_of_the_flights_has_it_whole_and_by_seed() -> None:
    grid = flights(400)
    ratio = [
        (put(grid, (FasterBy(), [0.2, 0.25]), seed=seed).values["vertical_rate"] / grid.values["vertical_rate"])
        for seed in (1, 1, 2)
    ]
    each = ratio[0].mean(1)
    assert torch.equal(ratio[0], ratio[1])
    assert not torch.equal(ratio[0], ratio[2])
    assert sorted(set(each.round(decimals=6).tolist())) == pytest.approx([1.0, 1.221403], abs=1e-6)
    assert int((each > 1.1).sum()) == 100  # the share itself, and not one that is drawn


def test_warm_air_is_what_the_physics_says() -> None:
    grid = flights()
    changed = put(grid, (EFFECTS["temperature"], [10.0]))
    mach, altitude = grid.values["Mach"], grid.altitude_m
    torch.testing.assert_close(changed.values["TAS"] * KT_MPS, mach_to_tas_mps(mach, altitude, 10.0))
    torch.testing.assert_close(changed.values["Mach"], mach)
    state = state_of_levels(grid, A320, AddedEffects(EFFECTS, {}, 60e3, Cleaning(), 0))
    shift = EFFECTS["temperature"].shift(state, torch.tensor([10.0]).double())
    torch.testing.assert_close((changed.values["vertical_rate"] / grid.values["vertical_rate"]).log(), shift["rate"])
    # In still air the groundspeed stays the level part of the airspeed.
    level = (changed.values["TAS"] ** 2 - (changed.values["vertical_rate"] * FPM_MPS / KT_MPS) ** 2).sqrt()
    torch.testing.assert_close(changed.values["groundspeed"], level)


def test_a_tailwind_that_grows_shows_in_the_groundspeed() -> None:
    slope = 0.002
    grid = flights()
    changed = put(grid, (EFFECTS["wind_gradient"], [slope]))
    level = (changed.values["TAS"] ** 2 - (changed.values["vertical_rate"] * FPM_MPS / KT_MPS) ** 2).sqrt()
    wind = (changed.values["groundspeed"] - level) * KT_MPS
    torch.testing.assert_close(wind.diff(dim=1), torch.full_like(wind[:, 1:], slope * FL_M), rtol=1e-6, atol=1e-9)
    assert float(changed.values["vertical_rate"].mean()) > float(grid.values["vertical_rate"].mean())


def test_another_schedule_moves_mach_and_rate_along() -> None:
    grid = flights()
    changed = put(grid, (EFFECTS["speed_schedule"], [10.0, 0.0]))
    # Up to FL250; higher up the Mach number, which stays, holds the speed down.
    torch.testing.assert_close(changed.values["IAS"][:, :100], grid.values["IAS"][:, :100] + 10.0)
    torch.testing.assert_close(
        changed.values["Mach"], cas_to_mach(changed.values["IAS"] * KT_MPS, grid.altitude_m), rtol=1e-9, atol=1e-12
    )
    assert bool((changed.values["vertical_rate"] < grid.values["vertical_rate"])[:, :100].all())


def test_sensors_change_reports_and_no_time() -> None:
    grid = flights()
    biased = put(grid, (EFFECTS["airspeed_bias"], [3.0, 0.0]))
    torch.testing.assert_close(biased.values["IAS"], grid.values["IAS"] + 3.0)
    torch.testing.assert_close(biased.values["Mach"], grid.values["Mach"])
    late = put(grid, (EFFECTS["vertical_rate_lag"], [8.0, 0.0]))
    for reported in (biased, late):
        torch.testing.assert_close(reported.time_s, grid.time_s)


def test_level_offs_are_given_and_taken_away() -> None:
    grid = flights(300)
    level_off = EFFECTS["level_off"]
    given = put(grid, (level_off, [40.0, 0.5]))
    lost = gaps_of(given)
    # Whole level-offs are dealt; their total is what was asked for.
    assert float(lost["level"].mean()) == pytest.approx(40.0, abs=1.0)
    assert abs(float(lost["level_gaps"].mean()) - 0.5) < 5 * (0.25 / 300) ** 0.5
    assert float(gaps_of(put(given, (level_off, [-20.0, 0.0])))["level"].mean()) == pytest.approx(20.0, abs=1.0)
    assert float(gaps_of(put(given, (level_off, [-60.0, 0.0])))["level"].mean()) == pytest.approx(0.0, abs=0.1)


def test_levels_too_slow_for_the_cleaning_go() -> None:
    grid = flights(rate_fpm=-600.0)
    changed = put(grid, (FasterBy(), [-0.3, 1.0]))
    assert not bool(changed.mask.any())


def test_missing_levels_are_filled_by_neighbours() -> None:
    values = torch.tensor([[1.0, torch.nan, 3.0, torch.nan]]).double()
    torch.testing.assert_close(filled(values), torch.tensor([[1.0, 2.0, 3.0, 3.0]]).double())


def test_a_biased_airspeed_is_the_rate_that_is_expected_of_it() -> None:
    """Of reports with a bias that grows with Mach number, whose slope is energy that no flight has."""
    grid = flights(20)
    bias = 3.0 + 4.0 * (grid.values["Mach"] - 0.65) / 0.1
    biased = replace(grid, values={**grid.values, "IAS": grid.values["IAS"] + bias})
    sides = compare(measured(grid), measured(biased), A320)
    rate = sides.table("rate", sides.y)
    seen = (rate[sides.real] - rate[~sides.real]).mean(0)
    state = sides.state.rows(torch.nonzero(sides.real)[:, 0])
    expected = EFFECTS["airspeed_bias"].shift(state, torch.tensor([3.0, 4.0]).double())["rate"].mean(0)
    inner = slice(1, -1)  # slopes at either end of a flight are of one side
    # The slope alone is 0.016 of it: without it this is off by as much.
    torch.testing.assert_close(seen[inner], expected[inner], atol=0.002, rtol=0)
