"""Wrong files planted and repaired: python scripts/study_repair.py OUT.json [--seed 49] [--files 50].

Each file of a type is wrong in one to three of CD0, CD2 and idle thrust by 5 to 40 %. Twenty to 300 flights of the
right file, some with brakes out and some in warm air and wind, repair it. Three questions are asked. Is the time of
aircraft that were not used within 1.2 floors? Does a fresh diagnosis of the repaired nominal descent by other flights
say none? Is each planted coefficient inside its 90 % interval, at the flights' own mean mass? The seed is fixed before
the first look, and a set is judged once.
"""

import argparse
import json
import time
from pathlib import Path
from typing import Any

import numpy as np

import descentflow as df
from descentflow.aircraft_types.bada3.apf_file import apf_of, write_apf
from descentflow.aircraft_types.bada3.opf_file import opf_of, write_opf
from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
from descentflow.core.errors import DescentflowError

TYPES = ("A319", "A320", "A321", "B738", "E190")
JUDGES = 200
"""Flights that judge; none of their aircraft is among those that repair."""
COEFFICIENTS = ("cd0_cr", "cd2_cr", "ct_des_high")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("--seed", type=int, default=49)
    parser.add_argument("--files", type=int, default=50)
    args = parser.parse_args()
    found = []
    for number in range(args.files):
        found.append(one_file(np.random.default_rng([args.seed, number]), number, args.out.parent))
        args.out.write_text(json.dumps(found, indent=1))
        print(f"{number}: {found[-1]}", flush=True)
    print(summary(found))


def one_file(rng: np.random.Generator, number: int, folder: Path) -> dict[str, Any]:
    """Plant, repair and judge one file."""
    began = time.monotonic()
    true = open_aircraft(str(rng.choice(TYPES)))
    names = rng.choice(3, size=rng.integers(1, 4), replace=False)
    factors = np.ones(3)
    factors[names] = 1 + rng.choice([-1, 1], len(names)) * rng.uniform(0.05, 0.4, len(names))
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
    wrong = true.with_factors(parasitic=float(factors[0]), induced=float(factors[1]), idle=float(factors[2]))
    bada = folder / f"file_{number:02d}"
    bada.mkdir(parents=True, exist_ok=True)
    name = f"{true.typecode:_<6}"
    write_opf(opf_of(wrong), bada / f"{name}.OPF")
    write_apf(apf_of(wrong), bada / f"{name}.APF")
    seed = int(rng.integers(1, 2**30))
    world = df.simulate(true, flights, seed=seed, plant=beside)
    facts = {
        "type": true.typecode,
        "flights": flights,
        "factors": factors.round(3).tolist(),
        "beside": sorted(beside),
    }
    try:
        out = folder / f"repaired_{number:02d}"
        out.mkdir(exist_ok=True)
        repair = df.repair(df.prepare(world), aircraft=true.typecode, bada_dir=bada, out=out / f"{true.typecode}.toml")
    except DescentflowError as error:
        return facts | {"error": str(error)}
    gauge = float(world.flights["mass_kg"].to_numpy().mean()) / float(true.mass_reference_kg)
    truth = [true.cd0_cr / gauge, true.cd2_cr * gauge, true.ct_des_high / gauge]
    mine = {one.name: one for one in repair.estimates}
    inside = [bool(mine[n].low <= value <= mine[n].high) for n, value in zip(COEFFICIENTS, truth, strict=True)]
    judge = df.prepare(df.simulate(true, JUDGES, seed=seed + 1))
    report = df.diagnose(judge, df.aircraft(true.typecode, bada_dir=out), seed=0)
    cost = next((one for one in report.costs if one.name == "time"), None)
    return facts | {
        "changed": repair.changed,
        "inside": inside,
        "planted": sorted(int(k) for k in names),
        "verdict": report.verdict,
        "causes": [cause.effect for cause in report.causes],
        "time_before": repair.held_out.time.before,
        "time_after": repair.held_out.time.after,
        "time_over_floor": abs(repair.held_out.time.after) / repair.held_out.time.floor,
        "judge_time_s": None if cost is None else cost.before.estimate,
        "judge_floor_s": None if cost is None else cost.floor,
        "seconds": round(time.monotonic() - began, 1),
    }


def summary(found: list[dict[str, Any]]) -> str:
    """Shares of what the issue asks for."""
    good = [one for one in found if "error" not in one]
    inside = [flag for one in good for k, flag in enumerate(one["inside"]) if k in one["planted"]]
    every = [flag for one in good for flag in one["inside"]]
    close = [one["time_over_floor"] <= 1.2 for one in good]
    return "\n".join(
        [
            f"{len(good)} of {len(found)} files repaired",
            f"fresh diagnosis says none: {np.mean([one['verdict'] == 'none' for one in good]):.0%}",
            f"time within 1.2 floors, aircraft not used: {np.mean(close):.0%}",
            f"planted coefficients inside their 90 % intervals: {np.mean(inside):.0%} of {len(inside)}",
            f"all coefficients inside: {np.mean(every):.0%} of {len(every)}",
        ]
    )


if __name__ == "__main__":
    main()
