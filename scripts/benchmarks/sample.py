"""Draws and plausible descents a second of the three densities, against peers and the paper; latency of a generator."""

import argparse
import tempfile
from pathlib import Path

import torch
from torch import Tensor

from benchmarks.latency import print_latencies
from benchmarks.timing import best_of, print_row
from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
from descentflow.densities import GaussianDensity, GaussianMixtureDensity, MaskedAffineFlowDensity
from descentflow.densities.density import Density
from descentflow.densities.em import fit_mixture
from descentflow.generation.rejection import sample_descents
from descentflow.representation.fit_representation import fit_representation
from descentflow.representation.profiles import profiles_from_frame
from descentflow.representation.representation import Split
from descentflow.simulation.world import simulate
from descentflow.surveillance.prepare import prepare

FLIGHTS, CLUSTERS = 600, 4
PAPER_DESCENT_S = 5e-3
"""Seconds of a whole trajectory in the paper, on a laptop of 2023 (section 4.4)."""
PAPER_DRAW_S = {"GaussianDensity": 4e-4, "MaskedAffineFlowDensity": 2e-3}
"""Seconds of a draw there."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the part's options."""
    parser.add_argument("-n", type=int, default=10_000, help="draws, and descents (default: %(default)s)")


def run(args: argparse.Namespace) -> None:
    """Print the tables: densities as they start, the mixture fitted to flights' weights."""
    densities, weights = _densities()
    print(f"{args.n:,} draws of {weights.shape[1]} weights, and plausible descents; {torch.get_num_threads()} threads")
    print_row(["density", "draw ms", "of the paper", "log p ms", "descents/s", "of the paper"], 24)
    for density in densities:
        drawn = density.sample(args.n, seed=0)
        draw = best_of(lambda d=density: d.sample(args.n, seed=0), 3)
        with torch.no_grad():
            log_prob = best_of(lambda d=density, w=drawn: d.log_prob(w), 3)
        parts = density.representation
        whole = best_of(lambda d=density, p=parts: sample_descents(d, p, args.n, 0), 3)
        paper = PAPER_DRAW_S.get(type(density).__name__)
        cells = [f"{1000 * draw:.1f}", "-" if paper is None else f"{paper / (draw / args.n):,.0f} x"]
        cells += [f"{1000 * log_prob:.1f}", f"{args.n / whole:,.0f}", f"{PAPER_DESCENT_S / (whole / args.n):,.0f} x"]
        print_row([type(density).__name__.removesuffix("Density"), *cells], 24)
    _peers(weights, args.n)
    print_latencies(densities[1])


def _densities() -> tuple[list[Density], Tensor]:
    a320 = open_aircraft("A320")
    with tempfile.TemporaryDirectory(prefix="descentflow-benchmark-") as folder:
        rows = Path(folder) / "rows.parquet"
        simulate(a320, FLIGHTS, 0).rows.write_parquet(rows)
        frame = prepare(rows).frame
    every = profiles_from_frame(frame, a320, 150)
    train = every.between(150, int(every.levels_fl[every.entry_level].quantile(0.75)))
    train = train.subset(torch.nonzero(train.mask.sum(1) >= 2)[:, 0])
    parts = fit_representation(train, a320, Split(train.flight_ids, (), ()))
    weights = parts.decoder.encode(train)
    dimension = parts.decoder.dimension
    gaussian, mixture = GaussianDensity(dimension), GaussianMixtureDensity(dimension, CLUSTERS)
    gaussian.scale_tril.data = torch.linalg.cholesky(torch.cov(weights.T))
    mixture.mixture = fit_mixture(weights, CLUSTERS, seed=0, n_restarts=2)[0]
    densities: list[Density] = [gaussian, mixture, MaskedAffineFlowDensity(dimension)]
    for density in densities:
        density.attach(parts)
        density.eval()
    return densities, weights


def _peers(weights: Tensor, n: int) -> None:
    """The same sizes with scikit-learn's mixture and, where it is installed, zuko's masked autoregressive flow."""
    from sklearn.mixture import GaussianMixture

    values = weights.numpy()
    theirs = GaussianMixture(CLUSTERS, random_state=0).fit(values)
    drawn = theirs.sample(n)[0]
    times = best_of(lambda: theirs.sample(n), 3), best_of(lambda: theirs.score_samples(drawn), 3)
    _peer_row("scikit-learn mixture", times)
    ours, sklearns = (
        best_of(lambda: fit_mixture(weights, CLUSTERS, seed=0, n_restarts=8), 2),
        best_of(lambda: GaussianMixture(CLUSTERS, random_state=0, n_init=8).fit(values), 2),
    )
    print(f"fit of {CLUSTERS} clusters, 8 starts: ours {1000 * ours:.0f} ms, scikit-learn {1000 * sklearns:.0f} ms")
    try:
        from zuko.flows import MAF
    except ImportError:
        print("zuko is not installed: no row of it")
        return
    dimension = weights.shape[1]
    flow = MAF(dimension, transforms=5, hidden_features=[2 * dimension])()
    with torch.no_grad():
        drawn = flow.sample((n,))
        times = best_of(lambda: flow.sample((n,)), 3), best_of(lambda: flow.log_prob(drawn), 3)
    _peer_row("zuko MAF", times)


def _peer_row(name: str, times: tuple[float, float]) -> None:
    draw, log_prob = (f"{1000 * seconds:.1f}" for seconds in times)
    print_row([name, draw, "-", log_prob, "-", "-"], 24)
