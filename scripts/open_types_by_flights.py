"""Coefficients of the open types by real flights, leave-one-aircraft-out, and a crew manual's figure beside them.

python scripts/open_types_by_flights.py ROWS.parquet ...    # beside the embedded rows of Bengaluru
python scripts/open_types_by_flights.py ROWS.parquet --check OTHER.parquet   # runs of another place, not fitted

Prints errors of the time over runs before and after, by place and type, each aircraft by a fit of the others; then the
estimates of all flights with 90 % intervals, as the type files have them.
"""

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import torch

import descentflow as df
from descentflow.core.errors import DataError
from descentflow.core.units import FT_M, KT_MPS
from descentflow.physics.airspeed import cas_to_mach, mach_to_tas_mps
from descentflow.physics.energy import descent_rate_mps, energy_share_factor
from descentflow.repairs.mixed_model import WIDE, MixedModelPosterior, before_flights, predictive_log_density
from descentflow.repairs.type_fit import TypeFlights, codes_of, fit_types, linearised, type_flights
from descentflow.surveillance.formats.aircraft_json import embedded_rows, embedded_types
from studies.aircraft.real_runs import Run, before, nominal_error, own_speed_error, runs_of, table

TYPES = ("A319", "A320", "A321", "A20N", "A21N", "B737", "B738", "AT76")
BOTTOM_FL = 60
MANUAL_TYPES, MANUAL_KG, MANUAL_S = ("A319", "A320", "A20N"), 65_000.0, 204


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("rows", type=Path, nargs="*", help="rows with types, a place each")
    parser.add_argument("--check", type=Path, nargs="*", default=[], help="rows of places that are not fitted")
    parser.add_argument("--types", default=",".join(TYPES))
    args = parser.parse_args()
    places = {"bengaluru": df.prepare(embedded_rows(), types=embedded_types(), bottom_fl=BOTTOM_FL).frame}
    places |= {path.stem: df.prepare(path, bottom_fl=BOTTOM_FL).frame for path in args.rows}
    judge(
        places, {path.stem: df.prepare(path, bottom_fl=BOTTOM_FL).frame for path in args.check}, args.types.split(",")
    )


def repaired(aircraft: Any, theta: np.ndarray) -> Any:
    """The aircraft at ln CD0, ln CD2 and relative idle thrust (3,) over its own."""
    zero, two, idle = (float(value) for value in theta)
    return aircraft.with_factors(parasitic=float(np.exp(zero)), induced=float(np.exp(two)), idle=1.0 + idle)


def judge(places: Mapping[str, pl.DataFrame], checks: Mapping[str, pl.DataFrame], codes: Sequence[str]) -> None:
    """Print errors before and after, and the estimates."""
    for engine in ("jet", "turboprop"):
        mine = [code for code in codes if before(code).engine == engine]
        parts, names = _measured(places, mine)
        if not parts:
            continue
        whole = fit_types(parts)
        runs = [run for name, frame in places.items() for run in runs_of(frame, name) if run.typecode in mine]
        errors = {"before": [own_speed_error(run, before(run.typecode)) for run in runs]}
        schedule = [nominal_error(run, before(run.typecode)) for run in runs]
        after, gains = _left_out(parts, names, runs)
        for code, values in gains.items():
            print(f"{code}: {sum(values):+.1f} nats over {len(values)} aircraft, by the fit of the others")
        print(f"\n{engine}: error of the time over runs, percent, median (90 % by aircraft)")
        errors |= {"after": after, "schedule before": schedule}
        for row in [["place", "type", "runs", *errors], *table(runs, errors)]:
            print("  ".join(f"{cell:<22}" for cell in row))
        for name, values in errors.items():
            size = np.abs(values)
            middle, mean = 100 * np.median(size), 100 * size.mean()
            print(f"{name}, {len(size)} runs: median {middle:.1f} %, mean {mean:.1f} % absolute")
        other = [run for name, frame in checks.items() for run in runs_of(frame, name) if run.typecode in mine]
        if other:
            final = {code: repaired(before(code), whole.mean[k]) for k, code in enumerate(codes_of(parts))}
            other = [run for run in other if run.typecode in final]
            checked = {
                "before": [own_speed_error(run, before(run.typecode)) for run in other],
                "after": [own_speed_error(run, final[run.typecode]) for run in other],
            }
            print("places that were not fitted")
            for row in [["place", "type", "runs", *checked], *table(other, checked)]:
                print("  ".join(f"{cell:<22}" for cell in row))
            for name, values in checked.items():
                print(f"{name}: median absolute {100 * np.median(np.abs(values)):.1f} %")
        _estimates(parts, whole)
        _manual(parts, whole)


def _measured(places: Mapping[str, pl.DataFrame], codes: Sequence[str]) -> tuple[list[TypeFlights], list[list[str]]]:
    """Flights by type and place, and the aircraft of each flight."""
    parts, names = [], []
    for code in codes:
        for frame in places.values():
            some = frame.filter(typecode=code)
            if some.is_empty():
                continue
            try:
                part = type_flights(some, before(code), frame)
            except DataError:
                continue
            owner = dict(some.select("flight_id", "icao24").unique().iter_rows())
            parts.append(part)
            names.append([owner[name] or "" for name in part.evidence.quantities.names])
    return parts, names


def _left_out(
    parts: Sequence[TypeFlights], names: Sequence[Sequence[str]], runs: Sequence[Run]
) -> tuple[list[float], dict[str, list[float]]]:
    """Error of each run by a fit of all other aircraft, variances and pooling included.

    And by type what an aircraft's flights gain in log density over the coefficients as they were, in nats.
    """
    found: dict[str, dict[str, np.ndarray]] = {}
    gains: dict[str, list[float]] = {}
    for tail in sorted({owner for owners in names for owner in owners}):
        kept, left = [], []
        for part, owners in zip(parts, names, strict=True):
            mine = np.array([owner == tail for owner in owners])
            kept += [part.rows(np.flatnonzero(~mine))] if not mine.all() else []
            left += [part.rows(np.flatnonzero(mine))] if mine.any() else []
        fit, codes = fit_types(kept), codes_of(kept)
        found[tail] = dict(zip(codes, fit.mean, strict=True))
        for part in left:
            if (code := part.aircraft.typecode) in codes:
                gains.setdefault(code, []).append(_gain(part, fit, codes.index(code)))
    errors = []
    for run in runs:
        theta = found[run.icao24].get(run.typecode, np.zeros(3)) if run.icao24 in found else np.zeros(3)
        errors.append(own_speed_error(run, repaired(before(run.typecode), theta)))
    return errors, gains


def _gain(part: TypeFlights, fit: MixedModelPosterior, kind: int) -> float:
    after = fit.only(kind)
    both = (before_flights(linearised([part], after.mean), fit.sizes), after)
    first, second = (float(predictive_log_density(linearised([part], one.mean), one).sum()) for one in both)
    return second - first


def _estimates(parts: Sequence[TypeFlights], found: MixedModelPosterior) -> None:
    print(f"\nsizes: {found.sizes}")
    for k, code in enumerate(codes_of(parts)):
        mean, covariance = found.of(k)
        spread = WIDE * np.sqrt(covariance.diagonal())
        flights = sum(len(part.evidence) for part in parts if part.aircraft.typecode == code)
        after = repaired(before(code), mean)
        print(f"{code}: {flights} flights")
        for name, place in {"cd0_cr": 0, "cd2_cr": 1, "ct_des_low": 2, "ct_des_high": 2}.items():
            value = float(getattr(before(code), name))
            ends = mean[place] - spread[place], mean[place] + spread[place]
            low, high = (value * (np.exp(end) if place < 2 else 1 + end) for end in ends)
            print(f"  {name}: {value:.4g} -> {float(getattr(after, name)):.4g}  [{low:.4g}, {high:.4g}]")


def _manual(parts: Sequence[TypeFlights], found: MixedModelPosterior) -> None:
    """A flight crew manual's idle descent, quoted in public without its variant; a check, fitted by nothing here."""
    altitude = torch.linspace(5_000, 10_000, 101, dtype=torch.float64) * FT_M
    mach = cas_to_mach(250.0 * KT_MPS, altitude)
    tas, share = mach_to_tas_mps(mach, altitude), energy_share_factor(mach, altitude, torch.tensor(False))
    for k, code in enumerate(codes_of(parts)):
        if code not in MANUAL_TYPES:
            continue
        for name, kind in (("before", before(code)), ("after", repaired(before(code), found.mean[k]))):
            drag, idle = kind.drag_n(tas, altitude, 0.0, MANUAL_KG), kind.idle_thrust_n(altitude, tas)
            rate = -descent_rate_mps(kind, drag, idle, tas, share, altitude, mass_kg=MANUAL_KG)
            seconds = float(torch.trapezoid(1 / rate, altitude))
            print(f"{code} {name}: {seconds:.0f} s from 10,000 to 5,000 ft at 250 kt and 65 t; the manual {MANUAL_S} s")


if __name__ == "__main__":
    main()
