"""Diagnose random halves, by aircraft, of real flights: as they are, and with a bias put into one half's rows.

python scripts/real_halves.py [ROWS.parquet ...] [--halves 50] [--biased 10]

The rows given and the embedded rows of Bengaluru are one pool: halves of each are fewer than the twenty flights that a
diagnosis asks for. A half as it is has no cause; a wrong airspeed, a late and a scaled vertical rate should be named.
Rows without a vertical rate have none to bias.
"""

import argparse
import sys
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import polars as pl

from descentflow.core.errors import DataError, DescentflowError
from descentflow.diagnosis.diagnose import diagnose
from descentflow.surveillance.descents.prepared_descents import Descents
from descentflow.surveillance.formats.aircraft_json import embedded_rows, embedded_types
from descentflow.surveillance.prepare import prepare
from descentflow.surveillance.read_rows import read_rows
from descentflow.surveillance.rows.drop_report import DropReport

NOMINAL, BOTTOM_FL = "A320", 60
"""The type whose coefficients give signatures of effects, for flights of all types, and the lowest level."""
BIAS_KT, LATE_S, FACTOR = 8.0, 10.0, 1.2
Bias = Callable[[pl.DataFrame], pl.DataFrame]


def late(rows: pl.DataFrame) -> pl.DataFrame:
    """Rows whose vertical rate is that of some seconds before, by a straight line in time; sorted by aircraft."""
    parts = []
    for part in rows.sort("icao24", "timestamp").partition_by("icao24", maintain_order=True):
        known = part.drop_nulls("vertical_rate")
        seconds = [(one["timestamp"].dt.epoch("us") / 1e6).to_numpy() for one in (part, known)]
        if len(known) > 1:
            rate = np.interp(seconds[0] - LATE_S, seconds[1], known["vertical_rate"].cast(pl.Float64).to_numpy())
            moved = pl.when(pl.col("vertical_rate").is_not_null()).then(pl.Series(rate))
            part = part.with_columns(moved.alias("vertical_rate"))
        parts.append(part)
    return pl.concat(parts, how="vertical_relaxed")


BIASES: dict[str, tuple[str, Bias]] = {
    "airspeed_bias": ("IAS", lambda rows: rows.with_columns(pl.col("IAS") + BIAS_KT)),
    "vertical_rate_lag": ("vertical_rate", late),
    "scaled rate": ("vertical_rate", lambda rows: rows.with_columns(pl.col("vertical_rate") * FACTOR)),
}
"""Name, the column that is changed, and the change of one half's rows."""


def halves(names: list[str], seed: int) -> tuple[list[str], list[str]]:
    """Aircraft dealt to two halves."""
    order = np.random.default_rng(seed).permutation(len(names))
    return [names[i] for i in order[: len(names) // 2]], [names[i] for i in order[len(names) // 2 :]]


def of_aircraft(descents: Descents, names: list[str]) -> Descents:
    """Descents of some aircraft."""
    return Descents(descents.frame.filter(pl.col("icao24").is_in(names)), descents.metadata)


def answer(real: Descents, simulator: Descents, seed: int) -> tuple[str, list[str]]:
    """Verdict and effects named; in place of the verdict why there was none."""
    try:
        report = diagnose(real, simulator, typecode=NOMINAL, seed=seed, any_type=True)
    except DataError as error:
        return f"refused: {error.got}", []
    return report.verdict, [cause.effect for cause in report.causes]


def pooled(places: Sequence[tuple[pl.DataFrame, pl.DataFrame | None]], kind: str) -> Descents:
    """Descents of all places, with a bias in the rows of those that have the column."""
    column, change = BIASES.get(kind, ("", None))
    found = [
        prepare(change(rows) if change and column in rows.columns else rows, types=types, bottom_fl=BOTTOM_FL)
        for rows, types in places
    ]
    return Descents(pl.concat([one.frame for one in found], how="diagonal_relaxed"), found[0].metadata)


def judge(places: Sequence[tuple[pl.DataFrame, pl.DataFrame | None]], args: argparse.Namespace) -> None:
    """Print what random halves come to."""
    plain = pooled(places, "")
    aircraft = plain.frame["icao24"].unique().sort().to_list()
    print(f"{plain.frame['flight_id'].n_unique()} flights of {len(aircraft)} aircraft", flush=True)
    for kind in ("as they are", *BIASES):
        found: Counter[str] = Counter()
        biased = pooled(places, kind) if kind in BIASES else plain
        for seed in range(args.biased if kind in BIASES else args.halves):
            one, other = halves(aircraft, args.seed + seed)
            verdict, causes = answer(of_aircraft(biased, one), of_aircraft(plain, other), seed)
            found[": ".join([verdict, ", ".join(sorted(causes))]).removesuffix(": ")] += 1
        print(f"  {kind}: " + "; ".join(f"{count} x {line}" for line, count in found.most_common()), flush=True)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("rows", type=Path, nargs="*", help="rows with a column of types")
    parser.add_argument("--halves", type=int, default=50, help="random halves as they are (default: %(default)s)")
    parser.add_argument("--biased", type=int, default=10, help="random halves of each bias (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=0)
    args = parser.parse_args()
    try:
        here = (read_rows([embedded_rows()], DropReport()), embedded_types())
        judge([here, *((read_rows([path], DropReport()), None) for path in args.rows)], args)
    except DescentflowError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
