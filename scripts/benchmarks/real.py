"""Time over runs of real flights: the open types and their rivals, each from the same start."""

import argparse
import importlib
import time
import warnings
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import torch

import descentflow as df
from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
from descentflow.core.constants import G0_MPS2
from descentflow.core.units import FL_M, FT_M, KT_MPS
from descentflow.physics.airspeed import cas_to_mach, mach_to_tas_mps
from descentflow.physics.atmosphere import isa_fraction, temperature_k
from descentflow.physics.energy import energy_share_factor_exact
from descentflow.surveillance.formats.aircraft_json import embedded_rows, embedded_types
from studies.aircraft.real_runs import Run, before, nominal_error, own_speed_error, runs_of, table

TYPES = ("A319", "A320", "A321", "A20N", "A21N", "B737", "B738", "AT76")
SLOWEST_MPS = 0.5
STEP_S, LONGEST_S = 4.0, 3000.0
FROM_M, GLIDE = 700e3, 18.0
"""node-fdm's distance from the departure, and that to the destination over the height: nothing more is known here."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the part's options."""
    parser.add_argument("rows", type=Path, nargs="*", help="rows of other places than Bengaluru, with types")
    parser.add_argument("--node-fdm", action="store_true", help="ask node-fdm too, which must be installed (EUPL)")


def run(args: argparse.Namespace) -> None:
    """Print medians of the errors with intervals by aircraft, and seconds a run."""
    places = {"bengaluru": df.prepare(embedded_rows(), types=embedded_types(), bottom_fl=60).frame}
    places |= {path.stem: df.prepare(path, bottom_fl=60).frame for path in args.rows}
    runs = [one for name, frame in places.items() for one in runs_of(frame, name) if one.typecode in TYPES]
    models: dict[str, Callable[[Run], float]] = {
        "schedule before": lambda one: nominal_error(one, before(one.typecode)),
        "schedule now": lambda one: nominal_error(one, open_aircraft(one.typecode)),
        "own speeds before": lambda one: own_speed_error(one, before(one.typecode)),
        "own speeds now": lambda one: own_speed_error(one, open_aircraft(one.typecode)),
        "OpenAP schedule": openap_schedule,
        "OpenAP own speeds": openap_own_speeds,
    }
    if args.node_fdm:
        models["node-fdm"] = node_fdm
    errors: dict[str, Sequence[float]] = {}
    for name, error in models.items():
        began = time.perf_counter()
        errors[name] = [error(one) for one in runs]
        seconds = (time.perf_counter() - began) / len(runs)
        known = np.array([value for value in errors[name] if np.isfinite(value)])
        size = 100 * np.abs(known)
        middle = (
            f"median {100 * np.median(known):+.0f} %, absolute median {np.median(size):.0f} %, mean {size.mean():.0f} %"
        )
        print(f"{name}: {len(known)} runs, error {middle}, {seconds:.4f} s a run", flush=True)
    for row in [["place", "type", "runs", *errors], *table(runs, errors)]:
        print("  ".join(f"{cell:<20}" for cell in row))


def openap_own_speeds(one: Run) -> float:
    """OpenAP's polar and idle thrust at our reference mass, at the flight's own speeds in its own air."""
    openap: Any = importlib.import_module("openap")
    altitude = one.levels_fl * FL_M
    share = energy_share_factor_exact(one.cas_mps, altitude, one.deviation_k, one.tailwind_mps)
    tas = mach_to_tas_mps(cas_to_mach(one.cas_mps, altitude), altitude, one.deviation_k)
    mass = float(open_aircraft(one.typecode).mass_reference_kg)
    speed, height = (tas / KT_MPS).numpy(), (altitude / FT_M).numpy()
    if one.typecode == "AT76":  # OpenAP has an E145 in its place
        return float("nan")
    with warnings.catch_warnings(action="ignore"):  # an A20N's polar stands for the A21N
        drag = openap.Drag(one.typecode, use_synonym=True).clean(mass, speed, height)
        idle = openap.Thrust(one.typecode, use_synonym=True).descent_idle(speed, height)
    excess = torch.from_numpy(np.asarray(drag - idle)) / (mass * G0_MPS2)
    rate = excess * tas * share * isa_fraction(altitude, one.deviation_k)
    return float(torch.trapezoid(1 / rate.clamp(min=SLOWEST_MPS), altitude)) / one.seconds - 1.0


def openap_schedule(one: Run) -> float:
    """OpenAP's descent of mean kinematics between the run's levels."""
    openap: Any = importlib.import_module("openap")
    try:
        table_of = openap.FlightGenerator(ac=one.typecode).descent(dt=1)
    except (ValueError, KeyError, RuntimeError):
        return float("nan")
    ends = one.levels_fl[[0, -1]].numpy() * FL_M
    height, seconds = table_of["h"].to_numpy(), table_of["t"].to_numpy()
    falling = np.concatenate([[True], np.diff(height) < 0])
    bottom, top = np.interp(ends, height[falling][::-1], seconds[falling][::-1])
    return float(bottom - top) / one.seconds - 1.0


@cache
def _node_fdm_model(typecode: str) -> Any:
    root = (
        Path(str(importlib.import_module("node_fdm").__file__)).parent / "models" / "pretrained_models" / "opensky_2025"
    )
    folder = root / f"opensky_{typecode}"
    if not folder.is_dir():
        return None
    kind: Any = importlib.import_module("node_fdm.models.flight_dynamics_model_prod")
    return kind.FlightDynamicsModelProd(folder).eval()


def node_fdm(one: Run) -> float:
    """node-fdm from the run's first state: its own speed held, as Mach until the type's CAS; no selected rate.

    Its selected values are those that a predictor can know. Temperature and wind are the flight's own by level.
    """
    model = _node_fdm_model(one.typecode)
    if model is None:
        return float("nan")
    columns: Any = importlib.import_module("node_fdm.architectures.opensky_2025.columns")
    altitude = (one.levels_fl * FL_M).numpy()
    kelvin = temperature_k(one.levels_fl * FL_M, one.deviation_k).numpy()
    wind = one.tailwind_mps.numpy()
    top, bottom = altitude[-1], altitude[0]
    mach = float(cas_to_mach(one.cas_mps, one.levels_fl * FL_M)[-1])
    tas = float(mach_to_tas_mps(mach, float(top), one.deviation_k[-1]))
    first_rate = float(np.median(one.rows["vertical_rate"].to_numpy()[:5])) * FT_M / 60
    by_mach = float(open_aircraft(one.typecode).transition_altitude_m()) < top
    limit = float(open_aircraft(one.typecode).des_cas_high_kt) * KT_MPS if by_mach else float(one.cas_mps[-1])
    state = {
        columns.col_dist: 0.0,
        columns.col_alt: float(top),
        columns.col_gamma: float(np.arcsin(np.clip(first_rate / tas, -0.2, 0.0))),
        columns.col_tas: tas,
    }
    seconds = 0.0
    while state[columns.col_alt] > bottom and seconds < LONGEST_S:
        height = state[columns.col_alt]
        inputs = {
            **state,
            columns.col_alt_sel: max(bottom - 1500.0, 600.0),
            columns.col_mach_sel: mach if by_mach else 0.0,
            columns.col_cas_sel: 0.0 if by_mach else limit,
            columns.col_vz_sel: 0.0,
            columns.col_long_wind_spd: -float(np.interp(height, altitude, wind)),
            columns.col_adep_dist: FROM_M,
            columns.col_ades_dist: GLIDE * height,
            columns.col_temp: float(np.interp(height, altitude, kelvin)),
        }
        with torch.no_grad():
            found = model.forward({name: torch.tensor([value], dtype=torch.float32) for name, value in inputs.items()})
        by_mach = by_mach and float(found[columns.col_cas]) < limit
        rate = float(found[columns.col_vz])
        if height + STEP_S * rate < bottom:
            return (seconds + (height - bottom) / max(-rate, SLOWEST_MPS)) / one.seconds - 1.0
        state[columns.col_alt] = height + STEP_S * rate
        state[columns.col_dist] += STEP_S * float(found[columns.col_gs])
        state[columns.col_gamma] += STEP_S * float(found[columns.col_gamma.derivative])
        state[columns.col_tas] += STEP_S * float(found[columns.col_tas.derivative])
        seconds += STEP_S
    return seconds / one.seconds - 1.0
