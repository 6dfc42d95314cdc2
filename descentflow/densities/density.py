"""The base of every latent density: what it offers to sampling, scoring and checkpoints."""

from abc import ABC, abstractmethod
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, ClassVar

import torch
from torch import Tensor, nn

from descentflow.core.errors import ConfigError
from descentflow.densities.mixture_parameters import Mixture
from descentflow.representation.representation import Representation


class Density(nn.Module, ABC):
    """A density over d standardised weights (paper, section 2.3), with the representation that gives them meaning.

    A subclass defines its log density and how to draw from it; its constructor takes the number of weights and whatever
    :meth:`settings` returns. It knows nothing of training. A density may be conditioned on the c numbers of a flight's
    context (:class:`descentflow.representation.context.ContextEncoder`): then both take one row of them per flight.

    Example:
        >>> class UniformDensity(Density):  # over the cube from -2 to 2
        ...     def log_prob(self, weights, context=None):
        ...         inside = (weights.abs() <= 2).all(1)
        ...         return torch.where(inside, -self.dimension * torch.log(torch.tensor(4.0)), -torch.inf)
        ...
        ...     def draw(self, n, context=None):
        ...         return 4 * torch.rand(n, self.dimension) - 2
        ...
        ...     device = torch.device("cpu")  # it has no parameters of which to ask
        >>> density = UniformDensity(dimension=2)
        >>> bool(density.log_prob(density.sample(100, seed=0)).isfinite().all())
        True
        >>> _ = Density.kinds.pop("UniformDensity")  # this one shall not be known to checkpoints
    """

    kinds: ClassVar[dict[str, type["Density"]]] = {}
    """Every known density by the name that checkpoints carry."""

    def __init_subclass__(cls, **kwargs: Any) -> None:
        """Register the subclass for checkpoints under its name."""
        super().__init_subclass__(**kwargs)
        Density.kinds[cls.__name__] = cls

    def __init__(self, dimension: int, n_context: int = 0) -> None:
        """Start without a representation.

        Args:
            dimension: Number of weights d.
            n_context: Numbers c of context; zero for a density that is not conditioned on any.
        """
        super().__init__()
        self.dimension, self.n_context = dimension, n_context
        self._representation: Representation | None = None

    @abstractmethod
    def log_prob(self, weights: Tensor, context: Tensor | None = None) -> Tensor:
        """Log density (n,) of standardised weights (n, d), in nats, at context (n, c) or (1, c) if it takes one."""

    @abstractmethod
    def draw(self, n: int, context: Tensor | None = None) -> Tensor:
        """Draw (n, d) standardised weights with torch's global generator; call :meth:`sample` instead."""

    def settings(self) -> dict[str, Any]:
        """Primitive arguments that, after the dimension, make the constructor give parameters of the same shapes."""
        return {}

    @torch.no_grad()
    def sample(self, n: int, seed: int, context: Tensor | None = None) -> Tensor:
        """Draw (n, d) standardised weights, the same for the same seed, leaving the global generator as it was.

        Args:
            n: Number of draws.
            seed: Of the draws.
            context: (n, c) or (1, c) where the density is conditioned on one.

        Raises:
            ConfigError: If the density needs a context and has none here, or takes none and has one here.

        Example:
            >>> from descentflow.densities.checkpoint import load_model
            >>> density = load_model("best.ckpt")
            >>> weights = density.sample(1000, seed=0)
            >>> torch.equal(density.sample(1000, seed=0), weights)
            True
        """
        rows = self.rows_of_context(context, n)
        with seeded(seed, self.device):
            return self.draw(n) if rows is None else self.draw(n, rows)

    def mixture_at(self, context: Tensor | None = None) -> Mixture | None:
        """The density as a Gaussian mixture, at one context (1, c) where it takes one; None if it is not a mixture."""
        return None

    def rows_of_context(self, context: Tensor | None, n: int) -> Tensor | None:
        """The context (n, c) of n flights, checked; None for a density without context.

        Raises:
            ConfigError: If there should be none, should be one, or it has another shape.
        """
        if context is None and self.n_context == 0:
            return None
        known = self._representation.context if self._representation is not None else None
        what = known.describe() if known is not None else f"{self.n_context} numbers per flight"
        if context is None:
            raise ConfigError(
                "a conditional density without a context", expected=what, mend="pass the context of every flight"
            )
        if self.n_context == 0 or context.shape[1:] != (self.n_context,) or len(context) not in (1, n):
            raise ConfigError(
                f"context of shape {tuple(context.shape)} for {n} flights",
                expected=f"({n}, {self.n_context}): {what}" if self.n_context else "none: the density knows no context",
                mend="encode it with density.representation.context",
            )
        return context.expand(n, -1)

    @property
    def device(self) -> torch.device:
        """Device of the parameters."""
        return next(self.parameters()).device

    @property
    def representation(self) -> Representation:
        """Bases, scaler, bounds and split.

        Raises:
            ConfigError: If none was attached.
        """
        if self._representation is None:
            raise ConfigError(
                "a density without a representation",
                expected="one that was fitted or loaded from a checkpoint",
                mend="fit it, or load it with descentflow.densities.checkpoint.load_model",
            )
        return self._representation

    def attach(self, representation: Representation) -> None:
        """Attach the representation that gives the weights their meaning."""
        self._representation = representation.to(self.device)


@contextmanager
def seeded(seed: int, device: torch.device) -> Iterator[None]:
    """Seed torch's global generators inside the block and restore them after it.

    Example:
        >>> with seeded(0, torch.device("cpu")):
        ...     first = torch.rand(1)
        >>> with seeded(0, torch.device("cpu")):
        ...     torch.equal(torch.rand(1), first)
        True
    """
    cuda = [device] if device.type == "cuda" else []
    with torch.random.fork_rng(devices=cuda):
        torch.manual_seed(seed)
        yield
