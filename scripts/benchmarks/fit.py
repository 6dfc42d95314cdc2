"""Fits against peers: components on complete and gappy data, the mixture, and epochs of a flow."""

import argparse
from collections.abc import Callable

import torch
from sklearn.decomposition import PCA
from sklearn.mixture import GaussianMixture
from torch import Tensor, nn

from benchmarks.timing import best_of, print_row
from descentflow.densities import MaskedAffineFlowDensity
from descentflow.densities.density import Density
from descentflow.densities.em import fit_mixture
from descentflow.representation.evidence import WeightEvidence
from descentflow.representation.fpca.gappy import fit_components
from descentflow.training.splitting import flight_batches

VARIANCE = 0.95
LEVELS, COMPONENTS, DIMENSION, CLUSTERS, STARTS, BATCH = 221, 5, 6, 8, 8, 256
SPACING_M = 30.48


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the part's options."""
    parser.add_argument("-n", type=int, default=4_000, help="flights (default: %(default)s)")


def run(args: argparse.Namespace) -> None:
    """Print the table."""
    print(f"{args.n:,} flights; {torch.get_num_threads()} threads")
    print_row(["fit", "ms", "peer", "its ms", "ratio"], 30)
    curves = _curves(args.n)
    whole = torch.ones_like(curves, dtype=torch.bool)
    gappy = _gaps(whole)
    # What the peers do: mean, components, and the share of the variance that each explains.
    ours = best_of(lambda: fit_components(curves, whole, SPACING_M, VARIANCE, learn_constants=False))
    for name, peer in _component_peers(curves).items():
        _row("fPCA, complete data", ours, name, best_of(peer))
    # And the length of the noise, which flights left out say: three more fits, and hidden levels of theirs.
    _row("the same, noise's length", best_of(lambda: fit_components(curves, whole, SPACING_M, VARIANCE)), "", None)
    _row("fPCA, a quarter missing", best_of(lambda: fit_components(curves, gappy, SPACING_M, VARIANCE), 2), "", None)
    weights = _clusters(args.n)
    mixture = best_of(lambda: fit_mixture(weights, CLUSTERS, seed=0, n_restarts=STARTS), 2)
    values = weights.numpy()
    theirs = best_of(lambda: GaussianMixture(CLUSTERS, random_state=0, n_init=STARTS).fit(values), 2)
    _row(f"{CLUSTERS} clusters, {STARTS} starts", mixture, "scikit-learn", theirs)
    flow = MaskedAffineFlowDensity(DIMENSION)
    _row("epoch of MaskedAffineFlow", best_of(lambda: _epoch(flow, weights), 2), *_zuko(weights))


def _curves(n: int) -> Tensor:
    """Smooth curves of five modes and a little noise."""
    generator = torch.Generator().manual_seed(0)
    place = torch.linspace(0, 1, LEVELS, dtype=torch.float64)
    modes = torch.stack([torch.cos(torch.pi * k * place) / k for k in range(1, COMPONENTS + 1)])
    weights = torch.randn(n, COMPONENTS, generator=generator, dtype=torch.float64)
    return weights @ modes + 0.05 * torch.randn(n, LEVELS, generator=generator, dtype=torch.float64)


def _gaps(whole: Tensor) -> Tensor:
    """Tops missing, at a few heights, as descents begin: a quarter of the values."""
    generator = torch.Generator().manual_seed(1)
    top = LEVELS - 1 - 10 * torch.randint(0, 12, (len(whole), 1), generator=generator)
    return torch.arange(LEVELS) <= top


def _clusters(n: int) -> Tensor:
    generator = torch.Generator().manual_seed(2)
    centres = 2.0 * torch.randn(CLUSTERS, DIMENSION, generator=generator, dtype=torch.float64)
    noise = torch.randn(n, DIMENSION, generator=generator, dtype=torch.float64)
    return centres[torch.randint(0, CLUSTERS, (n,), generator=generator)] + 0.5 * noise


def _component_peers(curves: Tensor) -> dict[str, Callable[[], object]]:
    values = curves.numpy()
    peers: dict[str, Callable[[], object]] = {"scikit-learn PCA": lambda: PCA(COMPONENTS).fit(values)}
    try:
        from skfda.preprocessing.dim_reduction import FPCA
        from skfda.representation.grid import FDataGrid
    except ImportError:
        print("scikit-fda is not installed: no row of it")
        return peers
    return {**peers, "scikit-fda FPCA": lambda: FPCA(n_components=COMPONENTS).fit(FDataGrid(values))}


def _epoch(density: Density, weights: Tensor) -> None:
    """Maximum likelihood over all batches once, with the batches and the optimizer of training."""
    _one_epoch(density, density.log_prob, weights)


def _one_epoch(module: nn.Module, log_prob: Callable[[Tensor], Tensor], weights: Tensor) -> None:
    optimizer = torch.optim.AdamW([p for p in module.parameters() if p.requires_grad], lr=1e-3, fused=True)
    none = weights.new_empty(len(weights), 0)
    for batch, _ in flight_batches(WeightEvidence.of_weights(weights), none, batch_size=BATCH, shuffle=True):
        optimizer.zero_grad()
        (-log_prob(batch.points).mean()).backward()
        optimizer.step()


def _zuko(weights: Tensor) -> tuple[str, float | None]:
    try:
        from zuko.flows import MAF
    except ImportError:
        return "zuko is not installed", None
    hidden = [2 * DIMENSION]
    flow = MAF(DIMENSION, transforms=5, hidden_features=hidden).double()
    epoch = best_of(lambda: _one_epoch(flow, lambda batch: flow().log_prob(batch), weights), 2)
    return f"zuko {type(flow).__name__}", epoch


def _row(name: str, ours: float, peer: str, theirs: float | None) -> None:
    cells = ["-", "-"] if theirs is None else [f"{1000 * theirs:,.0f}", f"{theirs / ours:.2f} x"]
    print_row([name, f"{1000 * ours:,.0f}", peer or "-", *cells], 30)
