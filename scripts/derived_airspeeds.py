"""Fit flights whose airspeeds are derived with a field that errs, next to the same flights' reported airspeeds.

A simulated fleet reports its airspeeds, or is plain ADS-B (``descentflow simulate --without-airspeeds``): each day has
a wind, and the field that comes with the rows errs. Models are fitted to the reported airspeeds, to the derived ones as
they are, and with the spread of the error taken off; all are scored by the reported airspeeds of flights that were held
out::

    python scripts/derived_airspeeds.py --out derived_airspeeds.md

``docs/records/derived_airspeeds.md`` is what it writes.
"""

import argparse
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import polars as pl
import torch

import descentflow as df
from descentflow.core.constants import KAPPA, R_AIR
from descentflow.core.units import FPM_MPS, KT_MPS
from descentflow.generation.samples import Samples
from descentflow.simulation.world import field_file
from descentflow.surveillance.cleaning.ground_vector import STEEPEST_DEG
from descentflow.surveillance.descents.prepared_descents import Descents
from descentflow.surveillance.rows.air_data import cas_of_mach_kt

LEVELS_FL = (160, 200, 240, 280, 320, 350)
DRAWN = 4000


def summary(samples: Samples) -> dict[str, float]:
    """Mean and deviation of the time, and at some levels the deviation of CAS and its correlation with drag.

    Args:
        samples: Of a model.
    """
    flown = samples.trajectories
    numbers = {"time": float(flown.time_s[:, 0].mean()), "sd of time": float(flown.time_s[:, 0].std())}
    for level in LEVELS_FL:
        at = int((flown.levels_fl - level).abs().argmin())
        seen = flown.mask[:, at]
        cas, drag = flown.cas_mps[seen, at] / KT_MPS, flown.drag_n[seen, at]
        numbers |= {f"sd of CAS, FL{level}": float(cas.std()), f"correlation, FL{level}": _correlation(cas, drag)}
    return numbers


def judged(descents: Descents, real: Descents, seed: int, **options: Any) -> dict[str, float]:
    """Summary and scores of the one Gaussian fitted to descents.

    Args:
        descents: To fit.
        real: Reported airspeeds of the same flights, of which those that the fit held out are scored.
        seed: Of samples.
        options: Of the fit.
    """
    model = df.fit(descents, model="gaussian", **options)
    scores = df.evaluate(model, real, n=DRAWN, seed=seed).scores
    named = {"CAS": ("cas_profile", "energy"), "joint": ("descent", "joint_energy"), "AUC": ("descent", "auc")}
    scored = {name: scores.get(*place).score for name, place in named.items()}
    return {**summary(df.sample(model, DRAWN, seed=seed)), **scored}


def _correlation(first: torch.Tensor, other: torch.Tensor) -> float:
    return float(torch.corrcoef(torch.stack([first.double(), other.double()]))[0, 1])


def row_of(name: str, numbers: dict[str, float], true: dict[str, float]) -> str:
    """A row of the record: times, spread and correlation next to those of reported airspeeds, and scores."""
    spread = np.array([numbers[key] / true[key] - 1 for key in true if key.startswith("sd of CAS")])
    apart = np.array([numbers[key] - true[key] for key in true if key.startswith("correlation")])
    return (
        f"| {name} | {numbers['time']:.1f} +- {numbers['sd of time']:.1f} | {100 * spread.mean():+.1f} "
        f"({100 * spread.min():+.1f} to {100 * spread.max():+.1f}) | {apart.mean():+.3f} ({apart.min():+.3f} to "
        f"{apart.max():+.3f}) | {numbers['CAS']:.2f} | {numbers['joint']:.3f} | {numbers['AUC']:.2f} |"
    )


def by_neighbours(name: str, rows: Path, bottom_fl: int, types: Path | None = None) -> list[str]:
    """Rows of a table: derived less reported CAS, and less the CAS of the reported Mach number, by 5,000 ft.

    Args:
        name: Of the receiver.
        rows: Of aircraft that report TAS, Mach and IAS: each gets the air of the others.
        bottom_fl: Lowest level.
        types: Of the aircraft.
    """
    levels = df.prepare(rows, types=types, bottom_fl=bottom_fl, airspeeds_from="neighbours").frame
    levels = levels.drop_nulls(["derived_IAS", "IAS", "Mach"])
    of_mach = cas_of_mach_kt(levels["Mach"].to_numpy(), 100.0 * levels["level_fl"].to_numpy())
    levels = levels.with_columns(of_mach=pl.Series(of_mach), band=pl.col("level_fl") // 50 * 50)
    lines = []
    for band, some in [("all", levels), *((f"FL{part['band'][0]}", part) for part in bands(levels))]:
        derived = some["derived_IAS"].to_numpy()
        off, from_mach = (derived - some[column].to_numpy() for column in ("IAS", "of_mach"))
        lines.append(
            f"| {name} | {band} | {some['flight_id'].n_unique()} | {off.mean():+.1f} +- {off.std():.1f} | "
            f"{from_mach.mean():+.1f} +- {from_mach.std():.1f} |"
        )
    return lines


def by_era5(rows: Path) -> list[str]:
    """Rows of a table: CAS by ERA5's wind and temperature, which the rows carry, less the IAS of Mode S, by 5,000 ft.

    Args:
        rows: Of one A319, whose IAS is repeated: rows with the one before are left out. Its TAS and Mach number are
            ERA5's, too, and are not used.
    """
    table = pl.read_parquet(rows).sort("timestamp").filter(pl.col("IAS") != pl.col("IAS").shift())
    east, north = (table[f"{name}_component_of_wind"].to_numpy() for name in "uv")
    track, speed = np.radians(table["track"].to_numpy()), table["groundspeed"].to_numpy() * KT_MPS
    level = np.hypot(speed * np.sin(track) - east, speed * np.cos(track) - north)
    sound = np.sqrt(KAPPA * R_AIR * table["temperature"].to_numpy())
    mach = np.hypot(level, table["vertical_rate"].to_numpy() * FPM_MPS) / sound
    off = cas_of_mach_kt(mach, table["altitude"].to_numpy()) - table["IAS"].to_numpy()
    falls, straight = pl.col("vertical_rate") < -300, pl.col("roll").abs() < STEEPEST_DEG
    rows_off = table.with_columns(off=pl.Series(off), band=(pl.col("altitude") // 5000 * 50).cast(int)).filter(straight)
    descent = rows_off.filter(falls, pl.col("altitude") >= 10_000)
    cruise = rows_off.filter(pl.col("vertical_rate").abs() < 300, pl.col("altitude") > 30_000)
    named = [("cruise", cruise), ("descent", descent), *((f"FL{part['band'][0]}", part) for part in bands(descent))]
    return [
        f"| {name} | {len(part)} | {np.mean(part['off']):+.1f} +- {np.std(part['off']):.1f} |" for name, part in named
    ]


def bands(table: pl.DataFrame) -> list[pl.DataFrame]:
    """Levels by band, the lowest first."""
    return table.sort("band").partition_by("band", maintain_order=True)


def real_rows(folder: Path) -> list[str]:
    """The tables of three receivers, and of one aircraft with ERA5."""
    japan, netherlands = folder / "japan_2022_2023.parquet", folder / "ehs_netherlands_2017-01-11.parquet"
    bengaluru, types = folder / "dump1090fa_bengaluru_2023.jsonl.gz", folder / "bengaluru_typecodes.csv"
    return [
        "| rows | from | flights | derived less reported IAS, kt | less the CAS of Mach, kt |",
        "|---|---|---|---|---|",
        *by_neighbours("Netherlands", netherlands, 100),
        *by_neighbours("Bengaluru", bengaluru, 100, types),
        *by_neighbours("Japan", japan, 150),
        "",
        "| A319 | rows | CAS by ERA5 less its IAS, kt |",
        "|---|---|---|",
        *by_era5(folder / "nodefdm_a319.parquet"),
    ]


def main() -> None:
    """Fly, derive, fit and write the record."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, required=True, help="the record, Markdown")
    parser.add_argument("--flights", type=int, nargs="+", default=[300, 1000], help="of each fleet (default: 300 1000)")
    parser.add_argument("--winds", type=float, nargs="+", default=[2.5, 4.5], help="errors, m/s (default: 2.5 4.5)")
    parser.add_argument("--seed", type=int, default=0, help="of flights, errors and samples (default: 0)")
    parser.add_argument("--real", type=Path, help="folder of real rows: only their tables are printed")
    asked = parser.parse_args()
    if asked.real:
        table = "\n".join(real_rows(asked.real)) + "\n"
        asked.out.write_text(table, encoding="utf-8")
        print(table)
        return
    lines = [
        "| airspeeds | time, s | spread of CAS, % | correlation of CAS and drag | energy of CAS, kt | of all | AUC |",
        "|---|---|---|---|---|---|---|",
    ]
    with TemporaryDirectory() as folder:
        most = max(asked.flights)
        reported = df.simulate("A320", most, seed=asked.seed).rows
        fields = {}
        for wind in asked.winds:
            out = Path(folder) / f"{wind:g}.parquet"
            df.simulate("A320", most, seed=asked.seed, without_airspeeds=True, wind_error_mps=wind, out=out)
            fields[wind] = out
        names = reported["flight_id"].unique().sort()
        for flights in asked.flights:
            some = pl.col("flight_id").is_in(names[:flights].implode())
            real = df.prepare(reported.filter(some))
            true = judged(real, real, asked.seed)
            lines.append(row_of(f"{flights:,} flights, reported", true, true))
            for wind, out in fields.items():
                derived = df.prepare(pl.read_parquet(out).filter(some), airspeeds_from=field_file(out))
                for words, size in (("as they are", 0.0), ("error taken off", wind)):
                    kelvins = 1.0 if size else 0.0
                    judgement = judged(derived, real, asked.seed, wind_error_mps=size, temperature_error_k=kelvins)
                    lines.append(row_of(f"{flights:,} flights, {wind:g} m/s, {words}", judgement, true))
                print("\n".join(lines), flush=True)
    asked.out.write_text(RECORD + "\n".join(lines) + "\n", encoding="utf-8")


RECORD = """# Airspeeds from groundspeed and a field that errs

`python scripts/derived_airspeeds.py --out derived_airspeeds.md` makes this table. The same simulated A320 report their
airspeeds, or are plain ADS-B (`descentflow simulate --without-airspeeds`): they fly in a wind of each day, and get
airspeeds from the field that comes with them, whose wind errs as said and whose temperature errs by 1 K. A quarter of
the variance of both is common to hours and the region, seven tenths are alike over 8,000 ft of a flight, the rest is
white. Samples of one Gaussian, 4,000 of each fit. Spread and correlation stand next to those of reported airspeeds: the
mean of six levels from FL160 to FL350, and the extremes. Scores are by the reported airspeeds of the flights held out.

"""

if __name__ == "__main__":
    main()
