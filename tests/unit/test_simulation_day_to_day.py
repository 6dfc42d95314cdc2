"""Differences between days and flights: weather by height, changes of speed, stretches off idle."""

from dataclasses import replace

import numpy as np
import polars as pl
import pytest
import torch

from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
from descentflow.core.constants import G0_MPS2
from descentflow.core.units import FPM_MPS, FT_M, KT_MPS
from descentflow.simulation.autopilot import LEAST_FPM
from descentflow.simulation.parameters import draw_parameters
from descentflow.simulation.weather import HEIGHT_M, draw_weather
from descentflow.simulation.world import World, simulate
from descentflow.simulation.world_config import WorldConfig

A320 = open_aircraft("A320")
CALM = WorldConfig(wander_kt=0.0, level_off_share=0.0, managed_share=0.0, cruise_s=(30.0, 30.0))
WINDY = replace(
    CALM, shear_spread_per_s=0.006, layer_m=(300.0, 3000.0), layer_spread_k=1.0, jet_mps=(5.0, 25.0), daily_spread_k=3.0
)


def fly(config: WorldConfig, n: int) -> World:
    """Flights in steps of 2 s, with a record every 4 s."""
    return simulate(A320, n, 0, replace(config, step_s=2.0, interval_s=2))


@pytest.fixture(scope="module")
def windy() -> World:
    return simulate(A320, 12, 0, replace(WINDY, interval_s=1))


def test_layers_have_the_shear_and_the_temperature_that_were_asked_for() -> None:
    config = replace(WINDY, jet_mps=(0.0, 0.0), daily_spread_k=0.0)
    weather = draw_weather(range(600), list(range(600)), 0, config)
    assert weather is not None
    shear = weather.tailwind_mps.diff(dim=1) / 50.0
    # Waves of 300 m lose 4 % of their shear to heights 50 m apart.
    assert float(shear.std()) == pytest.approx(0.006, rel=0.06)
    assert float(weather.warmer_k.std()) == pytest.approx(1.0, rel=0.06)


def test_a_days_weather_is_that_of_all_its_flights_seen_along_their_tracks() -> None:
    """East and north are solved from two flights of a day; a third of the same day meets what they say."""
    config = replace(WINDY, layers_own_share=0.0)
    weather = draw_weather([1, 2, 3, 4], [7, 7, 7, 8], 0, config)
    assert weather is not None
    along = torch.stack([torch.sin(weather.track_rad), torch.cos(weather.track_rad)], 1)
    day = torch.linalg.solve(along[:2], weather.tailwind_mps[:2])
    torch.testing.assert_close(along[2] @ day, weather.tailwind_mps[2])
    torch.testing.assert_close(weather.warmer_k[0], weather.warmer_k[2])
    assert not torch.allclose(weather.warmer_k[0], weather.warmer_k[3])
    alone = draw_weather([3], [7], 0, config)
    assert alone is not None
    torch.testing.assert_close(alone.tailwind_mps[0], weather.tailwind_mps[2], rtol=0, atol=0)


def test_a_jet_blows_from_the_west_at_its_level_alone() -> None:
    config = replace(CALM, jet_mps=(40.0, 40.0), jet_fl=(350.0, 350.0), jet_depth_m=1500.0)
    weather = draw_weather(range(400), list(range(400)), 0, config)
    assert weather is not None
    core, low = np.abs(HEIGHT_M - 10_668).argmin(), np.abs(HEIGHT_M - 4_000).argmin()
    assert weather.tailwind_mps[:, low].abs().max() < 0.1
    eastbound = torch.sin(weather.track_rad) > 0.9
    assert float(weather.tailwind_mps[eastbound, core].mean()) > 20


def test_flights_obey_the_equation_of_motion_in_layered_air(windy: World) -> None:
    """``m dV/dt = T - D - m g sin(gamma) - m dw/dt cos(gamma)`` with the wind and the speeds of the truth table."""
    flown = windy.truth.join(windy.flights.select("flight_id", "mass_kg"), on="flight_id")
    for (_,), flight in flown.group_by("flight_id", maintain_order=True):
        v, g, wind = flight["tas_mps"].to_numpy(), flight["gamma"].to_numpy(), flight["groundspeed_mps"].to_numpy()
        wind = wind - v * np.cos(g)
        force = (flight["thrust_n"] - flight["drag_n"]).to_numpy() / flight["mass_kg"][0]
        left = (v[2:] - v[:-2]) / 2
        right = (force - G0_MPS2 * np.sin(g))[1:-1] - (wind[2:] - wind[:-2]) / 2 * np.cos(g[1:-1])
        # Within two seconds controls and layers change by a little.
        assert np.sqrt(np.mean((left - right) ** 2)) < 0.01
        assert np.ptp(wind) > 3


def test_rates_are_of_pressure_altitude_in_the_air_of_the_level(windy: World) -> None:
    height = windy.truth.with_columns(
        climbed=(pl.col("altitude_m").shift(-1) - pl.col("altitude_m").shift(1)).over("flight_id") / 2
    ).drop_nulls()
    assert (height["climbed"] - height["rate_mps"]).abs().max() < 0.5
    assert (height["climbed"] - height["rate_mps"]).abs().median() < 0.01


def test_the_speed_planned_after_a_change_is_flown() -> None:
    config = replace(CALM, speed_change_share=1.0, speed_change_fl=(250.0, 300.0), speed_change_kt=(10.0, 20.0))
    world = fly(config, 60)
    planned = (1 + pl.col("speed_change_1_share") + pl.col("speed_change_2_share")) * pl.col("cas_kt") * KT_MPS
    below = world.truth.join(world.flights.with_columns(planned=planned), on="flight_id").filter(
        pl.col("altitude_m") / FT_M < 15_000, pl.col("label") == "idle"
    )
    off = below.group_by("flight_id").agg((pl.col("cas_mps") - pl.col("planned")).abs().median())["cas_mps"]
    assert off.median() < 1.0
    assert (off < 3.0).mean() > 0.9
    shares = world.flights.select("^speed_change_._share$").to_numpy()
    assert 0.1 < (shares > 0).mean() < 0.4  # a quarter is faster
    assert (shares < 0).any()


def test_who_slows_down_keeps_descending() -> None:
    """The sharpest slow-down, and a type whose idle thrust holds it up: none levels off above the bottom."""
    config = replace(
        CALM,
        speed_change_share=1.0,
        faster_share=0.0,
        speed_change_kt=(40.0, 40.0),
        speed_change_kt_per_kft=(40.0, 40.0),
    )
    for aircraft in (A320, open_aircraft("BE20")):
        fl = (160.0, 220.0)
        world = simulate(aircraft, 40, 1, replace(config, speed_change_fl=fl, step_s=2.0))
        idle = world.truth.filter(pl.col("label") == "idle")
        assert idle["rate_mps"].max() < -0.9 * LEAST_FPM * FPM_MPS


def test_brakes_raise_drag_and_thrust_is_kept_where_they_are_planned() -> None:
    config = replace(CALM, thrust_share=1.0, brakes_share=1.0, off_idle_fl=(30.0, 50.0))
    with_them, without = fly(config, 30), fly(CALM, 30)
    told = with_them.truth.join(with_them.flights, on="flight_id")
    level = pl.col("altitude_m")

    def inside(k: int) -> pl.Expr:
        return (level < pl.col(f"off_idle_{k}_high_m") - 300) & (level > pl.col(f"off_idle_{k}_low_m") + 100)

    assert with_them.flights["off_idle_1_brake_gain"].max() == 0
    assert with_them.flights["off_idle_3_thrust_share"].max() == 0
    powered = told.filter((inside(1) | inside(2)) & ~inside(3) & ~inside(4), pl.col("time_s") > 120)
    assert (powered["thrust_n"] / powered["drag_n"]).median() > 2 * (
        without.truth.filter(pl.col("label") == "idle")
        .select(pl.col("thrust_n") / pl.col("drag_n"))
        .to_series()
        .median()
    )
    braked = told.filter(inside(3) | inside(4), pl.col("time_s") > 120)
    assert braked["drag_n"].mean() > 1.1 * told.filter(~inside(3) & ~inside(4), pl.col("time_s") > 120)["drag_n"].mean()


def test_plain_worlds_have_none_of_it_and_no_other_draw_changes() -> None:
    rich = replace(WINDY, speed_change_share=0.5, thrust_share=0.5, brakes_share=0.5)
    plain, changed = draw_parameters(A320, range(30), 5, CALM), draw_parameters(A320, range(30), 5, rich)
    assert not sum(one.numel() for one in (plain.weather.warmer_k, plain.speed_changes.share, plain.off_idle.low_m))
    assert changed.weather.warmer_k.numel()
    for name in ("mass_kg", "top_m", "cas_mps", "mach", "operator", "day", "wander_phase"):
        torch.testing.assert_close(getattr(plain, name), getattr(changed, name), rtol=0, atol=0)
    few = draw_parameters(A320, range(7, 9), 5, rich)
    for part in ("weather", "speed_changes", "off_idle"):
        for name, value in vars(getattr(few, part)).items():
            torch.testing.assert_close(value, getattr(getattr(changed, part), name)[7:9], rtol=0, atol=0)


def test_airframes_start_on_days_of_their_own_within_the_season() -> None:
    world = simulate(A320, 200, 0, replace(CALM, days=92, bottom_fl=270.0, low_top_share=0.0))
    by_airframe = world.flights.with_columns(day=pl.col("start").dt.ordinal_day()).sort("start").group_by("icao24")
    days = by_airframe.agg(pl.col("day"))["day"].to_list()
    assert all(np.diff(day).tolist() == [1, 1, 1, 1] for day in days)
    assert len({day[0] for day in days}) > 25
    assert world.flights["start"].dt.date().n_unique() > 60
    assert (world.flights["start"].max() - world.flights["start"].min()).days < 92
