"""Samples against flights that were held out, against generators without physics, on any fleets.

    python scripts/benchmark.py fidelity fokker100.parquet b738.parquet

Half of each fleet trains. A classifier of samples and flights sees 1,000 ft with noise of reports on the samples, and
3,000 ft; the noise is what training flights show beyond the samples. Rates and CAS above and below the type's
transition are Wasserstein distances over those of the training flights. Intervals of predictions are those of the fit
to all training flights, and of few.
"""

import argparse
import time
from pathlib import Path

import numpy as np
import polars as pl
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
from descentflow.core.errors import DescentflowError
from descentflow.densities.density import Density
from descentflow.generation.prediction.predict import predict
from descentflow.generation.rejection import sample_descents
from descentflow.representation.profiles import Profiles
from descentflow.surveillance.descents.prepared_descents import Descents, read_descents
from descentflow.training.datamodule import DescentDataModule
from descentflow.training.fit import fit

DRAWS = 20
"""Pairs of subsets behind each distance."""
SIZE = 200
"""Descents of either side of a comparison."""
FEW_AGAINST = 500
"""Held-out flights that models of few flights are compared with."""
PREDICTED = 100
"""Held-out flights whose times are predicted."""
HEADS = ("generator", "AUC 3,000 ft", "reported", "rate above", "below", "CAS above", "below", "rejected", "CPU s")
OF_INTERVALS = (
    "    from FL{:.0f}: 90 % hold {:.0%} at the bottom, {:.0%} at all levels, {:.2f} as wide and with {:.2f} of the "
    "error of least squares, which hold {:.0%}"
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the part's options."""
    parser.add_argument("descents", nargs="+", type=Path, help="prepared descents of one type each")
    parser.add_argument("--models", nargs="+", default=["mixture", "gaussian", "flow"])
    parser.add_argument("--few", nargs="+", type=int, default=[20, 50, 100], help="numbers of training flights")
    parser.add_argument("--repeats", type=int, default=3, help="draws of the few flights (default: %(default)s)")
    parser.add_argument("--few-models", nargs="*", default=["mixture", "gaussian"], help="models of few flights")
    parser.add_argument("--observed-to", nargs="+", type=float, default=[280.0, 230.0], help="levels to predict from")
    parser.add_argument("--coarse", action="store_true", help="leave out the AUC of reported features, which are finer")
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
        print_row(cells("training flights", train, train, test, transition, args), 18)
        for name in args.models:
            start = time.process_time()
            density = fit(halved(descents, args.seed), name, seed=args.seed, final=False).density.eval()
            drawn, rejected = sampled(density, args.n, args.seed)
            more = [f"{100 * rejected:.1f} %", f"{time.process_time() - start:.0f}"]
            print_row([*cells(name, drawn, train, test, transition, args, noise=True), *more], 18)
            print_intervals(density, descents, data, args.observed_to)
        for name, rival in RIVALS.items():
            drawn = rival(train, args.n, args.seed)
            print_row(cells(name, drawn, train, test, transition, args), 18)
        for n in args.few:
            few_flights(descents, data, n, args)


def halved(descents: Descents, seed: int) -> DescentDataModule:
    """The data of which half is held out, and nothing for validation."""
    data = DescentDataModule(descents, test_fraction=0.5, validation_fraction=0.0, seed=seed)
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
    name: str,
    drawn: Vectors,
    train: Vectors,
    test: Vectors,
    transition_fl: float,
    args: argparse.Namespace,
    *,
    noise: bool = False,
) -> list[str]:
    """AUC and distances of one generator; noise of reports is put on what has none."""
    rng = np.random.default_rng(args.seed)
    shown = drawn if drawn is train else with_gaps_of(drawn, train, rng)
    # What flights show beyond the samples at the finest scale: of reports, as far as anyone can know.
    beyond = max(altitude_noise_ft(train) ** 2 - altitude_noise_ft(drawn) ** 2, 0.0) ** 0.5
    noisy = reported(shown, rng, beyond) if noise else rounded(shown)
    pairs = [(coarse(test), coarse(shown)), (rounded(test), noisy)][: 1 if args.coarse else 2]
    scores = [auc(*pair, rng) for pair in pairs] + [np.nan] * args.coarse
    sides = [marginals(of, transition_fl) for of in (shown, train, test)]
    distances = over_floor(sides[0], sides[1], sides[2], rng)
    return [name, *(f"{number:.2f}" for number in (*scores, *distances))]


def marginals(of: Vectors, transition_fl: float) -> list[Array]:
    """Rates of the bins above and below a level, and CAS at the edges above and below it."""
    middle = (of.edges_fl[:-1] + of.edges_fl[1:]) / 2
    pairs = ((np.exp(-of.log_s), middle >= transition_fl), (of.cas_kt, of.edges_fl >= transition_fl))
    return [values[:, at] for values, above in pairs for at in (above, ~above)]


def over_floor(drawn: list[Array], train: list[Array], test: list[Array], rng: np.random.Generator) -> list[float]:
    """Wasserstein distance of each marginal in the mean of its levels, over that of the training flights."""
    sums = np.zeros((len(test), 2))
    for _ in range(DRAWS):
        flights, *sides = ([of[rng.permutation(len(of))[:SIZE]] for of in side] for side in (test, drawn, train))
        for i, side in enumerate(sides):
            for k, (first, second) in enumerate(zip(flights, side, strict=True)):
                sums[k, i] += np.mean([_distance(*pair) for pair in zip(first.T, second.T, strict=True)] or [np.nan])
    return list(sums[:, 0] / sums[:, 1])


def _distance(first: Array, second: Array) -> float:
    first, second = first[np.isfinite(first)], second[np.isfinite(second)]
    return float(wasserstein_distance(first, second)) if min(len(first), len(second)) > 1 else 0.0


def print_intervals(density: Density, descents: Descents, data: DescentDataModule, levels: list[float]) -> None:
    """Print shares of held-out flights in 90 % intervals from levels down, width and error over the control's."""
    names = data.profiles("test").flight_ids[:PREDICTED]
    for level in levels:
        try:
            errors = predict(density, descents, from_fl=level, n=200, flights=names).coverage().sort("level_fl")
        except DescentflowError as error:
            print(f"    from FL{level:.0f}: {error}")
            continue
        lowest, every = errors.row(0, named=True), errors["covered"].to_numpy().mean()
        print(
            f"    from FL{level:.0f}: {lowest['flights']} flights, 90 % intervals hold {lowest['covered']:.0%} at the"
        )
        print(f"    bottom and {every:.0%} at all levels; {lowest['width_s']:.0f} s wide, RMSE {lowest['rms_s']:.0f} s")
        if "width_s_control" in errors.columns:
            width, error_s, held = (lowest[f"{name}_control"] for name in ("width_s", "rms_s", "covered"))
            print(f"    least squares: {width:.0f} s wide, RMSE {error_s:.0f} s, hold {held:.0%}")


def few_flights(descents: Descents, data: DescentDataModule, n: int, args: argparse.Namespace) -> None:
    """Print energy distances of models of n flights, over the smoothed bootstrap's; intervals of those of one draw."""
    known, test = data.profiles("train"), of_profiles(data.profiles("test"))
    distances: dict[str, list[float]] = {name: [] for name in ("bootstrap", *args.few_models)}
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
        for name in args.few_models:
            few = DescentDataModule(Descents(frame, descents.metadata), test_fraction=0.0, validation_fraction=0.0)
            density = fit(few, name, seed=args.seed, final=False).density.eval()
            drawn = on_edges(sampled(density, args.n, repeat)[0], test.edges_fl)
            distances[name].append(energy_distance(flights, with_gaps_of(drawn, train, rng), spread))
            if repeat == 0:
                print(f"{n} flights, {name}:")
                print_intervals(density, descents, data, args.observed_to)
    # Of the means: the bootstrap of one draw may be next to zero.
    least = np.mean(distances.pop("bootstrap"))
    ratios = ", ".join(f"{name} {np.mean(values) / least:.2f}" for name, values in distances.items())
    print(f"{n} flights, energy distance over the smoothed bootstrap's: {ratios}")


def on_edges(of: Vectors, edges_fl: Array) -> Vectors:
    """The same at other edges: of few flights the grid may end lower."""
    n = min(len(edges_fl), len(of.edges_fl))
    wider = len(edges_fl) - n
    cas, log_s = (
        np.pad(values[:, :m], ((0, 0), (0, wider)), constant_values=np.nan)
        for values, m in ((of.cas_kt, n), (of.log_s, n - 1))
    )
    return Vectors(edges_fl, cas, log_s, of.entry_fl)
