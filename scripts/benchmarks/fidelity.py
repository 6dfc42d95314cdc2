"""Samples against flights that were held out, against generators without physics, on any fleets.

    python scripts/benchmark.py fidelity fokker100.parquet b738.parquet

Half of each fleet trains. A classifier of samples and flights sees 1,000 ft with noise of reports on the samples, and
3,000 ft; the noise is what training flights show beyond the samples. Rates above and below the type's transition are
Wasserstein distances over those of the training flights.
"""

import argparse
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import polars as pl
from numpy.typing import NDArray
from scipy.stats import wasserstein_distance

from benchmarks.fidelity_rivals import RIVALS, smoothed_bootstrap
from benchmarks.fidelity_vectors import (
    Array,
    Vectors,
    altitude_noise_ft,
    auc,
    coarse,
    energy_distance,
    reported,
    rounded,
    vectors_of,
    with_gaps_of,
)
from benchmarks.timing import print_row
from descentflow.core.errors import DataError, SamplingError
from descentflow.densities.density import Density
from descentflow.generation.prediction.predict import predict
from descentflow.generation.rejection import sample_descents
from descentflow.representation.profiles import Profiles
from descentflow.surveillance.descents.prepared_descents import Descents, read_descents
from descentflow.training.datamodule import DescentDataModule
from descentflow.training.fit import fit
from descentflow.training.splitting import SplitSettings

DRAWS = 20
"""Pairs of subsets behind each distance."""
SIZE = 200
"""Descents of either side of a comparison."""
FEW_AGAINST = 500
"""Held-out flights that models of few flights are compared with."""
OBSERVED_TO_FL = (280.0, 230.0)
"""Levels to which flights count as observed, for intervals of the time to the bottom."""
HEADS = ("generator", "AUC 3,000 ft", "AUC reported", "rate above", "rate below", "rejected", "CPU s")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the part's options."""
    parser.add_argument("descents", nargs="+", type=Path, help="prepared descents of one type each")
    parser.add_argument("--models", nargs="+", default=["mixture", "gaussian", "flow"])
    parser.add_argument("--few", nargs="+", type=int, default=[20, 50, 100], help="numbers of training flights")
    parser.add_argument("--repeats", type=int, default=3, help="draws of the few flights (default: %(default)s)")
    parser.add_argument("-n", type=int, default=2_000, help="samples (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=0)


def run(args: argparse.Namespace) -> None:
    """Print the tables of each fleet."""
    for path in args.descents:
        descents = read_descents(path)
        data = halved(descents, args.seed)
        train, test = (of_profiles(data.profiles(part)) for part in ("train", "test"))
        print(f"\n{path.stem}: {len(train)} training and {len(test)} held-out flights")
        print_row(list(HEADS), 14)
        transition = data.representation.decoder.transition_fl
        print_row(cells("training flights", train, train, test, transition, args.seed), 18)
        for name in args.models:
            start = time.process_time()
            density = fit(halved(descents, args.seed), name, seed=args.seed, final=False).density.eval()
            drawn, rejected = sampled(density, args.n, args.seed)
            more = [f"{100 * rejected:.1f} %", f"{time.process_time() - start:.0f}"]
            print_row([*cells(name, drawn, train, test, transition, args.seed, noise=True), *more], 18)
            for line in intervals(density, descents):
                print(f"    {line}")
        for name, rival in RIVALS.items():
            drawn = rival(train, args.n, args.seed)
            print_row(cells(name, drawn, train, test, transition, args.seed), 18)
        for n in args.few:
            print(few_flights(descents, data, n, args))


def halved(descents: Descents, seed: int) -> DescentDataModule:
    """The data of which half is held out, and nothing for validation."""
    data = DescentDataModule(descents, split=SplitSettings(0.5, 0.0, seed=seed))
    data.setup()
    return data


def of_profiles(flights: Profiles) -> Vectors:
    """Vectors of flights."""
    return vectors_of(flights.levels_fl, flights.time_s, flights.cas_mps, flights.mask)


def sampled(density: Density, n: int, seed: int) -> tuple[Vectors, float]:
    """Vectors of samples, and the share of draws that was rejected."""
    samples = sample_descents(density, density.representation, n, seed)
    flown, share = samples.trajectories, samples.report.rejected / samples.report.drawn
    return vectors_of(flown.levels_fl, flown.time_s, flown.cas_mps, flown.mask), share


def cells(
    name: str, drawn: Vectors, train: Vectors, test: Vectors, transition_fl: float, seed: int, *, noise: bool = False
) -> list[str]:
    """AUC and distances of one generator; noise of reports is put on what has none."""
    rng = np.random.default_rng(seed)
    shown = drawn if drawn is train else with_gaps_of(drawn, train, rng)
    # What flights show beyond the samples at the finest scale: of reports, as far as anyone can know.
    beyond = max(altitude_noise_ft(train) ** 2 - altitude_noise_ft(drawn) ** 2, 0.0) ** 0.5
    noisy = reported(shown, rng, beyond) if noise else rounded(shown)
    scores = auc(coarse(test), coarse(shown), rng), auc(rounded(test), noisy, rng)
    middle = (test.edges_fl[:-1] + test.edges_fl[1:]) / 2
    rates = (over_floor(shown, train, test, at, rng) for at in (middle >= transition_fl, middle < transition_fl))
    return [name, *(f"{number:.2f}" for number in (*scores, *rates))]


def over_floor(drawn: Vectors, train: Vectors, test: Vectors, at: NDArray[np.bool_], rng: np.random.Generator) -> float:
    """Wasserstein distance of rates over the mean of these bins, over that of the training flights."""
    sums = np.zeros(2)
    for _ in range(DRAWS):
        flights = np.exp(-some(test, rng).log_s[:, at])
        for i, side in enumerate((drawn, train)):
            others = np.exp(-some(side, rng).log_s[:, at])
            sums[i] += np.mean([_distance(flights[:, k], others[:, k]) for k in range(flights.shape[1])] or [np.nan])
    return float(sums[0] / sums[1])


def some(of: Vectors, rng: np.random.Generator) -> Vectors:
    """A subset of the size that is compared."""
    return of.rows(rng.permutation(len(of))[:SIZE])


def _distance(first: Array, second: Array) -> float:
    first, second = first[np.isfinite(first)], second[np.isfinite(second)]
    return float(wasserstein_distance(first, second)) if min(len(first), len(second)) > 1 else 0.0


def intervals(density: Density, descents: Descents) -> Iterator[str]:
    """Share of held-out flights in 90 % intervals, and their width over that of least squares."""
    for level in OBSERVED_TO_FL:
        try:
            held_at = predict(density, descents, from_fl=level, n=200).coverage().sort("level_fl")
        except (DataError, SamplingError) as error:
            yield f"from FL{level:.0f}: {error.got}"
            continue
        width = (held_at["width_s"] / held_at["width_s_control"])[0] if "width_s_control" in held_at.columns else np.nan
        held = [f"{100 * share:.0f} %" for share in (held_at["covered"][0], held_at["covered"].to_numpy().mean())]
        yield (
            f"from FL{level:.0f}: {held_at['flights'][0]} flights, 90 % intervals hold {held[0]} at the bottom and "
            f"{held[1]} at all levels, {width:.2f} as wide as least squares'"
        )


def few_flights(descents: Descents, data: DescentDataModule, n: int, args: argparse.Namespace) -> str:
    """Energy distances to the held-out flights of models of n flights, over the smoothed bootstrap's, in the mean."""
    known, test = data.profiles("train"), of_profiles(data.profiles("test"))
    distances: dict[str, list[float]] = {name: [] for name in ("bootstrap", *args.models)}
    for repeat in range(args.repeats):
        rng = np.random.default_rng((args.seed, n, repeat))
        chosen = rng.permutation(len(known))[:n]
        train = of_profiles(known.subset(chosen.tolist()))
        spread = np.nanstd(np.vstack([train.whole, test.whole]), 0)
        rival = with_gaps_of(smoothed_bootstrap(train, args.n, repeat), train, rng)
        flights = test.rows(rng.permutation(len(test))[:FEW_AGAINST])
        distances["bootstrap"].append(energy_distance(flights, rival, spread))
        names = [known.flight_ids[i] for i in chosen]
        frame = descents.frame.filter(pl.col("flight_id").is_in(names))
        for name in args.models:
            few = DescentDataModule(Descents(frame, descents.metadata), split=SplitSettings(0.0, 0.0))
            density = fit(few, name, seed=args.seed, final=False).density.eval()
            drawn = on_edges(sampled(density, args.n, repeat)[0], test.edges_fl)
            distances[name].append(energy_distance(flights, with_gaps_of(drawn, train, rng), spread))
    # Of the means: the bootstrap of one draw may be next to zero.
    least = np.mean(distances.pop("bootstrap"))
    ratios = ", ".join(f"{name} {np.mean(values) / least:.2f}" for name, values in distances.items())
    return f"{n} flights, energy distance over the smoothed bootstrap's: {ratios}"


def on_edges(of: Vectors, edges_fl: Array) -> Vectors:
    """The same at other edges: of few flights the grid may end lower."""
    n = min(len(edges_fl), len(of.edges_fl))
    wider = len(edges_fl) - n
    cas, log_s = (
        np.pad(values[:, :m], ((0, 0), (0, wider)), constant_values=np.nan)
        for values, m in ((of.cas_kt, n), (of.log_s, n - 1))
    )
    return Vectors(edges_fl, cas, log_s, of.entry_fl)
