"""Protocols of densities in rejection sampling: weights, for contexts or of components, and their residual."""

from typing import Protocol, runtime_checkable

from torch import Tensor

from descentflow.densities.entry_gate import EntryGate


class Sampler(Protocol):
    """Whatever draws standardised weights repeatably.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> model: Sampler = load_model("best.ckpt")
        >>> torch.equal(model.sample(3, seed=1), model.sample(3, seed=1))
        True
    """

    def sample(self, n: int, seed: int) -> Tensor:
        """Draw (n, d) weights."""


class ConditionalSampler(Protocol):
    """Whatever draws standardised weights repeatably, for the contexts that it is given.

    Example:
        >>> class Shifted:
        ...     def sample(self, n: int, seed: int, context: torch.Tensor | None = None) -> torch.Tensor:
        ...         white = torch.randn(n, 2, generator=torch.Generator().manual_seed(seed))
        ...         return white if context is None else white + context
        >>> model: ConditionalSampler = Shifted()
        >>> model.sample(3, seed=0, context=torch.full((3, 1), 100.0)).mean().round(decimals=-1)
        tensor(100.)
    """

    def sample(self, n: int, seed: int, context: Tensor | None = None) -> Tensor:
        """Draw (n, d) weights, row i for row i of context (n, c)."""


@runtime_checkable
class GatedSampler(Protocol):
    """Whatever draws of components (of a mixture, or bins of the entry level), known by the level of entry.

    That is where ``entry_gate`` is not None.

    Example:
        >>> from descentflow.densities.mixture import GaussianMixtureDensity
        >>> isinstance(GaussianMixtureDensity(dimension=2), GatedSampler)
        True
    """

    entry_gate: EntryGate | None

    def sample_of(self, components: Tensor, seed: int) -> Tensor:
        """Draw (n, d) weights of the components (n,)."""


@runtime_checkable
class ResidualSampler(Protocol):
    """Whatever knows how what lies beyond the components goes with the weights.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> isinstance(load_model("best.ckpt"), ResidualSampler)
        True
    """

    def residual(
        self,
        weights: Tensor,
        white: Tensor,
        seed: int,
        context: Tensor | None = None,
        components: Tensor | None = None,
        of_scale: Tensor | None = None,
    ) -> Tensor:
        """Residual numbers (n, r) of weights (n, d), of standard normals (n, r)."""
