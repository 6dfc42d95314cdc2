"""Fly descents in BlueSky as real ones began, and write the rows that a radar would have of them."""

import argparse
from dataclasses import replace
from pathlib import Path

import polars as pl
from tqdm import tqdm

from descentflow.core.errors import DescentflowError
from descentflow.core.tabular import write_table
from descentflow.surveillance.open_descents import FlightSource
from descentflow.surveillance.read_rows import read_rows
from descentflow.surveillance.rows.drop_report import DropReport
from flying.bluesky_fleet import Orders, fly, start
from flying.flight_plans import FlightPlan, flight_plans
from flying.profiles import Profile
from flying.radar_reports import reports, table

EPILOG = "profiles: level:value,level:value; linear between, held outside: --rates 100:-1400,300:-2300"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, epilog=EPILOG)
    add_plan_arguments(parser)
    commands = parser.add_argument_group("commands (none: BlueSky as it comes, 1,500 ft/min at the flights' speeds)")
    commands.add_argument("--step-ft", type=float, help="command altitudes so many feet below, and no further at once")
    commands.add_argument("--rates", type=Profile.of_text, help="vertical speeds, ft/min by flight level")
    commands.add_argument("--rate-spread", type=float, default=0.0, help="spread of flights' own rates (log)")
    commands.add_argument("--wind", type=Profile.of_text, help="tailwind, kt by flight level")
    commands.add_argument("--faster-kt", type=float, default=0.0, help="added to the CAS of every flight")
    commands.add_argument("--warmer-k", type=float, default=0.0, help="warmer than the standard atmosphere")
    args = parser.parse_args()
    orders = Orders(args.step_ft, args.rates, args.rate_spread, args.wind, args.faster_kt, args.warmer_k, args.seed)
    try:
        plans = read_plans(args)
        bluesky = start()
        with tqdm(desc="simulated seconds", delay=2, leave=False, bar_format="{desc} {n:.0f} [{elapsed}]") as bar:
            parts = []
            for number in range(args.times):
                flown = fly(
                    bluesky, plans, replace(orders, seed=args.seed + number), lambda now: bar.update(now - bar.n)
                )
                parts += [
                    reports(plan, state, number + 1, args.noise) for plan, state in zip(plans, flown, strict=True)
                ]
                bar.reset()
        write_table(table(parts), args.out)
    except DescentflowError as error:
        raise SystemExit(f"error: {error}") from error
    print(f"{len(parts)} descents; wrote {args.out}")


def add_plan_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare which descents are to be flown."""
    parser.add_argument("--like", type=Path, nargs="+", required=True, help="prepared descents of real flights")
    parser.add_argument("--rows", type=Path, nargs="+", help="their rows: report as often as they did (default: 4 s)")
    parser.add_argument("--typecode", help="fly these types alone, for instance A320,B738")
    parser.add_argument("--bottom-fl", type=float, default=100.0, help="lowest level (default: %(default)s)")
    parser.add_argument("--times", type=int, default=3, help="fly each so often (default: %(default)s)")
    parser.add_argument("--noise", type=float, default=0.0, help="noise of the reports, in the simulated world's")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path, required=True, help="rows, a .parquet file")


def read_plans(args: argparse.Namespace) -> list[FlightPlan]:
    """Plans of the descents that were asked for."""
    frame = FlightSource(args.like if len(args.like) > 1 else args.like[0]).descents().frame
    if args.typecode:
        frame = frame.filter(pl.col("typecode").is_in(args.typecode.split(",")))
    rows = read_rows(args.rows, DropReport()) if args.rows else None
    return flight_plans(frame, rows, args.bottom_fl)


if __name__ == "__main__":
    main()
