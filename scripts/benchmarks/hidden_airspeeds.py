"""Real airspeeds hidden and derived again: by neighbours of three receivers, by ERA5 of one A319, and models of them.

python scripts/derived_airspeeds.py --real FOLDER --out hidden.md
"""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import polars as pl

import descentflow as df
from benchmarks.fidelity import of_profiles, on_edges, sampled
from benchmarks.real_fidelity import DRAWS, FAMILIES, FEWEST_BINS, FOLDS, by_aircraft, longest, pooled, scored
from descentflow.core.constants import KAPPA, R_AIR
from descentflow.core.units import FPM_MPS, KT_MPS
from descentflow.representation.profiles import profiles_from_frame
from descentflow.surveillance.cleaning.ground_vector import STEEPEST_DEG
from descentflow.surveillance.descents.prepared_descents import Descents
from descentflow.surveillance.rows.air_data import cas_of_mach_kt
from descentflow.training.datamodule import DescentDataModule
from descentflow.training.fit import fit

LOWEST_FL, FEWEST_DRAWS = 100, 50
REPORTED, DERIVED = "reported airspeeds", "derived ones"


def by_neighbours(name: str, descents: Descents) -> list[str]:
    """Rows of a table: derived less reported CAS, and less the CAS of the reported Mach number, by 5,000 ft.

    Args:
        name: Of the receiver.
        descents: Of aircraft that report TAS, Mach and IAS: each got the air of the others.
    """
    levels = descents.frame.drop_nulls(["derived_IAS", "IAS", "Mach"])
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
    levels = table.with_columns(off=pl.Series(off), band=(pl.col("altitude") // 5000 * 50).cast(int)).filter(straight)
    descent = levels.filter(falls, pl.col("altitude") >= 10_000)
    cruise = levels.filter(pl.col("vertical_rate").abs() < 300, pl.col("altitude") > 30_000)
    named = [("cruise", cruise), ("descent", descent), *((f"FL{part['band'][0]}", part) for part in bands(descent))]
    values = ((name, part["off"].to_numpy()) for name, part in named)
    return [f"| {name} | {len(part)} | {part.mean():+.1f} +- {part.std():.1f} |" for name, part in values]


def bands(levels: pl.DataFrame) -> list[pl.DataFrame]:
    """Levels by band, the lowest first."""
    return levels.sort("band").partition_by("band", maintain_order=True)


def by_models(places: Mapping[str, Descents]) -> list[str]:
    """Rows of a table: Gaussians of reported and of derived airspeeds, on aircraft held out and their reported ones.

    CRPS of the time over a flight's longest stretch, in percent of it, and of the mean CAS over it, kt.

    Args:
        places: Descents of which levels have both airspeeds.
    """
    lines = []
    for code, types in FAMILIES.items():
        fleet = pooled(places, code, types)
        both = fleet.frame.drop_nulls("derived_IAS").drop("TAS", strict=False)
        hidden = both.with_columns(IAS="derived_IAS", airspeed_source=pl.lit("neighbours"))
        tails = np.random.default_rng(0).permutation(both["icao24"].unique().sort().to_numpy())
        scores: dict[str, list[list[float]]] = {REPORTED: [], DERIVED: []}
        owners: list[str] = []
        for fold in range(FOLDS):
            out = pl.col("icao24").is_in(tails[fold::FOLDS].tolist())
            judged = profiles_from_frame(both.filter(out), df.aircraft(code), fleet.bottom_fl)
            flights = of_profiles(judged)
            drawn = {}
            for name, frame in ((REPORTED, both), (DERIVED, hidden)):
                data = DescentDataModule(
                    Descents(frame.filter(~out), fleet.metadata), test_fraction=0.0, validation_fraction=0.0
                )
                density = fit(data, "gaussian", final=False).density.eval()
                drawn[name] = on_edges(sampled(density, DRAWS, 0)[0], flights.edges_fl)
            for row, flight in enumerate(judged.flight_ids):
                bins = longest(np.isfinite(flights.log_s[row]))
                times = {name: np.exp(samples.log_s[:, bins]).sum(1) for name, samples in drawn.items()}
                if len(bins) < FEWEST_BINS or any(np.isfinite(some).sum() < FEWEST_DRAWS for some in times.values()):
                    continue
                owners.append(both.filter(flight_id=flight)["icao24"][0])
                seconds, cas_kt = np.exp(flights.log_s[row, bins]).sum(), flights.cas_kt[row, bins].mean()
                for name, some in times.items():
                    high = np.isfinite(some)
                    of_cas = scored(drawn[name].cas_kt[high][:, bins].mean(1), cas_kt)[0] * cas_kt / 100
                    scores[name].append([*scored(some[high], seconds), of_cas])
        (true, made) = (np.array(rows) for rows in scores.values())
        for name, rows in ((REPORTED, true), (DERIVED, made)):
            crps, log, held, cas = rows.mean(0)
            cells = f"{crps:.1f} | {log:.2f} | {100 * held:.0f} % | {cas:.1f} kt"
            lines.append(f"| {code} family, {len(owners)} of {len(set(owners))} aircraft | {name} | {cells} |")
        apart = [by_aircraft((made - true)[:, i], owners) for i in (0, 1, 3)]
        lines.append(f"| | difference | {apart[0]} | {apart[1]} | | {apart[2]} |")
    return lines


def real_rows(folder: Path) -> list[str]:
    """The tables of three receivers, and of one aircraft with ERA5."""
    files = {
        "Netherlands": ("ehs_netherlands_2017-01-11.parquet", None),
        "Bengaluru": ("dump1090fa_bengaluru_2023.jsonl.gz", folder / "bengaluru_typecodes.csv"),
        "Japan": ("japan_2022_2023.parquet", None),
    }
    places = {
        name: df.prepare(folder / file, types=types, bottom_fl=LOWEST_FL, airspeeds_from="neighbours")
        for name, (file, types) in files.items()
    }
    return [
        "| A319 | rows | CAS by ERA5 less its IAS, kt |",
        "|---|---|---|",
        *by_era5(folder / "nodefdm_a319.parquet"),
        "",
        "| rows | from | flights | derived less reported IAS, kt | less the CAS of Mach, kt |",
        "|---|---|---|---|---|",
        *(line for name, descents in places.items() for line in by_neighbours(name, descents)),
        "",
        "| flights judged | fit to | CRPS, % | log score | 90 % hold | CRPS of CAS |",
        "|---|---|---|---|---|---|",
        *by_models(places),
    ]
