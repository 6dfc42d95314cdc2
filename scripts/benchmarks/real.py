"""Time over runs of real flights: the open types and their rivals, each from the same start."""

import argparse
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

import descentflow as df
from benchmarks.real_fidelity import BOTTOM_FL, print_fidelity
from benchmarks.real_rivals import bluesky, node_fdm, openap_own_speeds, openap_schedule
from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
from descentflow.core.tabular import optional_library
from descentflow.surveillance.formats.aircraft_json import embedded_rows, embedded_types
from studies.aircraft.real_runs import Run, before, by_aircraft, nominal_error, own_speed_error, runs_of, table

TYPES = ("A319", "A320", "A321", "A20N", "A21N", "B737", "B738", "AT76")
Answer = Callable[[Sequence[Run]], list[float]]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the part's options."""
    parser.add_argument("rows", type=Path, nargs="*", help="rows of other places than Bengaluru, with types")
    parser.add_argument("--node-fdm", action="store_true", help="ask node-fdm too (extra node-fdm, EUPL)")
    parser.add_argument(
        "--fidelity", action="store_true", help="judge samples by folds of aircraft, from FL100 (alone)"
    )
    parser.add_argument("--models", nargs="+", default=["gaussian", "default"], help="of --fidelity")
    parser.add_argument("--deals", type=int, default=1, help="of --fidelity: times that aircraft are dealt to folds")
    parser.add_argument("--seed", type=int, default=0, help="of --fidelity: folds and draws")
    parser.add_argument("--bluesky", action="store_true", help="fly BlueSky too (extra bluesky, GPL)")


def run(args: argparse.Namespace) -> None:
    """Print medians of the errors with intervals by aircraft, and seconds a run; or how samples fare."""
    for library, extra, asked in (("node_fdm", "node-fdm", args.node_fdm), ("bluesky", "bluesky", args.bluesky)):
        if asked:
            optional_library(library, extra)
    if args.fidelity:
        named = {"bengaluru": df.prepare(embedded_rows(), types=embedded_types(), bottom_fl=BOTTOM_FL)}
        named |= {path.stem: df.prepare(path, bottom_fl=BOTTOM_FL) for path in args.rows}
        print_fidelity(named, tuple(args.models), args.seed, args.deals, ask_node_fdm=args.node_fdm)
        return
    places = {"bengaluru": df.prepare(embedded_rows(), types=embedded_types(), bottom_fl=60).frame}
    places |= {path.stem: df.prepare(path, bottom_fl=60).frame for path in args.rows}
    runs = [flight for name, frame in places.items() for flight in runs_of(frame, name) if flight.typecode in TYPES]
    tails = np.array([flight.icao24 for flight in runs])
    models: dict[str, Answer] = {
        "schedule before": _each(lambda flight: nominal_error(flight, before(flight.typecode))),
        "schedule now": _each(lambda flight: nominal_error(flight, open_aircraft(flight.typecode))),
        "own speeds before": _each(lambda flight: own_speed_error(flight, before(flight.typecode))),
        "own speeds now": _each(lambda flight: own_speed_error(flight, open_aircraft(flight.typecode))),
        "OpenAP schedule": _each(openap_schedule),
        "OpenAP own speeds": _each(openap_own_speeds),
    }
    models |= {"node-fdm": _each(node_fdm)} if args.node_fdm else {}
    models |= {"BlueSky": bluesky} if args.bluesky else {}
    errors: dict[str, Sequence[float]] = {}
    for name, answer in models.items():
        began = time.perf_counter()
        errors[name] = answer(runs)
        seconds = (time.perf_counter() - began) / len(runs)
        known = np.isfinite(errors[name])
        percent = 100 * np.array(errors[name])[known]
        size = np.abs(percent)
        middle, low, high = by_aircraft(percent, tails[known])
        off, low_off, high_off = by_aircraft(size, tails[known])
        print(
            f"{name}: {len(size)} runs, error median {middle:+.0f} ({low:+.0f} to {high:+.0f}) %, "
            f"absolute median {off:.0f} ({low_off:.0f} to {high_off:.0f}) %, mean {size.mean():.0f} %, "
            f"{seconds:.4f} s a run",
            flush=True,
        )
    for row in [["place", "type", "runs", *errors], *table(runs, errors)]:
        print("  ".join(f"{cell:<20}" for cell in row))


def _each(error: Callable[[Run], float]) -> Answer:
    return lambda runs: [error(flight) for flight in runs]
