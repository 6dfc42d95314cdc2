"""Speed that the air adds, by velocities of known winds and turns; rates without it, by planted winds."""

from dataclasses import replace

import numpy as np
import polars as pl
import pytest
import torch
from example_sides import example_sides
from torch import Tensor

from descentflow.core.units import FL_M, KT_MPS
from descentflow.diagnosis.diagnosis_steps import diagnose_compared
from descentflow.diagnosis.findings.costs_found import judged
from descentflow.diagnosis.inference.explain import explain
from descentflow.diagnosis.sides.compared_state import by_own_air
from descentflow.diagnosis.sides.diagnosis_settings import Settings
from descentflow.diagnosis.sides.simulator import Simulator
from descentflow.diagnosis.sides.two_sides import compare
from descentflow.effects import EFFECTS
from descentflow.effects._example_flights import example_flights
from descentflow.effects.flight_state import log_rate
from descentflow.measurements.along_track import speed_by_air_kt
from descentflow.measurements.quantities import Quantities
from descentflow.physics.airspeed import cas_to_mach, mach_to_tas_mps

LEVELS_M = torch.arange(200.0, 261.0).double() * FL_M
CAS_KT = torch.full((1, len(LEVELS_M)), 280.0).double()


def flown(heading_deg: Tensor, east_kt: Tensor, north_kt: Tensor) -> dict[str, Tensor]:
    """Reports of a flight at one CAS in standard air, in a wind by level."""
    tas = mach_to_tas_mps(cas_to_mach(CAS_KT * KT_MPS, LEVELS_M), LEVELS_M) / KT_MPS
    psi = torch.deg2rad(heading_deg)
    east, north = tas * torch.sin(psi) + east_kt, tas * torch.cos(psi) + north_kt
    track = torch.rad2deg(torch.atan2(east, north)) % 360
    return {"IAS": CAS_KT, "groundspeed": torch.hypot(east, north), "track": track, "heading": heading_deg % 360}


def test_a_turn_in_a_steady_wind_takes_no_energy() -> None:
    heading = torch.linspace(-60.0, 120.0, len(LEVELS_M)).double()[None]  # across north
    steady = torch.ones_like(CAS_KT)
    by_air = speed_by_air_kt(flown(heading, 70 * steady, -20 * steady), LEVELS_M)
    change = np.ptp(by_air.numpy())
    assert change < 0.1, "kt, of 180 degrees in 73 kt of wind, by steps of 3 degrees"


def test_wind_that_grows_counts_along_the_heading() -> None:
    grows = torch.linspace(0.0, 30.0, len(LEVELS_M)).double()[None]
    heading = torch.full_like(CAS_KT, 30.0)
    by_air = speed_by_air_kt(flown(heading, grows, 0 * grows), LEVELS_M)
    torch.testing.assert_close(by_air, 0.5 * grows, rtol=0, atol=1e-9)  # sin 30 degrees


def test_a_gap_in_the_reports_keeps_the_turn_across_it() -> None:
    heading = torch.linspace(0.0, 90.0, len(LEVELS_M)).double()[None]
    steady = torch.ones_like(CAS_KT)
    seen = flown(heading, 50 * steady, 0 * steady)
    whole = speed_by_air_kt(seen, LEVELS_M)
    seen["track"] = seen["track"].clone()
    seen["track"][0, 28:32] = torch.nan
    gappy = speed_by_air_kt(seen, LEVELS_M)
    assert bool(gappy[0, 28:32].isnan().all())
    torch.testing.assert_close(gappy[0, 32:], whole[0, 32:], rtol=0, atol=0.1)


def test_layers_that_each_flight_measures_are_no_brakes() -> None:
    sides = example_sides()
    slope = 0.004 * torch.randn(sides.state.cas_mps.shape, generator=torch.Generator().manual_seed(3)).double()
    slope[~sides.real] = 0.0  # the simulator flies in calm air
    change = by_own_air(sides.state, slope, 0 * slope)
    y = sides.y.clone()
    y[:, sides.columns("rate")] += change
    in_layers = replace(sides, y=y, own_air=change, measures_air=True)
    torch.testing.assert_close(in_layers.in_own_air().y, sides.y)
    catalogue = {name: EFFECTS[name] for name in ("speed_brake", "geometric_path", "drag_polar", "wind_gradient")}
    assert explain(in_layers, catalogue).is_none


def test_a_path_is_held_in_whatever_air() -> None:
    """An idle descent answers to layers of wind, a held path does not: what layers do is off its rate in vain."""
    sides, path = example_sides(n=160), EFFECTS["geometric_path"]
    slope = 0.004 * torch.randn(sides.state.cas_mps.shape, generator=torch.Generator().manual_seed(3)).double()
    slope[~sides.real] = 0.0  # the simulator flies in calm air
    change = by_own_air(sides.state, slope, 0 * slope)
    held = torch.nonzero(sides.real)[:, 0][::5]
    held = torch.tensor([i for i in torch.nonzero(sides.real)[:, 0].tolist() if i not in held])  # four fifths
    law, uniform = torch.tensor([1.0, 0.15, 0.02]).double(), torch.rand(len(held), 1, generator=torch.Generator())
    change[held] = path.own_change(sides.state.rows(held), law, uniform.double()).flown["rate"]
    y = sides.y.clone()
    y[:, sides.columns("rate")] += change
    measured = by_own_air(sides.state, slope, 0 * slope)
    catalogue = {name: EFFECTS[name] for name in ("speed_brake", "geometric_path", "drag_polar", "mass")}
    found = explain(replace(sides, y=y, own_air=measured, measures_air=True), catalogue)
    assert found.named.groups == {"geometric_path": ()}
    share, shallower, _ = found.theta["geometric_path"].tolist()
    assert share == pytest.approx(0.8, abs=0.05)
    assert abs(shallower - 0.15) < 3 * float(found.errors["geometric_path"][1])


def test_bands_in_which_too_few_flights_measured_their_air_are_left_out() -> None:
    sides = example_sides()
    unknown = torch.zeros_like(sides.state.cas_mps)
    unknown[sides.real, 4] = torch.nan
    kept = replace(sides, own_air=unknown).in_own_air()
    assert {entry.band for entry in sides.entries} - {e.band for e in kept.entries if e.quantity == "rate"} == {4}
    assert kept.of("cas").sum() == sides.of("cas").sum()


def test_causes_beside_an_air_are_judged_in_the_air_that_each_flight_met() -> None:
    """The mean of a temperature is a cause; what its layers and days do to the rate is in each flight's own air."""
    sides = example_sides(EFFECTS["temperature"], [10.0], n=100)
    tas = sides.table("tas", sides.y)
    warmth = torch.where(sides.real[:, None], tas, 0.0)
    met = by_own_air(sides.state, 0 * warmth, warmth)
    settings = Settings(Simulator(sides.state.aircraft), EFFECTS, [], 0, str)
    report = diagnose_compared(replace(sides, own_air=met, measures_air=True), settings, "flights", {}, pl.DataFrame())
    assert [cause.effect for cause in report.causes] == ["temperature"]
    found = judged(report.costs)
    assert [cost.name for cost in found] == ["time_in_own_air", "rate_in_own_air"]
    raw = next(cost for cost in report.costs if cost.name == "time_at_speed")
    assert abs(raw.before.estimate) > 1.5 * raw.floor
    assert abs(found[0].before.estimate) < 0.5 * raw.floor
    assert report.verdict == "effect"


def test_the_air_that_flights_met_is_none_of_a_simulators_coefficients() -> None:
    """Faster flights met a tailwind that grows with altitude, which a polar of more drag would show likewise."""
    state = example_flights(80)
    faster = (state.cas_mps - state.cas_mps.mean(0)) / state.cas_mps.std(0)
    slope, bands = 0.002 * faster, torch.zeros_like(state.cas_mps)
    found = []
    for met in (0 * slope, slope):
        physics = {
            "log_rate": log_rate(state) + by_own_air(state, met, bands),
            "cas_mps": state.cas_mps,
            "cas_slope_per_s": state.cas_slope_per_s,
            "tailwind_mps": bands,
            "rate_slope_per_m": bands,
            "depth_m": state.depth_m + 1000.0,
            "air_slope_per_s": met,
        }
        values = {"lag": bands, "tas": bands, "cas": state.cas_mps / KT_MPS}
        both = Quantities((150.0, 370.0), 20.0, values, physics, torch.arange(80))
        found.append(compare(both, both, state.aircraft).coefficients.ln_factors)
    torch.testing.assert_close(found[1], found[0], atol=0.01, rtol=0)
