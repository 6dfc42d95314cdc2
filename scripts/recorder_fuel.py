"""Fuel of a recorded A320 descent by descentflow's law, OpenAP and Acropole, beside what the recorder measured.

    python scripts/recorder_fuel.py recorder.csv --acropole .venv-acropole/bin/python

Acropole needs Python 3.12 and an environment of its own (`pip install acropole`).

The file is that of Acropole's example (DGAC): a row a second with FLIGHT_TIME (s), ALTI_STD_FT, TRUE_AIR_SPD_KT,
VERT_SPD_FTMN, MASS_KG and FUEL_FLOW_KGH of one of two engines. It has no temperature; standard air is assumed.
"""

import argparse
import subprocess
from pathlib import Path

import numpy as np
import polars as pl
import torch

from descentflow.aircraft_types.registry import aircraft
from descentflow.core.units import FL_M, FT_M, KT_MPS
from descentflow.physics.airspeed import tas_to_cas_mps
from descentflow.physics.fuel import CO2_PER_FUEL, burn

STRETCHES_FL = ((330, 100), (330, 150), (150, 100), (100, 20))
SMOOTH_S = 11
"""Rows of a moving mean: altitude and speed come in steps."""


def main() -> None:
    """Print a table: fuel by stretch."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recorder", type=Path)
    parser.add_argument("--typecode", default="A320")
    parser.add_argument("--acropole", type=Path, help="Python with acropole (default: left out)")
    args = parser.parse_args()
    rows = descent_of(args.recorder)
    level = rows["ALTI_STD_FT"].to_numpy() * FT_M / FL_M
    flows = {"recorder": 2 * rows["FUEL_FLOW_KGH"].to_numpy() / 3600, **ours(rows, args.typecode)}
    openap = openap_flow(rows, args.typecode)
    if openap is not None:
        flows["OpenAP"] = openap
    if args.acropole:
        flows |= acropole_flows(rows, args.typecode, args.acropole)
    print(f"{'kg of fuel':<14}" + "".join(f"{name:>18}" for name in flows))
    for high, low in STRETCHES_FL:
        first, last = np.flatnonzero(level <= high)[0], np.flatnonzero(level >= low)[-1] + 1
        burnt = {name: float(flow[first:last].sum()) for name, flow in flows.items()}
        cells = (f"{kg:>9.1f} ({kg / burnt['recorder'] - 1:+6.1%})" for kg in burnt.values())
        print(f"{f'FL{high}-{low}':<14}" + "".join(cells))
        if (high, low) == STRETCHES_FL[0]:
            print(f"{'  CO2':<14}" + "".join(f"{CO2_PER_FUEL * kg:>9.1f}{'':9}" for kg in burnt.values()))


def descent_of(file: Path) -> pl.DataFrame:
    """Rows after the last one at the highest altitude."""
    rows = pl.read_csv(file)
    altitude = rows["ALTI_STD_FT"].to_numpy()
    return rows[int(np.flatnonzero(altitude > altitude.max() - 50)[-1]) :]


def ours(rows: pl.DataFrame, typecode: str) -> dict[str, np.ndarray]:
    """Flow in kg/s by the law of samples, and at idle throughout."""
    model, mean = aircraft(typecode), np.ones(SMOOTH_S) / SMOOTH_S
    padded = {
        name: np.convolve(np.pad(rows[name].to_numpy(), SMOOTH_S // 2, mode="edge"), mean, mode="valid")
        for name in ("ALTI_STD_FT", "TRUE_AIR_SPD_KT")
    }
    altitude = torch.from_numpy(padded["ALTI_STD_FT"] * FT_M)
    tas, mass = (
        torch.from_numpy(padded["TRUE_AIR_SPD_KT"] * KT_MPS),
        torch.from_numpy(rows["MASS_KG"].to_numpy().copy()),
    )
    time = rows["FLIGHT_TIME"].to_numpy()
    cas = tas_to_cas_mps(tas, altitude)
    rate = torch.from_numpy(np.gradient(altitude.numpy(), time))
    slope = torch.from_numpy(np.gradient(cas.numpy(), time)) / torch.where(rate.abs() < 0.5, -0.5, rate)
    flow = burn(model, cas, altitude, rate, slope, mass_kg=mass).flow_kg_s
    return {"descentflow": flow.numpy(), "idle": model.idle_fuel_flow_kg_s(altitude, tas).numpy()}


def openap_flow(rows: pl.DataFrame, typecode: str) -> np.ndarray | None:
    """Flow in kg/s by OpenAP's engine model at the rate, or None where it is not installed."""
    try:
        from openap import FuelFlow
    except ImportError:
        return None
    columns = ("MASS_KG", "TRUE_AIR_SPD_KT", "ALTI_STD_FT", "VERT_SPD_FTMN")
    mass, tas, altitude, rate = (rows[name].to_numpy() for name in columns)
    return np.asarray(FuelFlow(typecode).enroute(mass=mass, tas=tas, alt=altitude, vs=rate))


ACROPOLE = """
import sys
import numpy as np
from acropole import FuelEstimator
time, ground, tas, altitude, rate, mass = np.loadtxt(sys.stdin)
model = FuelEstimator().for_aircraft(sys.argv[1])
for given in (mass, None):
    print(*model.estimate(ground, altitude, rate, airspeed=tas, mass=given, second=time))
"""


def acropole_flows(rows: pl.DataFrame, typecode: str, python: Path) -> dict[str, np.ndarray]:
    """Flow in kg/s by Acropole's network, with the recorder's mass and without."""
    names = ("FLIGHT_TIME", "GRND_SPD_KT", "TRUE_AIR_SPD_KT", "ALTI_STD_FT", "VERT_SPD_FTMN", "MASS_KG")
    table = "\n".join(" ".join(map(str, rows[name].to_list())) for name in names)
    done = subprocess.run([python, "-c", ACROPOLE, typecode], input=table, capture_output=True, text=True, check=True)
    flows = [np.array(line.split(), dtype=float) for line in done.stdout.splitlines()[-2:]]
    return dict(zip(("Acropole", "without mass"), flows, strict=True))


if __name__ == "__main__":
    main()
