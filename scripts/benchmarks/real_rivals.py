"""Answers of other programs for the start of a real run: OpenAP, node-fdm and BlueSky, each as it comes.

An answer is the error of the time over the run's levels, NaN where the program has no such type.
"""

import importlib
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import torch

from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
from descentflow.core.constants import G0_MPS2
from descentflow.core.units import FL_M, FT_M, KT_MPS
from descentflow.physics.airspeed import cas_to_mach, mach_to_tas_mps
from descentflow.physics.atmosphere import isa_fraction, temperature_k
from descentflow.physics.energy import energy_share_factor_exact
from flying.bluesky_fleet import Orders, fly, start
from flying.flight_plans import EVERY_S, FlightPlan
from studies.aircraft.real_runs import Run

SLOWEST_MPS = 0.5
JET_INSTEAD = "AT76"
"""OpenAP has an E145 in its place."""
STEP_S, LONGEST_S = 4.0, 3000.0
FROM_M, GLIDE = 700e3, 18.0
"""node-fdm's distance from the departure, and that to the destination over the height: nothing more is known here."""


@dataclass(frozen=True)
class FirstSpeed:
    """Speeds of a run that a predictor knows: its first Mach number until the type's CAS, or its first CAS."""

    mach: float
    by_mach: bool
    cas_mps: float


def first_speed(run: Run) -> FirstSpeed:
    """The speeds that are held from the run's first level on."""
    altitude, kind = run.levels_fl * FL_M, open_aircraft(run.typecode)
    by_mach = float(kind.transition_altitude_m()) < float(altitude[-1])
    cas = float(kind.des_cas_high_kt) * KT_MPS if by_mach else float(run.cas_mps[-1])
    return FirstSpeed(float(cas_to_mach(run.cas_mps, altitude)[-1]), by_mach, cas)


def openap_own_speeds(run: Run) -> float:
    """OpenAP's polar and idle thrust at our reference mass, at the flight's own speeds in its own air."""
    openap: Any = importlib.import_module("openap")
    altitude = run.levels_fl * FL_M
    share = energy_share_factor_exact(run.cas_mps, altitude, run.deviation_k, run.tailwind_mps)
    tas = mach_to_tas_mps(cas_to_mach(run.cas_mps, altitude), altitude, run.deviation_k)
    mass = float(open_aircraft(run.typecode).mass_reference_kg)
    speed, height = (tas / KT_MPS).numpy(), (altitude / FT_M).numpy()
    if run.typecode == JET_INSTEAD:
        return float("nan")
    with warnings.catch_warnings(action="ignore"):  # an A20N's polar stands for the A21N
        drag = openap.Drag(run.typecode, use_synonym=True).clean(mass, speed, height)
        idle = openap.Thrust(run.typecode, use_synonym=True).descent_idle(speed, height)
    excess = torch.from_numpy(np.asarray(drag - idle)) / (mass * G0_MPS2)
    rate = excess * tas * share * isa_fraction(altitude, run.deviation_k)
    return float(torch.trapezoid(1 / rate.clamp(min=SLOWEST_MPS), altitude)) / run.seconds - 1.0


def openap_schedule(run: Run) -> float:
    """OpenAP's descent of mean kinematics between the run's levels."""
    openap: Any = importlib.import_module("openap")
    if run.typecode == JET_INSTEAD:
        return float("nan")
    with warnings.catch_warnings(action="ignore"):  # an A320's means stand for the A20N and the A21N
        table_of = openap.FlightGenerator(ac=run.typecode, use_synonym=True).descent(dt=1)
    ends = run.levels_fl[[0, -1]].numpy() * FL_M
    height, seconds = table_of["h"].to_numpy(), table_of["t"].to_numpy()
    falling = np.concatenate([[True], np.diff(height) < 0])
    bottom, top = np.interp(ends, height[falling][::-1], seconds[falling][::-1])
    return float(bottom - top) / run.seconds - 1.0


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


def node_fdm(run: Run) -> float:
    """node-fdm from the run's first state: its own speed held, as Mach until the type's CAS; no selected rate.

    Its selected values are those that a predictor can know. Temperature and wind are the flight's own by level.
    """
    model = _node_fdm_model(run.typecode)
    if model is None:
        return float("nan")
    columns: Any = importlib.import_module("node_fdm.architectures.opensky_2025.columns")
    altitude = (run.levels_fl * FL_M).numpy()
    kelvin = temperature_k(run.levels_fl * FL_M, run.deviation_k).numpy()
    wind = run.tailwind_mps.numpy()
    top, bottom = altitude[-1], altitude[0]
    held = first_speed(run)
    mach, by_mach, limit = held.mach, held.by_mach, held.cas_mps
    tas = float(mach_to_tas_mps(mach, float(top), run.deviation_k[-1]))
    first_rate = float(np.median(run.rows["vertical_rate"].to_numpy()[:5])) * FT_M / 60
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
            ahead = model.forward({name: torch.tensor([value], dtype=torch.float32) for name, value in inputs.items()})
        by_mach = by_mach and float(ahead[columns.col_cas]) < limit
        rate = float(ahead[columns.col_vz])
        if height + STEP_S * rate < bottom:
            return (seconds + (height - bottom) / max(-rate, SLOWEST_MPS)) / run.seconds - 1.0
        state[columns.col_alt] = height + STEP_S * rate
        state[columns.col_dist] += STEP_S * float(ahead[columns.col_gs])
        state[columns.col_gamma] += STEP_S * float(ahead[columns.col_gamma.derivative])
        state[columns.col_tas] += STEP_S * float(ahead[columns.col_tas.derivative])
        seconds += STEP_S
    return seconds / run.seconds - 1.0


def bluesky(runs: Sequence[Run]) -> list[float]:
    """BlueSky from each run's first level at its first speed, side by side: no rate, no air, no path commanded."""
    program = start()
    known = {name.upper() for name in program.traf.perf.coeff.actypes_fixwing}
    plans = {i: _plan(flight, str(i)) for i, flight in enumerate(runs) if flight.typecode in known}
    errors = [float("nan")] * len(runs)
    for i, state in zip(plans, fly(program, list(plans.values()), Orders()), strict=True):
        # Ascending, for np.interp; the lowest state is a second below the run's bottom.
        seconds = float(np.interp(plans[i].bottom_fl * 100, state["altitude"][::-1], state["time_s"][::-1]))
        errors[i] = seconds / runs[i].seconds - 1.0
    return errors


def _plan(run: Run, name: str) -> FlightPlan:
    held, levels, first = first_speed(run), run.levels_fl, run.rows["timestamp"].min()
    mach = held.mach if held.by_mach else float("nan")
    cas_kt = held.cas_mps / KT_MPS
    return FlightPlan(
        name, name, run.typecode, first, float(levels[-1]), float(levels[0]), mach, cas_kt, (EVERY_S,), ()
    )
