"""Flights of the simulated world in wind, laid over the ground by airspeed: they go where the world took them."""

from dataclasses import replace

import numpy as np
import polars as pl
import torch

import descentflow as df
from descentflow.core.units import FL_M
from descentflow.positions.ground_path import path_to
from descentflow.positions.placing import place
from descentflow.positions.wind import WindByLevel
from descentflow.representation.decoder.trajectories import Trajectories

LEVELS = torch.arange(160, 281, dtype=torch.float64)
WIND_MPS, SLOPE_PER_S = 12.0, 0.003


def windy(flights):
    """A tailwind of 12 m/s at sea level that grows by 3 m/s a kilometre, in the standard atmosphere."""
    same = torch.ones_like(flights.wind_mps)
    return replace(flights, wind_mps=WIND_MPS * same, wind_slope_per_s=SLOPE_PER_S * same, deviation_k=0 * same)


def on_levels(truth: pl.DataFrame) -> Trajectories:
    """The flight's airspeed, rate and time on levels, from the world's record every four seconds."""
    height, levels = truth["altitude_m"].to_numpy()[::-1], LEVELS.numpy() * FL_M

    def at(name: str) -> torch.Tensor:
        return torch.from_numpy(np.interp(levels, height, truth[name].to_numpy()[::-1]))[None]

    time = at("time_s")
    return Trajectories(
        LEVELS, torch.tensor([len(LEVELS) - 1]), time - time[:, -1:], at("cas_mps"), at("mach"), at("tas_mps"),
        at("rate_mps"), at("drag_n"),
    )  # fmt: skip


def test_distances_are_those_that_the_groundspeed_of_the_world_gives() -> None:
    """Within a metre of some 100 km: records are every 4 s, linear between them. In still air 11 % would be missing."""
    world = df.simulate("A320", 12, seed=5, inject=windy)
    altitude = np.array([0.0, 12_000.0])
    wind = WindByLevel(altitude / FL_M, WIND_MPS + SLOPE_PER_S * altitude, np.zeros(2))
    due_east = path_to((0.0, 0.0), track=90.0)
    errors, shares = [], []
    for _, truth in world.truth.group_by("flight_id"):
        truth = truth.sort("time_s")
        band = truth.filter(pl.col("altitude_m").is_between(LEVELS[0] * FL_M, LEVELS[-1] * FL_M))
        if truth["altitude_m"].max() < LEVELS[-1] * FL_M or band["rate_mps"].max() > -1:
            continue  # not from so high, or held level in between, which no profile by level tells
        over_ground = truth["groundspeed_mps"].to_numpy()
        travelled = np.concatenate([[0], np.cumsum(0.5 * (over_ground[1:] + over_ground[:-1]) * 4.0)])
        ends = np.interp(LEVELS.numpy()[[0, -1]] * FL_M, truth["altitude_m"].to_numpy()[::-1], travelled[::-1])
        flown = on_levels(truth)
        placed = place(flown, due_east, wind)
        errors.append(placed.top_of_descent_m[0] - (ends[0] - ends[1]))
        shares.append(place(flown).top_of_descent_m[0] / (ends[0] - ends[1]))
    assert len(errors) >= 6
    assert np.abs(errors).max() < 1
    assert np.mean(shares) < 0.93
