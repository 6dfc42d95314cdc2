"""Densities with invented parameters, and what descentflow itself makes of the same random numbers."""

from typing import Any

import torch
import toys
from torch import Tensor

from descentflow.densities.density import Density
from descentflow.densities.flow import MaskedAffineFlowDensity
from descentflow.densities.gaussian import GaussianDensity
from descentflow.densities.mixture import GaussianMixtureDensity
from descentflow.densities.mixture_parameters import Mixture
from descentflow.exports.descent_graph import PROFILES
from descentflow.generation.sample_tables import to_frame
from descentflow.representation.representation import Representation


def factor(d: int, generator: torch.Generator) -> Tensor:
    """A lower Cholesky factor of a covariance that is no identity."""
    return torch.eye(d, dtype=torch.float64) * 1.5 + 0.3 * torch.randn(d, d, generator=generator).double().tril()


def density(kind: str, parts: Representation, n_context: int = 0) -> Density:
    """A Gaussian, a mixture, or a flow, none of them at its start."""
    d, generator = parts.decoder.dimension, torch.Generator().manual_seed(3)

    def normal(*shape: int) -> Tensor:
        return 0.5 * torch.randn(shape, generator=generator).double()

    if kind == "gaussian":
        made: Any = GaussianDensity(d, n_context)
        line = (normal(1, d, n_context), normal(1, n_context)) if n_context else ()
        made.mixture = Mixture(torch.ones(1).double(), normal(1, d), factor(d, generator)[None], *line)
    elif kind == "mixture":
        made = GaussianMixtureDensity(d, 3, n_context)
        line = (normal(3, d, n_context), normal(3, n_context)) if n_context else ()
        trils = torch.stack([factor(d, generator) for _ in range(3)])
        made.mixture = Mixture(torch.tensor([0.2, 0.5, 0.3]).double(), normal(3, d), trils, *line)
    else:
        torch.manual_seed(3)
        made = MaskedAffineFlowDensity(d, n_flows=2, n_context=n_context, whitened=kind == "whitened flow")
        if made.whitened:
            made.whiten(normal(d), normal(d, n_context), factor(d, generator))
        for parameter in made.flow.parameters():
            parameter.data += 0.1 * torch.randn(parameter.shape, generator=generator)
    made.attach(parts)
    return made.eval().requires_grad_(False)


def weights_of(model: Density, noise_seed: int, n: int, component: Tensor | None = None) -> tuple[Tensor, Tensor]:
    """Standard normals (n, d) and the weights that the density itself draws with them."""
    d = model.dimension
    if component is not None:
        generator = torch.Generator().manual_seed(noise_seed)
        noise = torch.randn(n, d, 1, generator=generator, dtype=torch.float64)[..., 0]
        mixture: Any = model.mixture
        return noise, mixture.locs[component] + (mixture.scale_trils[component] @ noise[..., None])[..., 0]
    if isinstance(model, MaskedAffineFlowDensity):
        noise = torch.randn(n, d, generator=torch.Generator().manual_seed(noise_seed), dtype=model.white_dtype)
        return noise, model.of_white(noise, torch.zeros(len(noise), 0))
    first, second = (torch.Generator().manual_seed(noise_seed) for _ in range(2))
    return torch.randn(n, d, generator=first, dtype=torch.float64), model.draw(n, second)


def table_of(parts: Representation, weights: Tensor, entry: Tensor, residual: Tensor | None) -> dict[str, Tensor]:
    """Time, CAS, rate, distance, ... (n, L) as the table of samples has them, NaN above the entry level."""
    flown = parts.decoder(weights, entry, residual=residual)
    table = to_frame(flown).sort("sample_id", "level_fl")
    shape = flown.time_s.shape
    columns = {}
    for name in PROFILES:
        grid = torch.full(shape, torch.nan, dtype=torch.float64)
        grid[flown.mask] = torch.from_numpy(table[name].to_numpy().copy())
        columns[name] = grid
    columns["broken"] = parts.plausibility.broken_rules(flown)
    return columns


PARTS = toys.representation(100)
