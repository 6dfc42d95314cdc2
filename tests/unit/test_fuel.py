"""Thrust and fuel of a descent: the energy equation the other way round, and what the tables of samples have of it."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl
import pytest
import torch
from bada4_dummies import DUMMIES, dummies, printed_descents
from example_sides import example_sides
from scipy.stats import wasserstein_distance

from descentflow.aircraft_types.registry import aircraft
from descentflow.core.constants import G0_MPS2
from descentflow.core.units import FL_M, FT_M, KT_MPS
from descentflow.diagnosis.correction._corrected_simulator import sampled_descents
from descentflow.diagnosis.correction.corrected_descents import corrected_descents
from descentflow.diagnosis.correction.effects_in_flights import AddedEffects
from descentflow.diagnosis.gap.costs import costs_of
from descentflow.effects import EFFECTS
from descentflow.evaluation.evaluation_report import verdict
from descentflow.evaluation.metrics.classifier import Detection
from descentflow.evaluation.metrics.descent_set import DescentSet
from descentflow.evaluation.metrics.scores import score
from descentflow.generation.sample_columns import COLUMNS
from descentflow.generation.sample_tables import to_frame, write_samples
from descentflow.physics.airspeed import cas_to_tas_mps
from descentflow.physics.energy import descent_rate_mps, energy_share_factor_local
from descentflow.physics.fuel import CO2_PER_FUEL, burn
from descentflow.physics.performance_model import PerformanceModel
from descentflow.representation.decoder.trajectories import Trajectories, burn_of, integrate
from descentflow.representation.profiles import Profiles, profiles_from_frame
from descentflow.simulation.world import simulate
from descentflow.surveillance.cleaning.thresholds import Cleaning
from descentflow.surveillance.prepare import prepare

TYPES = ("A320", "AT76", *DUMMIES)
COLUMNS_OF_FUEL = ("thrust_n", "fuel_flow_kg_s", "fuel_kg", "co2_kg")


def model_of(name: str) -> PerformanceModel:
    return aircraft(name, dummies() if name in DUMMIES else None)


def state(model: PerformanceModel) -> tuple[torch.Tensor, ...]:
    """CAS, altitude, slope of the CAS, deviation and mass of random points."""
    draw = torch.rand(5, 40, generator=torch.Generator().manual_seed(1), dtype=torch.float64)
    cas = (0.7 + 0.3 * draw[0]) * model.des_cas_high_kt * KT_MPS
    altitude = 500 + draw[1] * 0.7 * model.altitude_maximum_ft * FT_M
    mass = model.mass_minimum_kg + draw[4] * (model.mass_maximum_kg - model.mass_minimum_kg)
    return cas, altitude, 4e-3 * (draw[2] - 0.5), 30 * draw[3] - 10, mass


@pytest.mark.parametrize("name", TYPES)
def test_the_thrust_that_flew_a_rate_comes_back_and_is_never_below_idle(name: str) -> None:
    model = model_of(name)
    cas, altitude, slope, deviation, mass = state(model)
    tas = cas_to_tas_mps(cas, altitude, deviation)
    share = energy_share_factor_local(cas, altitude, slope, 0.0, deviation)
    drag, idle = model.drag_n(tas, altitude, deviation, mass), model.idle_thrust_n(altitude, tas, deviation)
    wanted = idle + torch.linspace(-0.3, 0.8, len(cas)).double() * (drag - idle)
    rate = descent_rate_mps(model, drag, wanted, tas, share, altitude, deviation, mass)
    burnt = burn(model, cas, altitude, rate, slope, deviation, mass)
    torch.testing.assert_close(burnt.thrust_n, wanted.maximum(idle), rtol=1e-9, atol=1e-6)
    idles = wanted <= idle
    flow = model.idle_fuel_flow_kg_s(altitude, tas, deviation)
    assert torch.equal(burnt.flow_kg_s[idles], flow.expand(len(cas))[idles])
    assert bool((burnt.flow_kg_s >= flow).all())


def test_level_flight_at_one_true_airspeed_takes_the_drag() -> None:
    model = model_of("A320")
    burnt = burn(model, 140.0, 6000.0, 0.0)
    tas = cas_to_tas_mps(140.0, 6000.0)
    assert burnt.thrust_n.item() == pytest.approx(model.drag_n(tas, 6000.0).item())
    # In still, standard air one newton beyond it lifts the mass as a watt by the speed does.
    climbing = burn(model, 140.0, 6000.0, 1.0)
    share = energy_share_factor_local(140.0, 6000.0, 0.0).item()
    excess = model.mass_reference_kg * G0_MPS2 / tas.item() / share
    assert (climbing.thrust_n - burnt.thrust_n).item() == pytest.approx(excess)


@pytest.mark.parametrize("warmer", [False, True], ids=["ISA", "ISA+20"])
@pytest.mark.parametrize("name", DUMMIES)
def test_fuel_of_printed_rates_is_the_printed_fuel(name: str, warmer: bool) -> None:
    """Of clean rows below the crossover: printed CAS and rate give the printed fuel again, at idle."""
    model = model_of(name)
    for printed, configurations in printed_descents(name, warmer):
        clean = torch.tensor([configuration == "CR" for configuration in configurations])
        rows = clean & (printed["level"] * FL_M < model.transition_altitude_m())
        cas, altitude, rate = (
            printed["CAS"] * KT_MPS,
            printed["level"] * FL_M,
            -(printed["rod"] + 1) * FT_M / 60,  # a foot a minute steeper than printed, or rounding would ask for thrust
        )
        burnt = burn(model, cas, altitude, rate, 0.0, 20.0 * warmer, printed["mass"])
        assert bool(((burnt.flow_kg_s * 60 - printed["fuel"])[rows].abs() <= 0.0051).all())


def test_tables_of_samples_have_thrust_fuel_and_co2(tmp_path: Path) -> None:
    model = model_of("Dummy-TWIN")
    levels = torch.arange(150, 331).double()
    cas = torch.full((3, 181), 145.0).double()
    drag = torch.tensor([[28e3], [34e3], [60e3]]).double().expand(3, 181)
    flown = integrate(model, levels, levels * FL_M, drag, cas, torch.tensor([180, 180, 100]), exact_energy_share=True)
    table = to_frame(flown)
    for number in range(3):
        sample = table.filter(sample_id=number)
        time, flow = sample["time_s"].to_numpy(), sample["fuel_flow_kg_s"].to_numpy()
        assert sample["fuel_kg"][-1] == pytest.approx(np.trapezoid(flow, time), rel=1e-12)
        assert sample["fuel_kg"][0] == 0.0
        assert sample["co2_kg"].to_numpy() == pytest.approx(CO2_PER_FUEL * sample["fuel_kg"].to_numpy())
        # What slows the second and third down less than the polar is thrust; what is steeper is not.
        polar = model.drag_n(flown.tas_mps[number], levels * FL_M)
        idle = model.idle_thrust_n(levels * FL_M, flown.tas_mps[number])
        wanted = (idle + (polar - drag[number]).clamp(min=0.0)).flip(0)[-len(sample) :]
        assert sample["thrust_n"].to_numpy() == pytest.approx(wanted.numpy(), rel=1e-9)
    assert bool((table.filter(sample_id=2)["thrust_n"] < 0).all())
    assert set(COLUMNS_OF_FUEL) <= set(COLUMNS)
    write_samples(flown, tmp_path / "samples.nc")
    assert (tmp_path / "samples.nc").stat().st_size > 0


def test_descents_of_no_single_model_have_no_fuel() -> None:
    model, levels = model_of("A320"), torch.arange(150, 200).double()
    shape = torch.full((2, 50), 140.0).double()
    args = (model, levels, levels * FL_M, 300 * shape, shape, torch.tensor([49, 49]))
    assert integrate(*args, mass_kg=6e4).aircraft == model.at_mass(6e4)
    mixed = integrate(*args, mass_kg=torch.tensor([[6e4], [7e4]]).double())
    assert mixed.aircraft is None
    assert not set(COLUMNS_OF_FUEL) & set(to_frame(mixed).columns)


def test_a_gap_costs_fuel_before_and_after_its_cause() -> None:
    sides = example_sides(EFFECTS["idle_thrust"], [0.5])
    cost = next(each for each in costs_of(sides, None, seed=0) if each.name == "fuel")
    assert (cost.label, cost.unit) == ("fuel", "kg")
    assert cost.simulator > 20
    assert cost.before.estimate == pytest.approx(cost.flights - cost.simulator)


def seen_and_sampled() -> tuple[Profiles, Trajectories]:
    """Flights with a fuel flow, half of them with a gap in it, and samples that burn a tenth more."""
    model, levels = model_of("A320"), torch.arange(150, 171).double()
    generator = torch.Generator().manual_seed(2)
    drag = 30e3 + 3e3 * torch.randn(2, 80, 1, generator=generator, dtype=torch.float64).expand(2, 80, 21)
    cas, entry = torch.full((80, 21), 140.0).double(), torch.full((80,), 20)
    real, sampled = (integrate(model, levels, levels * FL_M, drag_n, cas, entry) for drag_n in drag)
    frame = to_frame(real).select(
        pl.format("f{}", "sample_id").alias("flight_id"),
        pl.col("level_fl").cast(pl.Int32),
        "time_s",
        pl.col("CAS").alias("IAS"),
        "vertical_rate",
        pl.when((pl.col("sample_id") % 2 == 1) & (pl.col("level_fl") == 160))
        .then(None)
        .otherwise(pl.col("fuel_flow_kg_s") / 1.1)
        .alias("fuel_flow"),
    )
    return profiles_from_frame(frame, model, 150), sampled


def test_fuel_is_scored_where_flights_have_a_flow() -> None:
    seen, sampled = seen_and_sampled()
    real, samples = DescentSet.of_profiles(seen), DescentSet.of_trajectories(sampled, fuel=True)
    table = score(samples, real, transition_fl=291.5, n_splits=4)
    known = real.subset(real.fuel_flow_kg_s.isfinite().all(1))  # type: ignore[union-attr]
    burnt = [
        np.trapezoid(descents.fuel_flow_kg_s.numpy(), -descents.time_s.numpy(), axis=1)  # type: ignore[union-attr]
        for descents in (samples, known)
    ]
    row = table.get("fuel", "wasserstein")
    assert (row.unit, row.n_samples, row.n_real) == ("kg", 80, 40)
    assert row.score == pytest.approx(wasserstein_distance(*map(np.abs, burnt)), rel=1e-9)
    assert 0 < row.floor < row.score
    assert verdict(table, Detection(torch.tensor([torch.nan]), ())).count("fuel") == 1


def test_without_a_fuel_flow_there_is_no_row_of_it() -> None:
    seen, sampled = seen_and_sampled()
    part = seen.between(150, 160).subset([0, 2])
    assert part.fuel_flow_kg_s is not None
    assert part.fuel_flow_kg_s.shape == (2, 11)
    real = DescentSet.of_profiles(replace(seen, fuel_flow_kg_s=None))
    table = score(DescentSet.of_trajectories(sampled), real, transition_fl=291.5, n_splits=2)
    assert "fuel" not in {row.quantity for row in table}


def test_prepared_descents_keep_the_fuel_flow_of_rows() -> None:
    rows = simulate("A320", 12, seed=1).rows
    prepared = prepare(rows.with_columns(fuel_flow=0.1 + pl.col("altitude") / 1e5), typecode="A320").frame
    wanted = 0.1 + 100 * prepared["level_fl"].to_numpy() / 1e5
    assert prepared["fuel_flow"].to_numpy() == pytest.approx(wanted, abs=1e-6)


def test_corrected_flights_burn_what_their_rates_ask_for() -> None:
    own, model = prepare(simulate("A320", 12, seed=1)), model_of("A320")
    powered = AddedEffects(EFFECTS, {"idle_thrust": torch.tensor([8.0])}, 60e3, Cleaning(), seed=0)
    before, after = (
        corrected_descents(own, model, replace(powered, theta=theta)).frame for theta in ({}, powered.theta)
    )
    around = after.filter(pl.col("level_fl").is_between(235, 265)).filter(pl.len().over("flight_id") == 31)
    near = around.filter(flight_id=around["flight_id"][0]).sort("level_fl")
    row = near.row(15, named=True)
    slope = (near["IAS"][-1] - near["IAS"][0]) * KT_MPS / (30 * FL_M)
    asked = burn(model, row["IAS"] * KT_MPS, 250 * FL_M, row["vertical_rate"] * FT_M / 60, slope, mass_kg=60e3)
    assert row["fuel_flow"] == pytest.approx(float(asked.flow_kg_s), rel=1e-6)
    # Engines with more thrust at idle make slower descents, which ask for thrust of the type's engines.
    assert after["fuel_flow"].mean() > 1.1 * before["fuel_flow"].mean()
    levels = torch.arange(150, 200).double()
    shape = torch.full((2, 50), 140.0).double()
    flown = integrate(model, levels, levels * FL_M, 300 * shape, shape, torch.tensor([49, 49]))
    sampled = sampled_descents(flown, "A320").frame.filter(flight_id="sample-000000").sort("level_fl")
    assert sampled["fuel_flow"].to_numpy() == pytest.approx(burn_of(flown).flow_kg_s[0].numpy())  # type: ignore[union-attr]
