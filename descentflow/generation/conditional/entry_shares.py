"""Shares of entry levels and components among samples, so that conditioned draws have the same law.

Samples of a density with a gate have the gate's shares of components among *plausible* flights: a rejected draw is
drawn again of its component (:mod:`descentflow.generation.rejection`). Conditioned draws are rejected whole, so that a
component must be drawn more often the less often it is plausible: its share divided by that probability.
"""

import numpy as np
import torch

from descentflow.densities.density import Density
from descentflow.densities.entry_gate import EntryGate
from descentflow.generation.conditional.flown_profiles import Array
from descentflow.generation.rejection import MAX_TRIES
from descentflow.representation.representation import Representation

TRIED = 500
"""Draws of each component that tell how plausible it is, at every level of entry: to 4 % where half are rejected."""


class EntryShares:
    """Shares of levels of entry, and of K components given each, as of :class:`.latent_parts.LatentParts`.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> model = load_model("best.ckpt")
        >>> shares = EntryShares(model)
        >>> bool(np.isclose(np.exp(shares.log_entries).sum(), 1.0))
        True
        >>> shares.log_components(10) is None  # of a Gaussian
        True
    """

    def __init__(self, density: Density) -> None:
        """Count the training flights' entries, and try the components of a mixture with a gate."""
        parts = density.representation
        counts = parts.plausibility.entry_counts.cpu().double().numpy()
        with np.errstate(divide="ignore"):
            self.log_entries: Array = np.log(counts / counts.sum())
        gate: EntryGate | None = getattr(density, "entry_gate", None)
        self._by_entry: Array | None = None
        if gate is not None and density.n_context == 0:
            plausible = plausible_shares(density, parts, gate.shares.shape[1])
            bins = torch.bucketize(torch.arange(len(counts)), gate.edges).numpy()
            shares = (gate.shares[:, :, None] * _scale_probs(density)).flatten(1).numpy()[bins]
            # After so many tries in vain a sample is drawn of another component.
            kept = shares * (1 - (1 - plausible) ** MAX_TRIES)
            kept = kept / np.maximum(kept.sum(1, keepdims=True), 1e-300)
            with np.errstate(divide="ignore"):
                self._by_entry = np.log(kept) - np.log(np.maximum(plausible, 0.5 / TRIED))

    def log_components(self, entry: int) -> Array | None:
        """Log shares (K,) at a level of entry, up to rejection; None where they do not depend on it."""
        return None if self._by_entry is None else self._by_entry[entry]


def plausible_shares(density: Density, parts: Representation, n_components: int) -> Array:
    """Share of a component's draws that are plausible from each level of entry down.

    Shapes: (L, K), or (L, K J) where each strays at J scales, each of which is a component of its own.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> from descentflow.densities.mixture import GaussianMixtureDensity
        >>> gaussian = load_model("best.ckpt")
        >>> one = GaussianMixtureDensity(gaussian.dimension, n_clusters=1)
        >>> one.mixture = gaussian.mixture
        >>> shares = plausible_shares(one, gaussian.representation, 1)
        >>> bool(shares[0, 0] >= shares[-1, 0] > 0.3)
        True
    """
    found = []
    for k in range(n_components):
        components = torch.full((TRIED,), k)
        weights = density.sample_of(components, seed=k)  # type: ignore[operator]
        generator = torch.Generator().manual_seed(k)
        white = torch.randn(TRIED, parts.decoder.n_white, generator=generator, dtype=torch.float64)
        cumulative = _scale_probs(density).cumsum(0).tolist()
        for before, end in zip([0.0, *cumulative[:-1]], cumulative, strict=True):
            of_scale = torch.full((TRIED,), (before + end) / 2, dtype=torch.float64)
            white_of = density.residual(weights, white, k, components=components, of_scale=of_scale)
            # Plausible from a level down: nothing below it is broken.
            broken = parts.plausibility.broken_levels(parts.fly(weights, white=white_of))
            found.append((broken.cumsum(1) == 0).double().mean(0))
    return torch.stack(found, 1).numpy()


def _scale_probs(density: Density) -> torch.Tensor:
    """Probability (J,) of the scales at which flights stray from their components; one where that is not known."""
    law = density.residual_law
    return torch.ones(1, dtype=torch.float64) if law is None else law.scale_probs / law.scale_probs.sum()
