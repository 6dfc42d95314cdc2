"""The air by aircraft's own reports, with its errors, and drag that does not hold the weather."""

import polars as pl
import pytest
import torch
import toys
from torch import Tensor

import descentflow as df
from descentflow.air.air_reports import temperature_reports
from descentflow.air.energy_in_air import drag_in_air, in_air, rate_in_air
from descentflow.air.level_air import LevelAir
from descentflow.air.measured_air import FlightAirs, air_table, measured_airs
from descentflow.core.constants import G0_MPS2
from descentflow.core.errors import DataError
from descentflow.core.units import FL_M, KT_MPS
from descentflow.measurements.level_channels import LevelGrid
from descentflow.physics.airspeed import cas_to_mach, mach_to_tas_mps
from descentflow.physics.atmosphere import geometric_altitude_m, isa_temperature_k
from descentflow.physics.energy import descent_rate_mps, slope_per_m
from descentflow.representation.own_air import with_own_air
from descentflow.representation.profiles import drag_at_idle_n, profiles_from_frame
from descentflow.simulation.world import World
from descentflow.simulation.world_config import WorldConfig

LEVELS = torch.arange(150, 341).double()
WARM_AND_WINDY = WorldConfig(
    deviation_mean_k=10.0, deviation_spread_k=4.0, wind_slope_mean_per_s=0.002, wind_slope_spread_per_s=0.001
)


def profile_of_air() -> LevelAir:
    """A temperature and a wind that change with height, smoothly."""
    height = (LEVELS - 250) / 100
    return LevelAir((8 + 5 * torch.sin(2 * height))[None], (20 + 15 * torch.cos(1.5 * height))[None])


@pytest.fixture(scope="module")
def world() -> World:
    return df.simulate("A320", 100, seed=4, scenario=WARM_AND_WINDY)


@pytest.fixture(scope="module")
def frame(world: World) -> pl.DataFrame:
    return df.prepare(world.rows, typecode="A320").frame


@pytest.fixture(scope="module")
def airs(frame: pl.DataFrame) -> FlightAirs:
    return measured_airs(frame, LEVELS)


def test_a_rate_in_an_air_is_that_of_the_energy_balance_itself() -> None:
    # By the equation itself, differenced along the geometric path: nothing of the package's energy share factor.
    air, altitude_m = profile_of_air(), LEVELS * FL_M
    cas = torch.full_like(LEVELS, 145.0)[None]
    mach = cas_to_mach(cas, altitude_m)
    drag = torch.full_like(cas, 40e3)
    temperature = isa_temperature_k(altitude_m) + air.deviation_k
    tas = mach * torch.sqrt(1.4 * 287.05287 * temperature)
    step = torch.diff(altitude_m) * 0.5 * ((temperature / isa_temperature_k(altitude_m))[:, 1:] +
                                           (temperature / isa_temperature_k(altitude_m))[:, :-1])  # fmt: skip
    height = torch.nn.functional.pad(step.cumsum(1), (1, 0))[0]
    gain = slope_per_m(tas + air.tailwind_mps, height)
    thrust = toys.AIRCRAFT.idle_thrust_n(altitude_m, tas, air.deviation_k)
    mass = toys.AIRCRAFT.mass_reference_kg
    climb = (thrust - drag) * tas / (mass * G0_MPS2) / (1 + tas / G0_MPS2 * gain)
    expected = climb * isa_temperature_k(altitude_m) / temperature
    # The same slope of CAS, zero, in standard air: the package's factor of constant CAS.
    standard_tas = mach_to_tas_mps(mach, altitude_m)
    share = 1 / (1 + standard_tas / G0_MPS2 * slope_per_m(standard_tas, altitude_m))
    standard_thrust = toys.AIRCRAFT.idle_thrust_n(altitude_m, standard_tas)
    standard = descent_rate_mps(toys.AIRCRAFT, drag, standard_thrust, standard_tas, share, altitude_m)
    rate = rate_in_air(toys.AIRCRAFT, standard, drag, in_air(toys.AIRCRAFT, cas, altitude_m, air))
    # Both sides difference over 200 ft: of second order, and below 1e-4 away from the one-sided ends.
    torch.testing.assert_close(rate[:, 2:-2], expected[:, 2:-2], rtol=2e-4, atol=0)
    assert float((rate / standard - 1).abs().max()) > 0.05


def test_drag_comes_back_from_the_rate_flown_in_its_air() -> None:
    air, altitude_m = profile_of_air(), LEVELS * FL_M
    cas, rate = torch.full((1, len(LEVELS)), 150.0).double(), torch.full((1, len(LEVELS)), -11.0).double()
    drag = drag_at_idle_n(toys.AIRCRAFT, cas, rate, altitude_m)
    flown = rate_in_air(toys.AIRCRAFT, rate, drag, in_air(toys.AIRCRAFT, cas, altitude_m, air))
    standard = drag_at_idle_n(toys.AIRCRAFT, cas, flown, altitude_m)
    again = drag_in_air(toys.AIRCRAFT, cas, flown, standard, altitude_m, air)
    torch.testing.assert_close(again, drag, rtol=1e-12, atol=0)
    still = LevelAir.uniform(LEVELS)
    torch.testing.assert_close(drag_in_air(toys.AIRCRAFT, cas, rate, drag, altitude_m, still), drag, rtol=1e-13, atol=0)


def _true_growth(world: World, names: tuple[str, ...]) -> tuple[Tensor, Tensor]:
    order = pl.DataFrame({"flight_id": list(names)}).join(world.flights, on="flight_id", how="left")
    deviation, slope = (torch.from_numpy(order[n].to_numpy().copy()) for n in ("deviation_k", "wind_slope_per_s"))
    # The world's wind grows with geometric altitude.
    height = geometric_altitude_m(LEVELS * FL_M, deviation[:, None])
    return deviation[:, None].expand(-1, len(LEVELS)), slope_per_m(slope[:, None] * height, LEVELS * FL_M)


def test_temperature_and_wind_are_found_within_their_errors(
    world: World, airs: FlightAirs, frame: pl.DataFrame
) -> None:
    deviation, growth = _true_growth(world, airs.flight_ids)
    seen = profiles_from_frame(frame, toys.AIRCRAFT, 150, 340).mask
    left = airs.air.deviation_k - deviation
    assert float(left[seen].square().mean().sqrt()) < 0.3, "K"
    # A flight's levels err together, so there are some 95 independent ones: 0.9 +- 0.03, three sigma.
    inside = (left.abs() < 1.645 * airs.deviation_error_k)[seen]
    assert 0.80 < float(inside.double().mean()) < 0.99
    grew = airs.air.slopes(LEVELS * FL_M)[1] - growth
    # The wind's growth by level: a knot for each 1,000 ft is 0.0017 per second.
    assert float(grew[seen].square().mean().sqrt()) < 0.0002
    assert float((grew.abs() < 1.645 * airs.growth_error_per_s)[seen].double().mean()) > 0.80


def test_drag_of_warm_windy_days_is_that_of_cold_still_ones(frame: pl.DataFrame, airs: FlightAirs) -> None:
    # Flight k of a seed is the same aircraft, mass and speed in both worlds: the air alone differs.
    still = df.prepare(df.simulate("A320", 100, seed=4).rows, typecode="A320").frame
    a320 = df.aircraft("A320")
    here, there = (profiles_from_frame(descents, a320, 150, 340) for descents in (frame, still))
    measured = with_own_air(here, a320, airs, print)
    both = sorted(set(measured.flight_ids) & set(there.flight_ids))

    def ratio(flights: object) -> float:
        rows = [p.subset([p.flight_ids.index(f) for f in both]) for p in (flights, there)]
        seen = rows[0].mask & rows[1].mask
        return float((rows[0].drag_n / rows[1].drag_n)[seen].median())

    assert abs(ratio(measured) - 1) < 0.006, "noise of the rate over some 90 flights and 190 levels"
    assert ratio(here) < 0.95, "in standard air the weather passes for drag"


def test_rounding_that_stays_is_one_error_of_the_whole_run() -> None:
    # A Mach number of 0.78 in steps of 0.004 for 60 levels, TAS passing through its steps: the former stays.
    levels = torch.arange(250.0, 310.0).double()
    cas = torch.full((1, 60), 260.0).double()
    values = {"IAS": cas, "TAS": 440 + torch.linspace(0, 7, 60).double()[None], "Mach": 0 * cas + 0.78}
    reports = temperature_reports(LevelGrid(levels, -levels[None], values, torch.zeros(1), ("one",)))
    assert reports is not None
    temperature = (443.5 * KT_MPS / 0.78) ** 2 / (1.4 * 287.05287)
    error = 2 * temperature / 0.78 * 0.004 / 12**0.5
    mean_error = float(reports.rounding[0].mean().sqrt())
    assert error < mean_error < 1.25 * error


def test_flights_that_report_no_airspeed_are_counted(frame: pl.DataFrame) -> None:
    silent = frame["flight_id"].unique().sort()[:7].to_list()
    frame = frame.with_columns(TAS=pl.when(~pl.col("flight_id").is_in(silent)).then("TAS"))
    measured = measured_airs(frame, LEVELS)
    assert measured.without == 7
    assert not set(silent) & set(measured.flight_ids)
    lines: list[str] = []
    profiles = profiles_from_frame(frame, toys.AIRCRAFT, 150, 340)
    kept = with_own_air(profiles, toys.AIRCRAFT, measured, lines.append)
    assert kept.air is not None
    assert len(kept) == len(kept.air) == len(profiles) - 7
    assert lines == [f"left out 7 of {len(profiles)} flight(s) of whose air nothing is known"]
    with pytest.raises(DataError, match="without true airspeed"):
        measured_airs(frame.drop("TAS"), LEVELS)


def test_without_groundspeed_the_air_is_still(frame: pl.DataFrame) -> None:
    measured = measured_airs(frame.drop("groundspeed"), LEVELS)
    assert not measured.wind
    assert not bool(measured.air.tailwind_mps.any())
    assert not bool(measured_airs(frame, LEVELS, wind=False).air.tailwind_mps.any())
    with pytest.raises(DataError, match=r"without true airspeed \(TAS\) and groundspeed"):
        measured_airs(frame.drop("groundspeed"), LEVELS, wind=True)


def test_cold_days_say_nothing_of_warm_ones(frame: pl.DataFrame, airs: FlightAirs) -> None:
    # Warm flights among three times as many in standard air, which a learnt spread would pull there.
    still = df.prepare(df.simulate("A320", 300, seed=9).rows, typecode="A320").frame.select(frame.columns)
    together = measured_airs(pl.concat([frame, still]), LEVELS)
    row = [together.flight_ids.index(flight) for flight in airs.flight_ids]
    apart = (together.air.deviation_k[row] - airs.air.deviation_k)[together.known[row] & airs.known]
    assert float(apart.abs().mean()) < 0.1, "K"


def test_where_the_air_is_not_known_it_is_held_and_no_drag_is_inferred(frame: pl.DataFrame) -> None:
    low = frame.with_columns(TAS=pl.when(pl.col("level_fl") < 200).then("TAS"))
    measured = measured_airs(low, LEVELS)
    assert bool(measured.known[:, 25].any()) and not bool(measured.known[:, -1].any())  # noqa: PT018
    assert torch.equal(measured.air.deviation_k[:, -1], measured.air.deviation_k[:, -20])
    lines: list[str] = []
    kept = with_own_air(profiles_from_frame(low, toys.AIRCRAFT, 150, 340), toys.AIRCRAFT, measured, lines.append)
    assert not bool(kept.mask[:, -1].any())
    assert "levels at which the air is not known" in lines[-1]


def test_the_table_of_air_is_within_its_errors_of_the_truth() -> None:
    """Of simulated days at ISA + 8 K in still air, by flight, level and time."""
    frame = df.prepare(df.simulate("A320", 40, seed=3, plant={"temperature": {"deviation_k": 8.0}})).frame
    table = air_table(frame)
    assert table["flight_id"].n_unique() > 30
    for name, truth in (("deviation", 8.0), ("tailwind", 0.0)):
        value, error = (
            table[f"{name}{end}"] for end in (("_k", "_error_k") if name == "deviation" else ("", "_error"))
        )
        # Errors of neighbouring levels are shared, so 95 % of all is known to some percent.
        assert ((value - truth).abs() < 2 * error).mean() > 0.9
        assert 0.1 < error.mean() < 1.0
    own = frame.join(table, on=["flight_id", "level_fl"])
    assert (own["timestamp"] == own["timestamp_right"]).all()
    still = air_table(frame.drop("groundspeed"))
    assert still["tailwind"].is_null().all()
    assert still["deviation_k"].mean() == pytest.approx(8.0, abs=0.2)


def test_true_airspeed_every_sixteen_seconds_measures_the_air_nearly_as_well(world: World) -> None:
    """Radars ask for BDS 5,0 less often than for 6,0: of the rows, every fourth has a true airspeed."""
    some = world.rows.with_columns(TAS=pl.when(pl.int_range(pl.len()).over("flight_id") % 4 == 0).then("TAS"))
    frame = df.prepare(some, typecode="A320").frame
    assert frame["TAS"].count() > 0.85 * len(frame)
    sparse = measured_airs(frame, LEVELS)
    assert sparse.without == 0
    deviation, _ = _true_growth(world, sparse.flight_ids)
    left = (sparse.air.deviation_k - deviation)[sparse.known]
    assert float(left.square().mean().sqrt()) < 0.7, "K"
    inside = (left.abs() < 1.645 * sparse.deviation_error_k[sparse.known]).double()
    assert 0.8 < float(inside.mean()) < 0.97


def test_nothing_is_interpolated_between_reports_half_a_minute_apart(world: World) -> None:
    some = world.rows.with_columns(TAS=pl.when(pl.int_range(pl.len()).over("flight_id") % 8 == 0).then("TAS"))
    report = df.prepare(some, typecode="A320").report
    assert not any("between reports" in note for note in report.notes)
