"""Trial of `descentflow qualify` on flights whose difference is known: how often "inside" and "outside" are wrong.

Real flights are drawn by whole aircraft from one half of a fleet, and the simulator's from the other half, whose rate
is changed by a share of the limit, exactly. Seeds and sizes are fixed before anything is judged.

    python scripts/qualification_trial.py --cases 200 --out qualification_trial.json
"""

import argparse
import json
from pathlib import Path

import numpy as np
import polars as pl

import descentflow as df
from descentflow.aircraft_types.registry import aircraft
from descentflow.core.threads import one_thread
from descentflow.diagnosis.sides.measured_sides import both_sides
from descentflow.diagnosis.sides.simulator import Simulator
from descentflow.diagnosis.sides.two_sides import compare
from descentflow.measurements.quantity_registry import CHANNELS
from descentflow.qualification.deviations import BAND_FL
from descentflow.qualification.limits import Limit, Limits
from descentflow.qualification.qualify import judged_rows
from descentflow.surveillance.descents.prepared_descents import Descents

LIMIT_FPM = 200.0
SIZES = (0.5, 0.9, 1.1, 2.0)
"""Difference of both sides in limits."""
FLEETS = (("A320", 701), ("B738", 702))
AIRCRAFT = (12, 25, 50)
"""Aircraft of the real side, in turn: of five flights each."""


def of_aircraft(frame: pl.DataFrame, names: np.ndarray) -> pl.DataFrame:
    """Flights of some aircraft."""
    return frame.filter(pl.col("icao24").is_in(names.tolist()))


def slower(frame: pl.DataFrame, by_fpm: float) -> pl.DataFrame:
    """The same flights, descending more slowly by so much on every level; times follow level by level."""
    rate = -pl.col("vertical_rate")
    took = pl.col("time_s").diff().over("flight_id").fill_null(0.0)
    ordered = frame.sort("flight_id", "level_fl", descending=[False, True])
    took = took * rate / (rate - by_fpm)
    return ordered.with_columns(
        vertical_rate=pl.col("vertical_rate") + by_fpm,
        time_s=(pl.col("time_s").first().over("flight_id") + took.cum_sum().over("flight_id")),
        flight_id=pl.format("sim {}", "flight_id"),
    )


def case(frame: pl.DataFrame, typecode: str, size: float, n_aircraft: int, seed: int) -> dict[str, object]:
    """Verdict on one draw of aircraft."""
    generator = np.random.default_rng(seed)
    names = generator.permutation(frame["icao24"].unique().sort().to_numpy())
    half = len(names) // 2
    real = of_aircraft(frame, names[: min(n_aircraft, half)])
    flown = slower(of_aircraft(frame, names[half:]), size * LIMIT_FPM)
    simulator = Simulator(aircraft(typecode), flights=Descents(flown, {}))
    sides = both_sides(simulator, real, CHANNELS, BAND_FL)
    compared = compare(sides.simulated, sides.real, simulator.aircraft)
    asked = Limits("trial", "trial", (Limit("rate", LIMIT_FPM),))
    *bands, whole = judged_rows(compared, asked, None)
    verdicts = [row.verdict for row in (*bands, whole)]
    together = next((v for v in ("outside", "not enough flights") if v in verdicts), "inside")
    covered = [row.difference for row in bands if row.difference is not None and row.difference.ends]
    held = [band.ends[0] <= size * LIMIT_FPM <= band.ends[1] for band in covered]
    return {
        "size": size,
        "type": typecode,
        "aircraft": n_aircraft,
        "whole": whole.verdict,
        "together": together,
        "bands_inside": sum(v == "inside" for v in verdicts[:-1]),
        "bands_outside": sum(v == "outside" for v in verdicts[:-1]),
        "bands": len(bands),
        "intervals_hold": sum(held),
    }


def main() -> None:
    """Judge the cases once and print how often each verdict was wrong."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", type=int, default=200)
    parser.add_argument("--flights", type=int, default=1000, help="in each fleet")
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    cases = []
    with one_thread():
        fleets = {code: df.prepare(df.simulate(code, options.flights, seed=seed)).frame for code, seed in FLEETS}
        for number in range(options.cases):
            code = FLEETS[number % len(FLEETS)][0]
            size, count = SIZES[number // 2 % len(SIZES)], AIRCRAFT[number // 8 % len(AIRCRAFT)]
            cases.append(case(fleets[code], code, size, count, 9000 + number))
    options.out.write_text(json.dumps(cases, indent=1))
    table = pl.DataFrame(cases).group_by("size", maintain_order=True).agg(
        pl.len().alias("cases"),
        (pl.col("whole") == "inside").mean().alias("all levels inside"),
        (pl.col("whole") == "outside").mean().alias("all levels outside"),
        (pl.col("together") == "inside").mean().alias("every row inside"),
        (pl.col("together") == "outside").mean().alias("a row outside"),
        (pl.col("intervals_hold").sum() / pl.col("bands").sum()).alias("intervals hold"),
    )  # fmt: skip
    with pl.Config(tbl_cols=-1, tbl_width_chars=160):
        print(table.sort("size"))


if __name__ == "__main__":
    main()
