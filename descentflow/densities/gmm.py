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

from descentflow.densities.base import Density
from descentflow.densities.em import Mixture

# Without this two mixtures in one process share their parameters by name.
pyro.settings.set(module_local_params=True)


class MixtureProgram(PyroModule):
    """The probabilistic program: a cluster for each flight, then weights from that cluster's Gaussian.

    ``z ~ Categorical(probs)``, ``w | z ~ N(locs[z], scale_trils[z] scale_trils[z]')``
    """

    probs: Tensor
    locs: Tensor
    scale_trils: Tensor

    def __init__(self, n_clusters: int, dimension: int) -> None:
        """Equal clusters at the origin."""
        super().__init__()
        eye = torch.eye(dimension, dtype=torch.float64).expand(n_clusters, -1, -1).contiguous()
        probs = torch.full((n_clusters,), 1 / n_clusters, dtype=torch.float64)
        zeros = torch.zeros(n_clusters, dimension, dtype=torch.float64)
        self.probs = PyroParam(probs, constraints.simplex)  # type: ignore[assignment]
        self.locs = PyroParam(zeros)  # type: ignore[assignment]
        self.scale_trils = PyroParam(eye, constraints.lower_cholesky)  # type: ignore[assignment]

    @config_enumerate  # type: ignore[untyped-decorator]
    def forward(self, n: int, weights: Tensor | None = None) -> Tensor:
        """Draw n flights' weights, or condition on those given: (n, d)."""
        with pyro.plate("flights", n):
            cluster = pyro.sample("cluster", dist.Categorical(self.probs))
            flight = dist.MultivariateNormal(self.locs[cluster], scale_tril=self.scale_trils[cluster])
            drawn: Tensor = pyro.sample("weights", flight, obs=weights)
        return drawn

    def guide(self, n: int, weights: Tensor | None = None) -> None:
        """Nothing to approximate: the only latent variable is enumerated exactly."""


class GaussianMixtureDensity(Density):
    """Gaussian mixture whose log density, sampling and SVI loss come from one Pyro program."""

    def __init__(self, dimension: int, n_clusters: int = 1) -> None:
        """Equal clusters at the origin.

        Args:
            dimension: Number of weights d.
            n_clusters: Number of clusters.
        """
        super().__init__(dimension)
        self.program = MixtureProgram(n_clusters, dimension)

    def settings(self) -> dict[str, Any]:
        """Number of clusters."""
        return {"n_clusters": len(self.program.probs)}

    @property
    def mixture(self) -> Mixture:
        """The program's parameters."""
        return Mixture(self.program.probs, self.program.locs, self.program.scale_trils)

    @mixture.setter
    @torch.no_grad()
    def mixture(self, mixture: Mixture) -> None:
        # In the parameters that an optimizer holds, where shapes allow.
        if self.program.probs.shape != mixture.probs.shape:
            self.program = MixtureProgram(len(mixture.probs), mixture.locs.shape[1]).to(self.device)
        self.program.probs = mixture.probs
        self.program.locs = mixture.locs
        self.program.scale_trils = mixture.scale_trils

    def log_prob(self, weights: Tensor) -> Tensor:
        """Log density (n,) of standardised weights (n, d): the program's, summed over the enumerated cluster."""
        weights = weights.to(torch.float64)
        enumerated = poutine.enum(self.program, first_available_dim=-2)
        trace = poutine.trace(enumerated).get_trace(len(weights), weights)
        trace.compute_log_prob()
        joint = trace.nodes["cluster"]["log_prob"] + trace.nodes["weights"]["log_prob"]
        total: Tensor = joint.logsumexp(0)
        return total

    def draw(self, n: int) -> Tensor:
        """Draw (n, d)."""
        drawn: Tensor = self.program(n)
        return drawn

    def negative_elbo(self, weights: Tensor) -> Tensor:
        """Loss of stochastic variational inference for a batch (n, d), the cluster enumerated: its summed NLL."""
        elbo = TraceEnum_ELBO(max_plate_nesting=1)
        loss: Tensor = elbo.differentiable_loss(self.program, self.program.guide, len(weights), weights)
        return loss
