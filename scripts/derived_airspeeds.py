"""Flights whose airspeeds are derived with a field that errs, next to the same flights' reported airspeeds.

Simulated fleets report their airspeeds, or are plain ADS-B (``descentflow simulate --without-airspeeds``): each day has
a wind, and the field that comes with the rows errs. Spreads and correlations of the flights, and models fitted to them,
are compared as derived, with the spread of the error taken off, and as reported::

    python scripts/derived_airspeeds.py --out derived_airspeeds.md

``--nulls`` diagnoses fleets of one world of which one side is plain ADS-B, ``--real`` hides airspeeds of real rows.
``docs/records/derived_airspeeds.md`` has what they write.
"""

import argparse
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import polars as pl
import torch
from numpy.typing import NDArray

import descentflow as df
from benchmarks.hidden_airspeeds import real_rows
from descentflow.representation.airspeed_error import AirspeedErrors, without_airspeed_error
from descentflow.representation.profiles import Profiles, profiles_from_frame
from descentflow.simulation.world import field_file
from descentflow.simulation.world_config import WorldConfig
from descentflow.surveillance.descents.prepared_descents import Descents

Array = NDArray[np.float64]
LEVELS_FL, BOTTOM_FL, TOP_FL = (160, 200, 240, 280, 320, 350), 150, 370
DRAWN, SCORED, KELVINS = 20_000, 4000, 1.0
REPORTED, AS_DERIVED, LESS = "reported", "as derived", "error taken off"


def seen_at_levels(levels_fl: torch.Tensor, cas_mps: torch.Tensor, drag_n: torch.Tensor, mask: torch.Tensor) -> Array:
    """Deviation of CAS, m/s, and its correlation with drag, (2, levels)."""
    numbers = [int((levels_fl - level).abs().argmin()) for level in LEVELS_FL]
    both = [torch.stack([values[mask[:, at], at].double() for values in (cas_mps, drag_n)]) for at in numbers]
    return np.array([[float(pair[0].std()), float(torch.corrcoef(pair)[0, 1])] for pair in both]).T


def of_flights(profiles: Profiles) -> Array:
    """The same of flights."""
    return seen_at_levels(profiles.levels_fl, profiles.cas_mps, profiles.drag_n, profiles.mask)


def of_fit(derived: Descents, real: Descents, **options: Any) -> tuple[Array, str]:
    """The same of samples of one Gaussian that is fitted, and cells of its times and its scores.

    Args:
        derived: To fit.
        real: Reported airspeeds of the same flights, of which those that the fit held out are scored.
        options: Of the fit.
    """
    model = df.fit(derived, model="gaussian", **options)
    scores = df.evaluate(model, real, n=SCORED).scores
    places = (("cas_profile", "energy"), ("descent", "joint_energy"), ("descent", "auc"))
    flown = df.sample(model, DRAWN, seed=0).trajectories
    time_s, judged = flown.time_s[:, 0], [scores.get(*place).score for place in places]
    cells = f"{time_s.mean():.1f} +- {time_s.std():.1f} | {judged[0]:.2f} | {judged[1]:.3f} | {judged[2]:.2f}"
    return seen_at_levels(flown.levels_fl, flown.cas_mps, flown.drag_n, flown.mask), cells


def less_reported(derived: list[Array], reported: list[Array]) -> str:
    """Cells of spread, in percent, and correlation, less those of reported airspeeds, of several fleets.

    Means over levels, then over fleets, with the deviation of one fleet; and the highest level.
    """
    cells = []
    for apart, form in (
        (np.array([100 * (fleet[0] / true[0] - 1) for fleet, true in zip(derived, reported, strict=True)]), "+.1f"),
        (np.array([fleet[1] - true[1] for fleet, true in zip(derived, reported, strict=True)]), "+.3f"),
    ):
        fleets = [
            f" +- {column.std(ddof=1):{form[1:]}}" if len(apart) > 1 else "" for column in (apart.mean(1), apart[:, -1])
        ]
        cells += [f"{apart.mean():{form}}{fleets[0]}", f"{apart[:, -1].mean():{form}}{fleets[1]}"]
    return " | ".join(cells)


def simulated(fleets: int, flights: int, wind_mps: float, days: int, say: Callable[[str], None]) -> list[str]:
    """Tables of fleets and of their thirds: of the flights themselves, and of fits to the first of either."""
    aircraft, config = df.aircraft("A320"), WorldConfig(days=days)
    numbers: dict[int, dict[str, list[Array]]] = {}
    fits: list[str] = []
    for seed, folder in ((seed, TemporaryDirectory()) for seed in range(fleets)):
        out = Path(folder.name) / "plain.parquet"
        reported = df.simulate("A320", flights, seed, config).rows
        df.simulate("A320", flights, seed, config, without_airspeeds=True, wind_error_mps=wind_mps, out=out)
        names, plain = reported["flight_id"].unique().sort(), pl.read_parquet(out)
        third = int(0.3 * flights)
        for begin, end in [*((third * i, third * (i + 1)) for i in range(3)), (0, flights)]:
            some = pl.col("flight_id").is_in(names[begin:end].implode())
            real, derived = (
                df.prepare(reported.filter(some)),
                df.prepare(plain.filter(some), airspeeds_from=field_file(out)),
            )
            true, bare = (profiles_from_frame(each.frame, aircraft, BOTTOM_FL, TOP_FL) for each in (real, derived))
            errors = AirspeedErrors.of(derived.frame, wind_mps, KELVINS)
            assert errors is not None
            less = without_airspeed_error(bare, aircraft, errors, range(len(bare)), say)
            by_name = numbers.setdefault(end - begin, {REPORTED: [], AS_DERIVED: [], LESS: []})
            for name, flown in ((REPORTED, true), (AS_DERIVED, bare), (LESS, less)):
                by_name[name].append(of_flights(flown))
            if seed == begin == 0:
                none = {"wind_error_mps": 0.0, "temperature_error_k": 0.0}
                given = {"wind_error_mps": wind_mps, "temperature_error_k": KELVINS}
                fitted = {
                    REPORTED: of_fit(real, real),
                    AS_DERIVED: of_fit(derived, real, **none),
                    LESS: of_fit(derived, real, **given),
                }
                fits += [
                    f"| {end - begin:,} | {name} | {less_reported([flown], [fitted[REPORTED][0]])} | {cells} |"
                    for name, (flown, cells) in fitted.items()
                ]
        folder.cleanup()
        say(f"fleet {seed}")
    tables = [
        f"| {len(by_name[name])} of {size:,} | {name} | {less_reported(by_name[name], by_name[REPORTED])} |"
        for size, by_name in sorted(numbers.items())
        for name in (AS_DERIVED, LESS)
    ]
    heads = "airspeeds | spread of CAS, % | at FL350 | correlation of CAS and drag | at FL350 |"
    scores = " time, s | energy of CAS, kt | of all | AUC |"
    return [
        f"| fleets | {heads}", "|---" * 6 + "|", *tables, "",
        f"| fit to | {heads}{scores}", "|---" * 10 + "|", *fits,
    ]  # fmt: skip


def nulls(number: int, flights: int, wind_mps: float, say: Callable[[str], None]) -> list[str]:
    """Causes that diagnoses name where one side is plain ADS-B, the real one and the simulator in turn."""
    named: dict[str, list[str]] = {"real": [], "simulator": []}
    for seed in range(number):
        with TemporaryDirectory() as folder:
            out = Path(folder) / "plain.parquet"
            df.simulate("A320", flights, seed, without_airspeeds=True, wind_error_mps=wind_mps, out=out)
            derived = df.prepare(out, airspeeds_from=field_file(out))
        other = df.prepare(df.simulate("A320", flights, seed + number).rows)
        side = list(named)[seed % 2]
        sides = (derived, other) if side == "real" else (other, derived)
        causes = [cause.effect for cause in df.diagnose(*sides).causes]
        named[side].append(", ".join(causes))
        say(f"{side} derived, {seed}: {causes}")
    return [
        f"| {side} | {len(causes)} | {sum(map(bool, causes))} | {'; '.join(filter(None, causes))} |"
        for side, causes in named.items()
    ]


def main() -> None:
    """Write the record, or the tables that are asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, required=True, help="the tables, Markdown")
    parser.add_argument("--fleets", type=int, default=4, help="simulated (default: %(default)s)")
    parser.add_argument("--flights", type=int, default=1000, help="of each (default: %(default)s)")
    parser.add_argument("--days", type=int, default=30, help="over which they fly (default: %(default)s)")
    parser.add_argument("--wind", type=float, default=2.5, help="error of the field, m/s (default: %(default)s)")
    parser.add_argument("--nulls", type=int, help="diagnoses without a cause, in place of the fleets' tables")
    parser.add_argument("--real", type=Path, help="folder of real rows, in place of the fleets' tables")
    asked = parser.parse_args()

    def say(line: str) -> None:
        print(line, flush=True)

    if asked.real:
        lines = real_rows(asked.real)
    elif asked.nulls:
        lines = nulls(asked.nulls, asked.flights, asked.wind, say)
    else:
        lines = simulated(asked.fleets, asked.flights, asked.wind, asked.days, say)
    asked.out.write_text("\n".join(lines) + "\n", encoding="utf-8")
    print("\n".join(lines))


if __name__ == "__main__":
    main()
