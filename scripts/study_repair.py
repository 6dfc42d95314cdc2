"""Wrong files planted and repaired: python scripts/study_repair.py OUT.json [--seed 49] [--files 50] [--jsbsim].

Each file of a type is wrong in one to three of CD0, CD2 and idle thrust by 5 to 40 %. Twenty to 300 flights of the
right file, some with brakes out and some in warm air and wind, repair it. Three questions are asked. Is the time of
aircraft that were not used within 1.2 floors? Does a fresh diagnosis of the repaired nominal descent by other flights
say none? Is each planted coefficient inside its 90 % interval, at the flights' own mean mass? The seed is fixed before
the first look, and a set is judged once.

With --jsbsim flights are of two JSBSim models. No file is right for them: one of other flights' repair stands for it,
whose own interval is added to that of the planted coefficient.
"""

import argparse
import json
import time
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

import descentflow as df
from descentflow.aircraft_types.bada3.apf_file import write_apf
from descentflow.aircraft_types.bada3.opf_file import write_opf
from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
from descentflow.core.errors import DescentflowError
from descentflow.repairs.repair_found import Repair
from studies.jsbsim_world.airframes import airframe_of
from studies.jsbsim_world.fly_models import fly

TYPES = ("A319", "A320", "A321", "B738", "E190")
JUDGES = 200
"""Flights that judge; none of their aircraft is among those that repair."""
COEFFICIENTS = ("cd0_cr", "cd2_cr", "ct_des_high")
MODELS, MODEL_SEED = ("fokker100", "MD11"), 6100
FIRST_FLIGHTS, POOL, MODEL_JUDGES = 60, 100, 60
"""Flights of a JSBSim model whose repair stands for the right file, of which each file's are drawn, and that judge."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("--seed", type=int, default=49)
    parser.add_argument("--files", type=int, default=50)
    parser.add_argument("--jsbsim", action="store_true", help="flights of JSBSim's models (extra jsbsim)")
    args = parser.parse_args()
    repaired = []
    fly = model_file if args.jsbsim else one_file
    for number in range(args.files):
        rng = np.random.default_rng([args.seed, number])
        repaired.append(fly(rng, number, args.out.parent))
        args.out.write_text(json.dumps(repaired, indent=1))
        print(f"{number}: {repaired[-1]}", flush=True)
    print(summary(repaired))


def one_file(rng: np.random.Generator, number: int, folder: Path) -> dict[str, Any]:
    """Plant, repair and judge one file."""
    began = time.monotonic()
    true = open_aircraft(str(rng.choice(TYPES)))
    names, factors = planted(rng)
    flights = round(float(np.exp(rng.uniform(np.log(20), np.log(300)))))
    beside: dict[str, dict[str, float]] = {}
    if rng.random() < 0.4:
        low = float(rng.uniform(180, 240))
        beside["speed_brake"] = {
            "factor": float(rng.uniform(1.3, 1.8)),
            "share": float(rng.uniform(0.3, 0.6)),
            "low_fl": low,
            "high_fl": low + 50.0,
        }
    if rng.random() < 0.4:
        beside["temperature"] = {"deviation_k": float(rng.uniform(-10, 15)), "spread_k": 2.0}
    if rng.random() < 0.4:
        beside["wind_gradient"] = {"slope_kt_per_kft": float(rng.uniform(-3, 3))}
    bada = written(true, factors, folder / f"file_{number:02d}")
    seed = int(rng.integers(1, 2**30))
    world = df.simulate(true, flights, seed=seed, plant=beside)
    facts = {
        "type": true.typecode,
        "flights": flights,
        "factors": factors.round(3).tolist(),
        "beside": sorted(beside),
    }
    out = folder / f"repaired_{number:02d}"
    try:
        repair = repaired(df.prepare(world), true.typecode, bada, out)
    except DescentflowError as error:
        return facts | {"error": str(error)}
    gauge = float(world.flights["mass_kg"].to_numpy().mean()) / float(true.mass_reference_kg)
    truth = [true.cd0_cr / gauge, true.cd2_cr * gauge, true.ct_des_high / gauge]
    mine = {estimate.name: estimate for estimate in repair.estimates}
    inside = [bool(mine[n].low <= value <= mine[n].high) for n, value in zip(COEFFICIENTS, truth, strict=True)]
    judge = df.prepare(df.simulate(true, JUDGES, seed=seed + 1))
    return facts | {"planted": sorted(int(k) for k in names), "inside": inside} | judged(repair, judge, out, began)


def model_file(rng: np.random.Generator, number: int, folder: Path) -> dict[str, Any]:
    """Plant, repair and judge one file by flights of a JSBSim model."""
    began = time.monotonic()
    airframe = airframe_of(MODELS[number % len(MODELS)])
    right, pool, judge = _model_flights(airframe.name, airframe.reference, folder)
    names, factors = planted(rng)
    bada = written(right.after, factors, folder / f"file_{number:02d}")
    tails = rng.permutation(pool["icao24"].unique().sort().to_numpy())
    flights = pool.filter(pl.col("icao24").is_in(tails[: round(float(np.exp(rng.uniform(np.log(6), np.log(20)))))]))
    facts = {"type": airframe.name, "flights": flights["flight_id"].n_unique(), "factors": factors.round(3).tolist()}
    out = folder / f"repaired_{number:02d}"
    try:
        repair = repaired(flights, airframe.reference, bada, out)
    except DescentflowError as error:
        return facts | {"error": str(error)}
    pairs = [[{one.name: one for one in fit.estimates}[n] for fit in (right, repair)] for n in COEFFICIENTS]
    inside = [
        abs(now.after - first.after) <= np.hypot(first.high - first.low, now.high - now.low) / 2 for first, now in pairs
    ]
    return (
        facts
        | {"planted": sorted(int(k) for k in names), "inside": [bool(one) for one in inside]}
        | judged(repair, judge, out, began)
    )


@cache
def _model_flights(model: str, typecode: str, folder: Path) -> tuple[Repair, pl.DataFrame, pl.DataFrame]:
    """The file that stands for the right one, flights to draw from, and those that judge."""
    first, pool, judge = (
        df.prepare(fly(model, flights, MODEL_SEED + k, typecode=typecode).rows).frame
        for k, flights in enumerate((FIRST_FLIGHTS, POOL, MODEL_JUDGES))
    )
    out = folder / f"right_{model}"
    out.mkdir(parents=True, exist_ok=True)
    return df.repair(first, aircraft=typecode, out=out / f"{typecode}.toml"), pool, judge


def planted(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Positions of the coefficients that are off, and all three factors."""
    names = rng.choice(3, size=rng.integers(1, 4), replace=False)
    factors = np.ones(3)
    factors[names] = 1 + rng.choice([-1, 1], len(names)) * rng.uniform(0.05, 0.4, len(names))
    return names, factors


def written(true: Any, factors: np.ndarray, folder: Path) -> Path:
    """Folder of the wrong file."""
    wrong = true.with_factors(parasitic=float(factors[0]), induced=float(factors[1]), idle=float(factors[2]))
    folder.mkdir(parents=True, exist_ok=True)
    name = f"{true.typecode:_<6}"
    write_opf(wrong, folder / f"{name}.OPF")
    write_apf(wrong, folder / f"{name}.APF")
    return folder


def repaired(flights: Any, typecode: str, bada: Path, out: Path) -> Repair:
    """The repair, its files written."""
    out.mkdir(exist_ok=True)
    return df.repair(flights, aircraft=typecode, bada_dir=bada, out=out / f"{typecode}.toml")


def judged(repair: Repair, judge: Any, out: Path, began: float) -> dict[str, Any]:
    """A fresh diagnosis by other flights, and errors on aircraft that were not used."""
    report = df.diagnose(judge, df.aircraft(repair.after.typecode, bada_dir=out), seed=0)
    cost = next((each for each in report.costs if each.name == "time"), None)
    return {
        "changed": repair.changed,
        "verdict": report.verdict,
        "causes": [cause.effect for cause in report.causes],
        "time_before": repair.held_out.time.before,
        "time_after": repair.held_out.time.after,
        "time_over_floor": abs(repair.held_out.time.after) / repair.held_out.time.floor,
        "judge_time_s": None if cost is None else cost.before.estimate,
        "judge_floor_s": None if cost is None else cost.floor,
        "seconds": round(time.monotonic() - began, 1),
    }


def summary(cases: list[dict[str, Any]]) -> str:
    """Shares of what the issue asks for."""
    good = [case for case in cases if "error" not in case]
    inside = [flag for case in good for k, flag in enumerate(case["inside"]) if k in case["planted"]]
    every = [flag for case in good for flag in case["inside"]]
    close = [case["time_over_floor"] <= 1.2 for case in good]
    return "\n".join(
        [
            f"{len(good)} of {len(cases)} files repaired",
            f"fresh diagnosis says none: {np.mean([case['verdict'] == 'none' for case in good]):.0%}",
            f"time within 1.2 floors, aircraft not used: {np.mean(close):.0%}",
            f"planted coefficients inside their 90 % intervals: {np.mean(inside):.0%} of {len(inside)}",
            f"all coefficients inside: {np.mean(every):.0%} of {len(every)}",
        ]
    )


if __name__ == "__main__":
    main()
