"""Scores of samples against flights, level by level, against scipy's functions called level by level."""

import argparse
import time

import numpy as np
import torch
from scipy.stats import ks_2samp, wasserstein_distance

from benchmarks.timing import best_of, print_row
from descentflow.evaluation.metrics.noise_floor import level_distances
from descentflow.evaluation.metrics.proper import energy_scores
from descentflow.evaluation.metrics.score_registry import statistics_of
from descentflow.evaluation.metrics.statistic_kinds import LevelStatistic

LEVELS = 221


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the part's options."""
    parser.add_argument("-n", type=int, default=10_000, help="samples (default: %(default)s)")
    parser.add_argument("--flights", type=int, default=2_000, help="real flights (default: %(default)s)")


def run(args: argparse.Namespace) -> None:
    """Print the table: one quantity on all levels, a tenth of the values not observed."""
    generator = torch.Generator().manual_seed(0)
    samples, real = (torch.randn(n, LEVELS, generator=generator).double() for n in (args.n, args.flights))
    masks = [torch.rand(values.shape, generator=generator) > 0.1 for values in (samples, real)]
    *chosen, crps = statistics_of(LevelStatistic)
    ours = best_of(lambda: level_distances(samples, masks[0], real, masks[1], chosen), 5)
    distances = level_distances(samples, masks[0], real, masks[1], chosen)
    start = time.perf_counter()
    expected = [_by_scipy(samples[:, k][masks[0][:, k]], real[:, k][masks[1][:, k]]) for k in range(LEVELS)]
    theirs = time.perf_counter() - start
    assert np.allclose(distances["ks"], [row[0] for row in expected])
    assert np.allclose(distances["wasserstein"], [row[1] for row in expected])
    print(f"{args.n:,} samples against {args.flights:,} flights on {LEVELS} levels; {torch.get_num_threads()} threads")
    print_row(["score", "ms", "scipy's ms", "ratio"], 24)
    cells = [f"{1000 * ours:.0f}", f"{1000 * theirs:,.0f}", f"{theirs / ours:.1f} x"]
    print_row(["KS, Wasserstein, mean", *cells], 24)
    proper = best_of(lambda: level_distances(samples, masks[0], real, masks[1], [crps]), 3)
    print_row(["CRPS", f"{1000 * proper:.0f}", "-", "-"], 24)
    energy = best_of(lambda: energy_scores((samples, masks[0] | True), (real, masks[1])), 2)
    print_row(["energy score", f"{1000 * energy:.0f}", "-", "-"], 24)


def _by_scipy(samples: torch.Tensor, real: torch.Tensor) -> tuple[float, float, float]:
    first, second = samples.numpy(), real.numpy()
    mean = abs(first.mean() - second.mean())
    return ks_2samp(first, second, method="asymp").statistic, wasserstein_distance(first, second), mean
