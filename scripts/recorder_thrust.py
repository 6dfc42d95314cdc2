"""Thrust above idle in what `prepare` keeps and drops, by flight recorders that have N1.

    python scripts/recorder_thrust.py rj85_recorder_2001.parquet b763_recorder.parquet

A file has rows of one aircraft with N1 (`N1`, `n1` or `N1_1`), and perhaps the fuel flow of each engine in lb/h (`FF_1`
and on). A row is at idle within five points of the lowest decile of its 4,000 ft band. A filter that should drop what
is above idle has a precision (of what it drops, how much is) and a recall (of what is, how much it drops). The fuel is
that of the flow over the levels kept, next to the law at the rates flown.
"""

import argparse
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import torch

import descentflow as df
from descentflow.cli.prepare_command import IDLE_WITHIN
from descentflow.core.errors import DataError
from descentflow.core.units import FL_M, FPM_MPS, FT_M, KT_MPS
from descentflow.physics.fuel import burn
from descentflow.surveillance.cleaning.idle import ABOVE_IDLE, BAND_FT, with_power
from descentflow.surveillance.cleaning.thresholds import Cleaning

POUND_KG = 0.45359237
N1_NAMES = ("N1", "n1", "N1_1")
BOTTOM_FL = 60
STANDS_FOR = {"RJ85": "E190"}
"""Type -> one with open coefficients, of about its mass."""
VARIED: Mapping[str, tuple[float, ...]] = {
    "constant_rate_gradient": (0.03, 0.04, 0.05, 0.06),
    "constant_rate_drift_fpm": (80.0, 160.0, 320.0),
    "constant_rate_scatter_fpm": (64.0, 128.0, 256.0),
    "constant_rate_offset_fpm": (25.0, 50.0),
    "constant_rate_jump_fpm": (100.0, 150.0, 250.0),
    "constant_rate_s": (30.0, 50.0, 80.0),
    "constant_rate_alone_s": (60.0, 120.0, 180.0),
}
"""Thresholds of held rates, each with values about the default."""


def main() -> None:
    """Print the tables of each recorder."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recorders", type=Path, nargs="+")
    parser.add_argument("--bottom-fl", type=int, default=BOTTOM_FL)
    parser.add_argument("--vary", action="store_true", help="halve and double the thresholds of held rates, too")
    args = parser.parse_args()
    for path in args.recorders:
        rows = recorder_rows(path)
        print(f"\n{path.stem}")
        for line in report(rows, args.bottom_fl, vary=args.vary):
            print(line, flush=True)


def recorder_rows(path: Path) -> pl.DataFrame:
    """Rows in the names of descentflow, with the fuel flow of all engines in kg/s where the file has it."""
    rows = pl.read_parquet(path)
    n1 = next((name for name in N1_NAMES if name in rows.columns), None)
    if n1 is None:
        raise DataError(f"{path} has no N1", expected=f"a column {', '.join(N1_NAMES)}", mend="name it so")
    flows = [name for name in rows.columns if name.startswith("FF_")]
    fuel = {"fuel_flow": pl.sum_horizontal(flows) * POUND_KG / 3600} if flows else {}
    known = ("timestamp", "icao24", "flight_id", "typecode", "altitude", "vertical_rate", "IAS", "Mach", "TAS")
    others = {name: pl.col(name) for name in (*known, "temperature") if name in rows.columns}
    return rows.select(**others, N1=pl.col(n1), **fuel)


def report(rows: pl.DataFrame, bottom_fl: int, *, vary: bool) -> Iterator[str]:
    """Lines of one recorder."""
    every = rows["flight_id"].n_unique()
    rules = Cleaning(bottom_fl=bottom_fl)
    descents = df.prepare(rows, cleaning=rules, shown=every)
    levels = descents.frame
    kept = above_of_levels(levels, rows, rules)
    known = kept.drop_nulls(ABOVE_IDLE)
    code = levels["typecode"][0]
    at_idle = known[ABOVE_IDLE].to_numpy() <= IDLE_WITHIN
    left = df.prepare(rows, cleaning=Cleaning(bottom_fl=bottom_fl, idle_only=IDLE_WITHIN)).frame
    flights = levels["flight_id"].n_unique()
    yield f"{code}: {flights} descents, {len(known)} levels kept, {at_idle.mean():.0%} of them at idle"
    yield f"  with --idle-only {left['flight_id'].n_unique()} descents, {len(left)} levels"
    level, above = known["level_fl"].to_numpy(), known[ABOVE_IDLE].to_numpy()
    for band in range(level.min() // 40 * 40, level.max() + 1, 40):
        some = above[(level >= band) & (level < band + 40)]
        if len(some):
            middle, most = np.quantile(some, [0.5, 0.9])
            yield (
                f"  FL{band} to {band + 39}: {len(some)} levels, {(some <= IDLE_WITHIN).mean():.0%} at idle, "
                f"N1 above it by {middle:.0f} points (median), {most:.0f} (nine of ten)"
            )
    yield from by_filter(descents.dropped_rows, rows, rules)
    if vary:
        yield from varied(rows, rules, every)
    if "fuel_flow" in levels.columns:
        yield from fuel_lines(kept, code)


def above_of_levels(levels: pl.DataFrame, rows: pl.DataFrame, rules: Cleaning) -> pl.DataFrame:
    """Levels with their points above idle, of the rows' own bands."""
    powered = with_power(rows.sort("flight_id", "timestamp"), rules.slowest_fpm).with_columns(
        band=pl.col("altitude") // BAND_FT, idle=pl.col("N1") - pl.col(ABOVE_IDLE)
    )
    bands = powered.group_by("band").agg(pl.col("idle").drop_nulls().first())
    at = levels.with_columns(band=100.0 * pl.col("level_fl") // BAND_FT).join(bands, on="band", how="left")
    return at.with_columns((pl.col("N1") - pl.col("idle")).alias(ABOVE_IDLE))


def rows_by_reason(dropped: Any, rows: pl.DataFrame, rules: Cleaning) -> dict[str, np.ndarray]:
    """By reason ("kept" for none) whether each row is above idle, of those that descend above the bottom."""
    powered = with_power(rows.sort("flight_id", "timestamp"), rules.slowest_fpm)
    joined = dropped.join(powered.select("timestamp", ABOVE_IDLE), on="timestamp").drop_nulls(ABOVE_IDLE)
    falls = (joined["vertical_rate"] <= -rules.slowest_fpm) & (joined["altitude"] >= 100 * rules.bottom_fl)
    some = joined.filter(falls)
    reason = np.array(some["reason"].fill_null("kept").to_list(), dtype=object)
    above = some[ABOVE_IDLE].to_numpy() > IDLE_WITHIN
    return {str(name): above[reason == name] for name in dict.fromkeys(reason.tolist())}


def by_filter(dropped: Any, rows: pl.DataFrame, rules: Cleaning) -> Iterator[str]:
    """Precision and recall of each filter."""
    parts = rows_by_reason(dropped, rows, rules)
    every = np.concatenate(list(parts.values()))
    yield f"  {len(every)} rows descend above FL{rules.bottom_fl}, {every.mean():.0%} above idle"
    for reason, part in sorted(parts.items(), key=lambda one: -len(one[1])):
        yield f"  {reason}: {len(part)}, {part.mean():.0%} above idle; {part.sum() / every.sum():.0%} of all above idle"


def varied(rows: pl.DataFrame, rules: Cleaning, every: int) -> Iterator[str]:
    """Precision and recall of the filter of held rates with each threshold changed."""
    for name, values in VARIED.items():
        for value in values:
            changed = replace(rules, **{name: value})  # type: ignore[arg-type]  # names of thresholds
            parts = rows_by_reason(df.prepare(rows, cleaning=changed, shown=every).dropped_rows, rows, changed)
            held, above = parts.get("constant_rate", np.zeros(0)), sum(part.sum() for part in parts.values())
            yield (
                f"  {name} {value:g}: {len(held)} rows, precision {held.sum() / max(len(held), 1):.0%}, "
                f"recall {held.sum() / above:.0%}"
            )


def fuel_lines(levels: pl.DataFrame, code: str) -> Iterator[str]:
    """Fuel of the flow and of the law over the levels kept, at idle and above it."""
    model = df.aircraft(STANDS_FOR.get(code, code))
    air = torch.zeros(len(levels), dtype=torch.float64)
    if "temperature" in levels.columns:
        standard = 288.15 - 0.0065 * FT_M * 100 * levels["level_fl"].to_numpy()
        air = torch.from_numpy(levels["temperature"].to_numpy() - standard)
    seconds, measured, law, lowest = (np.zeros(len(levels)) for _ in range(4))
    begin = 0
    for flight in levels.partition_by("flight_id", maintain_order=True):
        part = slice(begin, begin := begin + len(flight))
        time, altitude = flight["time_s"].to_numpy(), flight["level_fl"].to_numpy() * FL_M
        step = np.diff(time, append=time[-1])
        seconds[part] = np.where(np.diff(flight["level_fl"].to_numpy(), append=-99) == -1, step, 0.0)
        cas = flight["IAS"].to_numpy() * KT_MPS
        rate = flight["vertical_rate"].to_numpy() * FPM_MPS
        state = [
            torch.from_numpy(np.ascontiguousarray(row)) for row in (cas, altitude, rate, np.gradient(cas, altitude))
        ]
        fuel = burn(model, state[0], state[1], state[2], state[3], air[part])
        law[part] = fuel.flow_kg_s.numpy()
        lowest[part] = model.idle_fuel_flow_kg_s(state[1]).numpy()
        measured[part] = flight["fuel_flow"].to_numpy()
    at_idle = (levels[ABOVE_IDLE] <= IDLE_WITHIN).fill_null(False).to_numpy()
    for words, some in (("all levels", at_idle | True), ("at idle", at_idle), ("above idle", ~at_idle)):
        burnt = (measured * seconds)[some].sum()
        made = [(flow * seconds)[some].sum() for flow in (law, lowest)]
        yield (
            f"  fuel, {words}: {burnt:.0f} kg by flow; by the law of {model.typecode} "
            f"{made[0]:.0f} ({made[0] / burnt - 1:+.0%}), at idle throughout {made[1]:.0f} ({made[1] / burnt - 1:+.0%})"
        )


if __name__ == "__main__":
    main()
