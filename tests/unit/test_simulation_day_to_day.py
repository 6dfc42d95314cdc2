"""Differences between days and flights: weather by height, changes of speed, stretches off idle."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
from descentflow.core.constants import G0_MPS2
from descentflow.simulation.parameters import draw_parameters
from descentflow.simulation.weather import draw_weather
from descentflow.simulation.world import World, simulate
from descentflow.simulation.world_config import WorldConfig

A320 = open_aircraft("A320")
CALM = WorldConfig(wander_kt=0.0, level_off_share=0.0, managed_share=0.0, cruise_s=(30.0, 30.0))
WINDY = replace(
    CALM, shear_spread_per_s=0.006, layer_m=(300.0, 3000.0), layer_spread_k=1.0, jet_mps=(5.0, 25.0), daily_spread_k=3.0
)


def fly(config: WorldConfig, n: int = 40, interval_s: int = 1) -> World:
    return simulate(A320, n, 0, replace(config, interval_s=interval_s))


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


def test_flights_obey_the_equation_of_motion_in_layered_air() -> None:
    """``m dV/dt = T - D - m g sin(gamma) - m dw/dt cos(gamma)`` with the wind and the speeds of the truth table."""
    world = fly(WINDY, 12)
    told = world.truth.join(world.flights.select("flight_id", "mass_kg"), on="flight_id")
    for (_,), flight in told.group_by("flight_id", maintain_order=True):
        v, g, wind = flight["tas_mps"].to_numpy(), flight["gamma"].to_numpy(), flight["groundspeed_mps"].to_numpy()
        wind = wind - v * np.cos(g)
        force = (flight["thrust_n"] - flight["drag_n"]).to_numpy() / flight["mass_kg"][0]
        left = (v[2:] - v[:-2]) / 2
        right = (force - G0_MPS2 * np.sin(g))[1:-1] - (wind[2:] - wind[:-2]) / 2 * np.cos(g[1:-1])
        # Within two seconds controls and layers change by a little.
        assert np.sqrt(np.mean((left - right) ** 2)) < 0.01
        assert np.ptp(wind) > 3


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
