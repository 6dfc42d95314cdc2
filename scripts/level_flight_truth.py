"""Level flight and held rates that `prepare` counts beside what simulated flights flew, second by second.

    python scripts/level_flight_truth.py

Every flight of a world levels off, holds a rate, or uses speed brakes. Reports come in steps of 25 ft, 64 ft/min, 1 kt
and Mach 0.004, with the noise of simulated radar, at intervals; with rates or, differenced, without.
"""

from dataclasses import replace

import numpy as np
import polars as pl

import descentflow as df
from descentflow.core.units import FPM_MPS, FT_M, KT_MPS
from descentflow.simulation.scenarios import scenario_settings
from descentflow.simulation.world_config import WorldConfig
from descentflow.surveillance.cleaning.level_flight import LEAST_S, LEVEL_FPM, TOP_FT, by_flight

FLIGHTS, SEED = 100, 48
INTERVALS_S = (1, 4, 8, 30)
WORLDS = {
    "level-offs": {"level_off": {"share": 1.0, "duration_s": 100.0, "duration_range_s": 80.0}},
    "held rates": {"vertical_speed_mode": {"share": 1.0}},
    "brakes": {"speed_brake": {"share": 1.0}},
}
FLARE_M = 150.0
"""Above its end, where a simulated flight levels off as no arrival does; left out."""
NOISE = WorldConfig()


def main() -> None:
    """Print a line for each world and kind of reports."""
    print("world, reports: segments flown, found; s level flown, found; s at held rates flown, found, of these idle")
    for name, plant in WORLDS.items():
        truth = flown(plant)
        level = level_s(truth)
        held = truth.filter(label="constant_rate").height
        for every_s in INTERVALS_S:
            for rated in (True, False):
                found = df.prepare(reported(truth, every_s, rated)).level_flight
                assert found is not None
                one = by_flight(found)
                kind = f"{name}, {every_s} s{'' if rated else ', differenced'}"
                here = f"{one['held_s'].sum():.0f}, {idle_s(truth, found)}" if one["held_s"].count() else "missing"
                print(
                    f"{kind}: {len(level)}, {one['segments'].sum()}; {sum(level)}, {one['level_s'].sum():.0f}; "
                    f"{held}, {here}"
                )


def flown(plant: dict[str, dict[str, float]]) -> pl.DataFrame:
    """Every second of the flights of a world."""
    config = replace(scenario_settings("plain", df.aircraft("A320")), interval_s=1)
    truth = df.simulate("A320", FLIGHTS, SEED, config, plant=plant).truth.sort("flight_id", "timestamp")
    return truth.filter(pl.col("altitude_m") >= pl.col("altitude_m").min().over("flight_id") + FLARE_M)


def level_s(truth: pl.DataFrame) -> list[int]:
    """Seconds of each level stretch of the descents, by their true rates."""
    found = []
    for flight in truth.partition_by("flight_id"):
        altitude, rate = (flight[name].to_numpy() for name in ("altitude_m", "rate_mps"))
        level = np.abs(rate) <= LEVEL_FPM * FPM_MPS
        level[: np.flatnonzero(altitude >= altitude.max() - TOP_FT * FT_M)[-1] + 1] = False
        edges = np.flatnonzero(np.diff(np.concatenate([[False], level, [False]])))
        lasted = edges[1::2] - 1 - edges[::2]
        found += lasted[lasted >= LEAST_S].tolist()
    return found


def reported(truth: pl.DataFrame, every_s: int, rated: bool) -> pl.DataFrame:
    """Rows at an interval."""
    kept = truth.filter(pl.int_range(pl.len()).over("flight_id") % every_s == 0)
    draw = np.random.default_rng(SEED)
    fields = {
        "altitude": (kept["altitude_m"] / FT_M, NOISE.altitude_noise_ft, 25),
        "vertical_rate": (kept["rate_mps"] / FPM_MPS, NOISE.rate_noise_fpm, 64),
        "IAS": (kept["cas_mps"] / KT_MPS, NOISE.cas_noise_kt, 1),
        "Mach": (kept["mach"], NOISE.mach_noise, 0.004),
    }
    noisy = {
        name: np.rint((value.to_numpy() + noise * draw.standard_normal(len(kept))) / step) * step
        for name, (value, noise, step) in fields.items()
    }
    rows = kept.select("flight_id", "timestamp", icao24="flight_id", typecode=pl.lit("A320")).with_columns(**noisy)
    return rows if rated else rows.drop("vertical_rate")


def idle_s(truth: pl.DataFrame, found: pl.DataFrame) -> int:
    """Seconds at idle thrust that count as held."""
    held = found.filter(kind="held").select(
        "flight_id", first="timestamp", last=pl.col("timestamp") + pl.duration(microseconds=pl.col("seconds") * 1e6)
    )
    inside = truth.filter(label="idle").join(held, on="flight_id")
    return inside.filter(pl.col("timestamp").is_between("first", "last")).height


if __name__ == "__main__":
    main()
