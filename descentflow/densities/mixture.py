"""Gaussian mixture over the weights, defined by a Pyro program (paper, section 2.3 and appendix C)."""

from typing import Any

import pyro
import pyro.distributions as dist
import torch
from pyro import poutine
from pyro.infer import TraceEnum_ELBO, config_enumerate
from pyro.nn import PyroModule, PyroParam
from torch import Tensor
from torch.distributions import constraints

from descentflow.densities.density import Density
from descentflow.densities.mixture_parameters import Mixture, log_proportions

# Without this two mixtures in one process share their parameters by name.
pyro.settings.set(module_local_params=True)


class MixtureProgram(PyroModule):
    """The probabilistic program: a mixture component for each flight, then weights from that component's Gaussian.

    ``z ~ Categorical(probs)``, ``w | z ~ N(locs[z], scale_trils[z] scale_trils[z]')``; with a context c the mean is
    ``locs[z] + slopes[z] c`` and the mixing proportions are ``softmax(log probs + gate c)``.

    Example:
        >>> MixtureProgram(n_components=3, dimension=2)(torch.zeros(5, 0).double()).shape
        torch.Size([5, 2])
    """

    probs: Tensor
    locs: Tensor
    scale_trils: Tensor
    slopes: Tensor
    gate: Tensor

    def __init__(self, n_components: int, dimension: int, n_context: int = 0) -> None:
        """Equal components at the origin."""
        super().__init__()
        self.n_context = n_context
        eye = torch.eye(dimension, dtype=torch.float64).expand(n_components, -1, -1).contiguous()
        probs = torch.full((n_components,), 1 / n_components, dtype=torch.float64)
        zeros = torch.zeros(n_components, dimension, dtype=torch.float64)
        self.probs = PyroParam(probs, constraints.simplex)  # type: ignore[assignment]
        self.locs = PyroParam(zeros)  # type: ignore[assignment]
        self.scale_trils = PyroParam(eye, constraints.lower_cholesky)  # type: ignore[assignment]
        if n_context:
            self.slopes = PyroParam(zeros[:, :, None].repeat(1, 1, n_context))  # type: ignore[assignment]
            self.gate = PyroParam(zeros[:, :1].repeat(1, n_context))  # type: ignore[assignment]
        else:
            self.register_buffer("slopes", zeros[:, :, None].repeat(1, 1, 0), persistent=False)
            self.register_buffer("gate", zeros[:, :0], persistent=False)

    @config_enumerate  # type: ignore[untyped-decorator]
    def forward(self, context: Tensor, weights: Tensor | None = None) -> Tensor:
        """Draw the weights (n, d) of flights at contexts (n, c), or condition on those observed."""
        with pyro.plate("flights", len(context)):
            component = pyro.sample("component", dist.Categorical(logits=self.probs.log() + context @ self.gate.T))
            locs = self.locs[component] + (self.slopes[component] @ context[:, :, None])[..., 0]
            flight = dist.MultivariateNormal(locs, scale_tril=self.scale_trils[component])
            drawn: Tensor = pyro.sample("weights", flight, obs=weights)
        return drawn

    @property
    def mixture(self) -> Mixture:
        """The parameters."""
        return Mixture(self.probs, self.locs, self.scale_trils, self.slopes, self.gate)

    def guide(self, *observed: object) -> None:
        """Nothing to approximate: the only latent variable is enumerated exactly."""


class GaussianMixtureDensity(Density):
    """Gaussian mixture whose log density, sampling and SVI loss come from one Pyro program.

    With a context, a mixture of regressions (:class:`~descentflow.densities.mixture_parameters.Mixture`).

    Example:
        >>> density = GaussianMixtureDensity(2, n_clusters=3)
        >>> density.mixture = Mixture(torch.ones(3) / 3, 10 * torch.eye(3)[:, :2], torch.eye(2).expand(3, 2, 2))
        >>> round(density.log_prob(torch.zeros(1, 2)).item(), 4)
        -2.9365
    """

    def __init__(
        self,
        dimension: int,
        n_clusters: int = 1,
        n_context: int = 0,
    ) -> None:
        """Equal components at the origin.

        Args:
            dimension: Number of weights d.
            n_clusters: Number of mixture components, under the name that checkpoints and configs have for it.
            n_context: Numbers of context c.
        """
        super().__init__(dimension, n_context)
        self.program = MixtureProgram(n_clusters, dimension, n_context)

    def settings(self) -> dict[str, Any]:
        """Number of mixture components; numbers of context if there are any."""
        context = {"n_context": self.n_context} if self.n_context else {}
        return {"n_clusters": len(self.program.probs), **context}

    @property
    def mixture(self) -> Mixture:
        """The program's parameters, with slopes and gate if there is a context."""
        found: Mixture = self.program.mixture
        return found

    @mixture.setter
    @torch.no_grad()
    def mixture(self, mixture: Mixture) -> None:
        # In the parameters that an optimizer holds, where shapes allow.
        if len(self.program.probs) != mixture.n_components:
            self.program = MixtureProgram(mixture.n_components, self.dimension, self.n_context).to(self.device)
        for name in ("probs", "locs", "scale_trils", "slopes", "gate"):
            setattr(self.program, name, getattr(mixture, name).double())

    def log_prob(self, weights: Tensor, context: Tensor | None = None) -> Tensor:
        """Log density (n,) of weights (n, d) at context (n, c): the program's, the component summed out."""
        rows = self.rows_of_context(context, self.n_flights(weights)).to(torch.float64)
        enumerated = poutine.enum(self.program, first_available_dim=-2)
        trace = poutine.trace(enumerated).get_trace(rows, weights.to(torch.float64))
        trace.compute_log_prob()
        joint = trace.nodes["component"]["log_prob"] + trace.nodes["weights"]["log_prob"]
        total: Tensor = joint.logsumexp(0)
        return total

    def draw(self, n: int, generator: torch.Generator, context: Tensor | None = None) -> Tensor:
        """Draw (n, d): what the program draws, without Pyro, whose state all threads share."""
        mixture, rows = self.mixture, self.rows_of_context(context, n).to(torch.float64)
        shares = log_proportions(mixture, rows).exp()
        component = torch.multinomial(shares, 1, replacement=True, generator=generator)[:, 0]
        white = torch.randn(n, self.dimension, generator=generator, dtype=torch.float64, device=self.device)
        locs = mixture.locs[component] + (mixture.slopes[component] @ rows[:, :, None])[..., 0]
        return locs + (mixture.scale_trils[component] @ white[..., None])[..., 0]

    def negative_elbo(self, weights: Tensor, context: Tensor | None = None) -> Tensor:
        """Loss of stochastic variational inference for weights (n, d), the component summed out: their NLL.

        Raises:
            torch.linalg.LinAlgError: If a component has lost its width in floating point.
        """
        if not bool((self.program.scale_trils.diagonal(dim1=1, dim2=2) > 0).all()):
            raise torch.linalg.LinAlgError("a covariance that is not positive definite")  # type: ignore[attr-defined]
        rows = self.rows_of_context(context, len(weights)).to(torch.float64)
        elbo = TraceEnum_ELBO(max_plate_nesting=1)
        loss: Tensor = elbo.differentiable_loss(self.program, self.program.guide, rows, weights)
        return loss
