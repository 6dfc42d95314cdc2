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

from descentflow.core.errors import ConfigError
from descentflow.densities.density import Density
from descentflow.densities.em import Mixture
from descentflow.densities.regressions import Regressions, detached

# Without this two mixtures in one process share their parameters by name.
pyro.settings.set(module_local_params=True)


class MixtureProgram(PyroModule):
    """The probabilistic program: a cluster for each flight, then weights from that cluster's Gaussian.

    ``z ~ Categorical(probs)``, ``w | z ~ N(locs[z], scale_trils[z] scale_trils[z]')``; with a context c the mean is
    ``locs[z] + slopes[z] c`` and the probabilities are ``softmax(log probs + gate c)``.
    """

    probs: Tensor
    locs: Tensor
    scale_trils: Tensor
    slopes: Tensor
    gate: Tensor

    def __init__(self, n_clusters: int, dimension: int, n_context: int = 0) -> None:
        """Equal clusters at the origin."""
        super().__init__()
        self.n_context = n_context
        eye = torch.eye(dimension, dtype=torch.float64).expand(n_clusters, -1, -1).contiguous()
        probs = torch.full((n_clusters,), 1 / n_clusters, dtype=torch.float64)
        zeros = torch.zeros(n_clusters, dimension, dtype=torch.float64)
        self.probs = PyroParam(probs, constraints.simplex)  # type: ignore[assignment]
        self.locs = PyroParam(zeros)  # type: ignore[assignment]
        self.scale_trils = PyroParam(eye, constraints.lower_cholesky)  # type: ignore[assignment]
        if n_context:
            self.slopes = PyroParam(zeros[:, :, None].repeat(1, 1, n_context))  # type: ignore[assignment]
            self.gate = PyroParam(zeros[:, :1].repeat(1, n_context))  # type: ignore[assignment]

    @config_enumerate  # type: ignore[untyped-decorator]
    def forward(self, n: int, weights: Tensor | None = None, context: Tensor | None = None) -> Tensor:
        """Draw n flights' weights, or condition on those given: (n, d)."""
        with pyro.plate("flights", n):
            if context is None:
                cluster = pyro.sample("cluster", dist.Categorical(self.probs))
                locs = self.locs[cluster]
            else:
                cluster = pyro.sample("cluster", dist.Categorical(logits=self.probs.log() + context @ self.gate.T))
                locs = self.locs[cluster] + (self.slopes[cluster] @ context[:, :, None])[..., 0]
            flight = dist.MultivariateNormal(locs, scale_tril=self.scale_trils[cluster])
            drawn: Tensor = pyro.sample("weights", flight, obs=weights)
        return drawn

    def guide(self, n: int, weights: Tensor | None = None, context: Tensor | None = None) -> None:
        """Nothing to approximate: the only latent variable is enumerated exactly."""


class GaussianMixtureDensity(Density):
    """Gaussian mixture whose log density, sampling and SVI loss come from one Pyro program.

    With a context, a mixture of regressions (:mod:`descentflow.densities.regressions`).
    """

    def __init__(self, dimension: int, n_clusters: int = 1, n_context: int = 0) -> None:
        """Equal clusters at the origin.

        Args:
            dimension: Number of weights d.
            n_clusters: Number of clusters.
            n_context: Numbers of context c.
        """
        super().__init__(dimension, n_context)
        self.program = MixtureProgram(n_clusters, dimension, n_context)

    def settings(self) -> dict[str, Any]:
        """Number of clusters, and numbers of context if there are any."""
        context = {"n_context": self.n_context} if self.n_context else {}
        return {"n_clusters": len(self.program.probs), **context}

    @property
    def mixture(self) -> Mixture:
        """The program's parameters.

        Raises:
            ConfigError: If the density is conditional, see :meth:`mixture_given`.
        """
        if self.n_context:
            raise ConfigError(
                "a conditional density where one without context is needed",
                expected="a context",
                mend="call mixture_given(context)",
            )
        return Mixture(self.program.probs, self.program.locs, self.program.scale_trils)

    @mixture.setter
    @torch.no_grad()
    def mixture(self, mixture: Mixture) -> None:
        self._resize(len(mixture.probs))
        self.program.probs = mixture.probs
        self.program.locs = mixture.locs
        self.program.scale_trils = mixture.scale_trils

    @property
    def regressions(self) -> Regressions:
        """The program's parameters, of a density with a context."""
        program = self.program
        return Regressions(program.probs.log(), program.gate, program.locs, program.slopes, program.scale_trils)

    @regressions.setter
    @torch.no_grad()
    def regressions(self, mixture: Regressions) -> None:
        self._resize(len(mixture.logits))
        self.program.probs = mixture.logits.softmax(0)
        self.program.locs, self.program.scale_trils = mixture.locs, mixture.scale_trils
        self.program.slopes, self.program.gate = mixture.slopes, mixture.gate

    def _resize(self, n_clusters: int) -> None:
        # In the parameters that an optimizer holds, where shapes allow.
        if len(self.program.probs) != n_clusters:
            self.program = MixtureProgram(n_clusters, self.dimension, self.n_context).to(self.device)

    @torch.no_grad()
    def mixture_given(self, context: Tensor | None = None) -> Mixture:
        """The mixture given one context (1, c)."""
        rows = self.rows_of_context(context, 1)
        return self.mixture if rows is None else detached(self.regressions).given(rows[0].to(torch.float64))

    def log_prob(self, weights: Tensor, context: Tensor | None = None) -> Tensor:
        """Log density (n,) of weights (n, d) given context (n, c): the program's, the cluster enumerated and summed."""
        weights, rows = weights.to(torch.float64), _double(self.rows_of_context(context, len(weights)))
        enumerated = poutine.enum(self.program, first_available_dim=-2)
        trace = poutine.trace(enumerated).get_trace(len(weights), weights, rows)
        trace.compute_log_prob()
        joint = trace.nodes["cluster"]["log_prob"] + trace.nodes["weights"]["log_prob"]
        total: Tensor = joint.logsumexp(0)
        return total

    def draw(self, n: int, context: Tensor | None = None) -> Tensor:
        """Draw (n, d)."""
        drawn: Tensor = self.program(n, None, _double(context))
        return drawn

    def negative_elbo(self, weights: Tensor, context: Tensor | None = None) -> Tensor:
        """Loss of stochastic variational inference for a batch (n, d), the cluster enumerated: its summed NLL."""
        elbo = TraceEnum_ELBO(max_plate_nesting=1)
        loss: Tensor = elbo.differentiable_loss(
            self.program, self.program.guide, len(weights), weights, _double(context)
        )
        return loss


def _double(context: Tensor | None) -> Tensor | None:
    return None if context is None else context.to(torch.float64)
