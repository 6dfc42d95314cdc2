"""Level flight in descents by EUROCONTROL's definition beside the phases of the library traffic.

    python scripts/level_flight_by_traffic.py --traffic .venv-traffic/bin/python [rows.parquet]

The library has an environment of its own (`pip install traffic`). Rows are those of a simulated world unless a file is
given. Both look at the same reports, from the top of descent that descentflow finds.
"""

import argparse
import subprocess
import tempfile
from pathlib import Path

import polars as pl

import descentflow as df
from descentflow.surveillance.cleaning.level_flight import LEVEL_FPM, stretches
from descentflow.surveillance.cleaning.rates import with_rate

PHASES = """
import sys
import pandas as pd
from traffic.core import Flight
rows, found = pd.read_parquet(sys.argv[1]), []
for _, one in rows.groupby("flight_id"):
    found.append(Flight(one).phases().data[["flight_id", "timestamp", "phase"]])
pd.concat(found).to_parquet(sys.argv[2])
"""
COLUMNS = (
    "flight_id",
    "timestamp",
    "altitude",
    "vertical_rate",
    "groundspeed",
    "TAS",
    "latitude",
    "longitude",
    "track",
)
FLIGHTS, SEED = 200, 3


def main() -> None:
    """Print seconds level by both, and what the rest is."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("rows", type=Path, nargs="?")
    parser.add_argument("--traffic", type=Path, required=True, help="Python with traffic")
    args = parser.parse_args()
    given = (
        pl.read_parquet(args.rows)
        if args.rows
        else df.simulate("A320", FLIGHTS, seed=SEED, scenario="london-fir-2019").rows
    )
    rows = with_rate(given.select(name for name in COLUMNS if name in given.columns).sort("flight_id", "timestamp"))
    found = stretches(rows)
    begins = found.filter(kind="descent").select("flight_id", begin="timestamp")
    descent = rows.join(begins, on="flight_id").filter(
        (pl.col("timestamp") >= pl.col("begin")) & (pl.col("altitude") >= 1800)
    )
    seconds = (pl.col("timestamp").diff().over("flight_id").dt.total_microseconds() / 1e6).fill_null(0.0)
    both = descent.join(phases(rows, args.traffic), on=["flight_id", "timestamp"], how="left").with_columns(
        seconds=seconds, ours=_inside(descent, found), level=pl.col("phase") == "LEVEL"
    )
    total = float(both["seconds"].sum())
    print(f"{begins.height} descents, {total / 3600:.1f} h; level: {_s(both, 'ours')} s by the definition,")
    print(f"{_s(both, 'level')} s by traffic, {_s(both.filter('ours'), 'level')} s by both")
    apart = both.filter(pl.col("ours") != pl.col("level").fill_null(False))
    slow = pl.col("vertical_rate").abs() <= LEVEL_FPM
    named = (
        pl.when(pl.col("ours"))
        .then(pl.format("the definition alone, where traffic has {}", pl.col("phase").fill_null("nothing")))
        .when(slow)
        .then(pl.lit("traffic alone, within 300 ft/min but for less than 20 s"))
        .otherwise(pl.lit("traffic alone, at more than 300 ft/min"))
    )
    for name, some in apart.group_by(named.alias("why")).agg(pl.col("seconds").sum()).sort("seconds").iter_rows():
        print(f"  {some:>7.0f} s {name}")


def _s(rows: pl.DataFrame, flag: str) -> int:
    return round(rows.filter(flag)["seconds"].sum())


def _inside(descent: pl.DataFrame, found: pl.DataFrame) -> pl.Series:
    """True for each row in a level segment."""
    level = found.filter(kind="level").select(
        "flight_id", first="timestamp", last=pl.col("timestamp") + pl.duration(microseconds=pl.col("seconds") * 1e6)
    )
    at = descent.select("flight_id", "timestamp").with_row_index("row")
    inside = at.join(level, on="flight_id").filter(pl.col("timestamp").is_between("first", "last"))["row"].unique()
    return at["row"].is_in(inside.implode())


def phases(rows: pl.DataFrame, python: Path) -> pl.DataFrame:
    """Phase of each row by traffic."""
    with tempfile.TemporaryDirectory() as folder:
        given, made = Path(folder, "rows.parquet"), Path(folder, "phases.parquet")
        rows.with_columns(
            pl.col("timestamp").dt.cast_time_unit("ns"), icao24=pl.lit("abcdef"), callsign=pl.col("flight_id")
        ).write_parquet(given)
        subprocess.run([python, "-c", PHASES, given, made], check=True)
        return pl.read_parquet(made).with_columns(
            pl.col("timestamp").dt.convert_time_zone("UTC").dt.cast_time_unit("us"), pl.col("flight_id").cast(pl.String)
        )


if __name__ == "__main__":
    main()
