"""The base of every latent density: what it offers to sampling, scoring and checkpoints."""

from abc import ABC, abstractmethod
from copy import deepcopy
from typing import TYPE_CHECKING, Any, ClassVar

import torch
from torch import Tensor, nn

from descentflow.core.arguments import NotNegativeInt, checked_arguments
from descentflow.core.errors import ConfigError
from descentflow.densities.importance import LikelihoodEstimate, estimate, widened
from descentflow.densities.mixture_parameters import Mixture, log_observed
from descentflow.representation.evidence import WeightEvidence
from descentflow.representation.representation import Representation

if TYPE_CHECKING:
    from descentflow.densities.weight_draws import WeightDraw

SCORING_DRAWS = 128
"""Draws of a flight's weights by which a density without a closed form is scored."""
MOMENT_DRAWS = 2000
"""Draws of a density that is neither a mixture nor knows a Gaussian, from whose moments one is made."""


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
        ...     def draw(self, n, generator, context=None):
        ...         return 4 * torch.rand(n, self.dimension, generator=generator) - 2
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
        self.file: dict[str, str] = {}
        """Name and digest of the checkpoint that it was loaded from."""
        # In a tuple, for it is no part of this module: its parameters are not among these.
        self._held_out: tuple[Density, ...] = ()

    @abstractmethod
    def log_prob(self, weights: Tensor, context: Tensor | None = None) -> Tensor:
        """Log density (n,) of standardised weights (n, d), in nats, at context (n, c) or (1, c) if it takes one."""

    @abstractmethod
    def draw(self, n: int, generator: torch.Generator, context: Tensor | None = None) -> Tensor:
        """Draw (n, d) standardised weights with this generator alone; :meth:`sample` has one for every call."""

    def weight_draw(self, dtype: torch.dtype) -> "WeightDraw":
        """Map from standard normals to weights as one expression, for export; a mixture needs none.

        Args:
            dtype: Precision of a network's arithmetic.

        Raises:
            ConfigError: If the density has none.
        """
        raise ConfigError(
            f"a {type(self).__name__}, whose draws cannot be written as a graph",
            expected="a density with `weight_draw`: a Gaussian, a mixture or a masked affine flow",
            mend="fit one of those, or export samples (--to parquet)",
        )

    def settings(self) -> dict[str, Any]:
        """Primitive arguments that, after the dimension, make the constructor give parameters of the same shapes."""
        return {}

    @checked_arguments
    @torch.no_grad()
    def sample(self, n: NotNegativeInt, seed: int, context: Tensor | None = None) -> Tensor:
        """Draw (n, d) standardised weights, the same for the same seed whatever other threads draw meanwhile.

        Torch's global generator is neither used nor changed.

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
        return self.draw(n, torch.Generator(self.device).manual_seed(seed), rows)

    @property
    def mixture(self) -> Mixture | None:
        """The density as a Gaussian mixture, with slopes and gate where it takes a context; None if it is not one."""
        return None

    @torch.no_grad()
    def mixture_at(self, context: Tensor | None = None) -> Mixture | None:
        """The density as a Gaussian mixture, at one context (1, c) where it takes one; None if it is not a mixture."""
        mixture, rows = self.mixture, self.rows_of_context(context, 1)
        return mixture and mixture.at(rows[0].to(mixture.locs))

    def log_observed(self, evidence: WeightEvidence, context: Tensor | None = None) -> Tensor:
        """Log-likelihood (n,) of what was observed of n flights, in nats, up to a constant of each flight.

        The constant is :attr:`~descentflow.representation.evidence.WeightEvidence.log_scale`, which makes it the log
        density of the weights for a flight that shows every level, and zero for one that shows nothing.

        Args:
            evidence: Of n flights.
            context: (n, c) or (1, c) where the density is conditioned on one.

        Example:
            >>> from descentflow.densities.checkpoint import load_model
            >>> from descentflow.representation.linear_curves import evidence_of
            >>> from descentflow.training.datamodule import DescentDataModule
            >>> data, density = DescentDataModule("descents.parquet", checkpoint="best.ckpt"), load_model("best.ckpt")
            >>> data.setup()
            >>> density.log_observed(evidence_of(density.representation.decoder, data.profiles("test"))).shape
            torch.Size([24])
        """
        mixture, rows = self.mixture, self.rows_of_context(context, len(evidence))
        if mixture is not None:
            return log_observed(mixture, evidence, rows)
        if evidence.known:
            return self.log_prob(evidence.points, rows)
        return self.estimate_observed(evidence, rows, self.wide_gaussian(rows)).log_prob

    def estimate_observed(
        self,
        evidence: WeightEvidence,
        context: Tensor,
        gaussian: Mixture,
        n_draws: int = SCORING_DRAWS,
        seed: int = 0,
    ) -> LikelihoodEstimate:
        """:meth:`log_observed` by importance sampling, with the effective share of the draws behind each flight.

        Args:
            evidence: Of n flights whose weights are not known.
            context: (n, c); c is 0 where the density is conditioned on none.
            gaussian: Of what proposes, a mixture of one, for instance :meth:`wide_gaussian`.
            n_draws: Draws of each flight's weights.
            seed: Of the draws: the same ones for every density, so that differences between densities vary less.
        """
        parts, order = [], []
        for index, rows in evidence.chunks():
            parts.append(estimate(self.log_prob, gaussian, rows, n_draws, context[index], seed))
            order.append(index)
        back = torch.cat(order).argsort()
        return LikelihoodEstimate(
            *(torch.cat([getattr(p, name) for p in parts])[back] for name in ("log_prob", "effective"))
        )

    @torch.no_grad()
    def wide_gaussian(self, context: Tensor) -> Mixture:
        """A Gaussian (a mixture of one) wider than the density, which proposes where there is no closed form.

        Args:
            context: Contexts (m, c) at which the density is going to be asked; c is 0 where it takes none.
        """
        rows = context[torch.arange(MOMENT_DRAWS, device=context.device) % len(context)]
        drawn = self.sample(len(rows), 0, rows).to(torch.float64)
        drawn = drawn[drawn.isfinite().all(1)]
        factor = torch.linalg.cholesky(torch.cov(drawn.T) + 1e-6 * torch.eye(self.dimension).to(drawn))
        return widened(Mixture(drawn.new_ones(1), drawn.mean(0)[None], factor[None]))

    @checked_arguments
    def n_flights(self, weights: Tensor) -> int:
        """Number of flights of these weights (n, d).

        Raises:
            ConfigError: If they have another shape.
        """
        if weights.shape[1:] != (self.dimension,):
            raise ConfigError(
                f"weights of shape {tuple(weights.shape)}",
                expected=f"(flights, {self.dimension})",
                mend="pass those of this density's representation",
            )
        return len(weights)

    @checked_arguments
    def rows_of_context(self, context: Tensor | None, n: int) -> Tensor:
        """The context (n, c) of n flights, checked; c is 0 for a density without context.

        Raises:
            ConfigError: If there should be none, should be one, or it has another shape.
        """
        what = f"{self.n_context} numbers per flight"
        if self._representation is not None and self._representation.context.columns:
            what = self._representation.context.describe()
        if context is None:
            if self.n_context:
                raise ConfigError(
                    "a conditional density without a context", expected=what, mend="pass the context of every flight"
                )
            return torch.zeros(n, 0, device=self.device)
        if context.shape[1:] != (self.n_context,) or len(context) not in (1, n):
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

    @property
    def held_out_fit(self) -> "Density":
        """The fit that has held-out flights: this one, or that before it where this one is of all flights."""
        return self._held_out[0] if self._held_out else self

    def refitted_from(self, before: "Density") -> None:
        """Keep the held-out fit that this one, of all flights, was made from."""
        self._held_out = (before,)

    def attach(self, representation: Representation) -> None:
        """Attach a copy of the representation that gives the weights their meaning.

        A copy, for it moves to another device with the density, and the DataModule's stays.
        """
        self._representation = deepcopy(representation).to(self.device)
