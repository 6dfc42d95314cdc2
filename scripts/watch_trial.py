"""Trial of `descentflow watch` on streams whose change is known, with other detectors of changes on the same streams.

Days are drawn from flights of the simulated world: weather by day, airlines by weekday, 40 flights a day, 60 days. The
change begins after day 40. Seeds, sizes and streams are fixed before anything is judged.

    pip install 'river==0.26.1' 'ruptures==1.1.10'
    python scripts/watch_trial.py FOLDER --streams 200 --causes 24
"""

import argparse
import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import torch

import descentflow as df
from benchmarks.change_rivals import RIVALS
from descentflow.aircraft_types.registry import aircraft
from descentflow.core.threads import one_thread
from descentflow.diagnosis.sides.measured_sides import both_sides
from descentflow.diagnosis.sides.simulator import Simulator
from descentflow.diagnosis.sides.two_sides import compare
from descentflow.measurements.quantity_registry import CHANNELS
from descentflow.simulation.plantable import Values
from descentflow.simulation.world_config import WorldConfig
from descentflow.surveillance.descents.prepared_descents import Descents, read_descents, write_descents
from descentflow.watching.change_evidence import evidence
from descentflow.watching.day_record import differences, means_of, record_of

DAYS, CHANGED_FROM, REFERENCE, FALSE_ALARMS = 60, 40, 30, 0.05
FLIGHTS = 40
WEATHER = WorldConfig(shear_spread_per_s=0.004, layer_spread_k=1.0, jet_mps=(5.0, 35.0), daily_spread_k=3.0)
POOL_FLIGHTS = 50
"""Flights of a day in the pool, of which a weekday's are drawn by its airlines."""
AIRLINES = {"SLO": (1, 1, 1, 1, 1, 3, 4), "MID": (2, 2, 2, 2, 2, 2, 1), "FST": (4, 4, 3, 3, 4, 1, 1)}
"""Weights by weekday: leisure airlines, which descend more slowly, fly at weekends."""
POOLS: dict[str, tuple[int, int, dict[str, Values]]] = {
    "before": (811, 120, {}),
    "drag 5 %": (812, 20, {"drag_polar": {"factor": 1.07}}),
    "drag 10 %": (813, 20, {"drag_polar": {"factor": 1.14}}),
    "mass 5 %": (814, 20, {"mass": {"factor": 0.9}}),
    "mass 10 %": (815, 20, {"mass": {"factor": 0.81}}),
    "front": (816, 20, {"temperature": {"deviation_k": 8.0}, "wind_gradient": {"slope_kt_per_kft": 1.5}}),
}
"""Days before and after a change: seed, days, and what is planted; the sizes are those of the rate."""
AFTER_DAYS = 8
"""Days after a change that are measured, and come in turn."""
KINDS = ("none", "none", "drag 5 %", "mass 5 %", "drag 10 %", "mass 10 %", "drift", "front", "front", "none")
"""Kinds of streams, in turn."""
DRIFT, DRIFT_DAYS = 0.1, 14
ALIKE = {"drag_polar", "mass"}
"""Causes that count as right: CD0 and mass change the rate alike where the speeds are the same."""
Day = dict[str, Any]


def pool(folder: Path, name: str) -> Descents:
    """Prepared flights of a pool, flown once."""
    seed, days, plant = POOLS[name]
    path = folder / f"{name.replace(' %', '').replace(' ', '-')}.parquet"
    if not path.exists():
        world = df.simulate("A320", POOL_FLIGHTS * days, seed, replace(WEATHER, days=days), plant=plant)
        write_descents(df.prepare(world), path)
    return read_descents(path)


def pool_days(folder: Path, name: str, simulator: Simulator) -> list[list[Day]]:
    """Days of a pool, each as every weekday has it: record, flights' values, flights' names."""
    frame = pool(folder, name).frame
    with torch.inference_mode():
        sides = both_sides(simulator, frame, CHANNELS)
        airline = dict(frame.select("flight_id", pl.col("callsign").str.head(3)).unique().iter_rows())
        days = []
        numbers, flown = np.unique(sides.real.known_day.numpy(), return_counts=True)
        numbers = numbers[flown >= FLIGHTS]
        for number in numbers if name == "before" else numbers[:AFTER_DAYS]:
            own = np.flatnonzero(sides.real.known_day.numpy() == number)
            versions = []
            for weekday in range(7):
                weight = np.array([AIRLINES[airline[sides.real.names[i]]][weekday] for i in own], dtype=float)
                rng = np.random.default_rng([POOLS[name][0], number, weekday])
                chosen = rng.choice(own, FLIGHTS, replace=False, p=weight / weight.sum())
                real = sides.real.rows(torch.tensor(chosen))
                compared = compare(sides.simulated, real, simulator.aircraft)
                versions.append(
                    {"record": record_of(compared), "rates": differences(compared, "rate"), "names": real.names}
                )
            days.append(versions)
    return days


def streams(pools: dict[str, list[list[Day]]], count: int) -> Iterator[tuple[str, list[Day]]]:
    """Kind and days of each stream."""
    for number in range(count):
        kind, rng = KINDS[number % len(KINDS)], np.random.default_rng(7000 + number)
        before = rng.permutation(len(pools["before"]))[:DAYS]
        after = rng.permutation(len(pools.get(kind, [])))
        days = []
        for i in range(DAYS):
            weekday, changed = (i + number) % 7, i >= CHANGED_FROM
            is_flown = changed and kind in pools
            day = (pools[kind][after[(i - CHANGED_FROM) % len(after)]] if is_flown else pools["before"][before[i]])[
                weekday
            ]
            if changed and kind == "drift":
                moved = float(np.log1p(DRIFT * (i - CHANGED_FROM + 1) / DRIFT_DAYS))
                record = {**day["record"], "rate: mean": day["record"]["rate: mean"] + moved}
                day = {**day, "record": record, "rates": day["rates"] + moved}
            days.append(day)
        yield kind, days


def judged(kind: str, days: list[Day]) -> dict[str, Any]:
    """Alarm and date of the watch and of each rival, by position of the day; None where there is none."""
    means = means_of(pl.DataFrame([day["record"] for day in days], infer_schema_length=None))
    found = evidence(means, REFERENCE)
    alarm = found.first_alarm(FALSE_ALARMS)
    line = {
        "kind": kind,
        "alarm": alarm,
        "date": None if alarm is None else found.dates(alarm)[0],
        "date at the end": found.dates(DAYS - 1)[0],
    }
    flights = [day["rates"] for day in days]
    return line | {
        f"{name}: {what}": x for name, rival in RIVALS.items() for what, x in rival(flights, REFERENCE).items()
    }


def cause(frames: dict[str, pl.DataFrame], kind: str, days: list[Day], line: dict[str, Any]) -> list[str]:
    """Causes that the diagnosis of the days after the date against those before names, as `watch` asks for them."""
    sides = []
    for first, last in ((line["date"], line["alarm"] + 1), (max(line["date"] - 30, 0), line["date"])):
        parts = []
        for i in range(first, last):
            source = frames[kind if i >= CHANGED_FROM and kind in POOLS else "before"]
            names = list(days[i]["names"])
            parts.append(source.filter(pl.col("flight_id").is_in(names)))
        sides.append(pl.concat(parts, how="diagonal"))
    report = df.diagnose(sides[0], sides[1], typecode="A320")
    return [one.effect for one in report.causes]


def main() -> None:
    """Judge the streams once, then causes of some, and print how often each was right."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--streams", type=int, default=200)
    parser.add_argument("--causes", type=int, default=0, help="alarms of steps and fronts whose causes are sought")
    options = parser.parse_args()
    options.folder.mkdir(parents=True, exist_ok=True)
    with one_thread():
        flown = df.prepare(df.simulate("A320", 300, 810))
        simulator = Simulator(aircraft("A320"), flights=flown)
        pools = {name: pool_days(options.folder, name, simulator) for name in POOLS}
        drawn = list(streams(pools, options.streams))
        lines = [judged(*one) for one in drawn]
        sought = [i for i, line in enumerate(lines) if line["kind"] in POOLS and line["alarm"] is not None]
        frames = {name: pool(options.folder, name).frame for name in POOLS}
        write(options.folder, lines)
        for i in sought[: options.causes]:
            lines[i]["causes"] = cause(frames, *drawn[i], lines[i])
            write(options.folder, lines)
    report(pl.DataFrame(lines, infer_schema_length=None))


def write(folder: Path, lines: list[dict[str, Any]]) -> None:
    """Write the judgements so far."""
    (folder / "trial.json").write_text(json.dumps(lines, indent=1))


def report(table: pl.DataFrame) -> None:
    """Print alarms, flights until them, and dates, by kind of stream and detector."""
    for name in ("", *(f"{name}: " for name in RIVALS)):
        alarm, date = pl.col(f"{name}alarm"), pl.col(f"{name}date")
        late = (alarm - CHANGED_FROM + 1) * FLIGHTS
        shown = table.group_by("kind", maintain_order=True).agg(
            pl.len().alias("streams"),
            (alarm < CHANGED_FROM).sum().alias("alarms before the change"),
            (alarm >= CHANGED_FROM).sum().alias("after it"),
            late.filter(alarm >= CHANGED_FROM).median().alias("flights until then"),
            ((date - CHANGED_FROM).abs() <= 2).filter(alarm >= CHANGED_FROM).mean().alias("date within two days"),
        )
        print(name or "watch")
        with pl.Config(tbl_cols=-1, tbl_width_chars=160, tbl_hide_dataframe_shape=True):
            print(shown)
    if "causes" in table.columns:
        right = pl.Series([bool(names) and set(names) <= ALIKE for names in table["causes"].drop_nulls().to_list()])
        print(f"causes of {len(right)} alarms: {int(right.sum())} right")
        print(table.drop_nulls("causes").select("kind", "date", "causes"))


if __name__ == "__main__":
    main()
