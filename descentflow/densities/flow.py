"""Autoregressive flows from normflows: masked affine (paper, section 2.3 and appendix C), and splines."""

from typing import Any

import normflows as nf
import torch
from torch import Tensor

from descentflow.densities.base import Density


class FlowDensity(Density):
    """What normalising flows share: ``log p(w) = log N(z; 0, I) + log |det dz/dw|``, z the weights sent through all."""

    flow: nf.NormalizingFlow

    def log_prob(self, weights: Tensor) -> Tensor:
        """Log density (n,) of standardised weights (n, d)."""
        log_prob: Tensor = self.flow.log_prob(weights.to(torch.float32))
        return log_prob

    def draw(self, n: int) -> Tensor:
        """Draw (n, d); a draw that is not finite is left for the sampler to count."""
        draws: Tensor = self.flow.sample(n)[0]
        return draws.to(torch.float64)


class MaskedAffineFlowDensity(FlowDensity):
    """Masked affine flows over a standard normal.

    The paper's sizes: 5 flows, each with one hidden layer of ``2 d`` units (Papamakarios et al. 2017, arXiv
    1705.07057).

    As shipped, normflows evaluates this density one dimension at a time and its scale never exceeds 1.001.
    ``Reverse`` makes the density one pass (and sampling sequential), and an LU-decomposed linear map between
    flows (arXiv 1906.04032) gives the scale back.
    """

    def __init__(self, dimension: int, n_flows: int = 5, hidden_per_weight: int = 2) -> None:
        """Flows that start at the identity's neighbourhood.

        Args:
            dimension: Number of weights d.
            n_flows: Number of masked affine flows.
            hidden_per_weight: Hidden units of each flow, as a multiple of the number of weights.
        """
        super().__init__(dimension)
        self.n_flows, self.hidden_per_weight = n_flows, hidden_per_weight
        flows: list[nf.flows.Flow] = []
        for _ in range(n_flows):
            affine = nf.flows.MaskedAffineAutoregressive(
                dimension, hidden_per_weight * dimension, num_blocks=1, use_residual_blocks=False
            )
            flows += [nf.flows.Reverse(affine), nf.flows.LULinearPermute(dimension)]
        self.flow = nf.NormalizingFlow(nf.distributions.DiagGaussian(dimension, trainable=False), flows)

    def settings(self) -> dict[str, Any]:
        """Number and width of the flows."""
        return {"n_flows": self.n_flows, "hidden_per_weight": self.hidden_per_weight}


class SplineFlowDensity(FlowDensity):
    """Autoregressive rational-quadratic splines over a standard normal (Durkan et al. 2019, arXiv 1906.04032).

    Each weight goes through a monotone spline whose knots depend on the weights before it: clusters and bounded shapes
    that affine maps bridge come out with few flows. Beyond ``TAIL`` standard deviations the map is the identity.
    """

    TAIL = 5.0

    def __init__(self, dimension: int, n_flows: int = 3, hidden: int = 32, n_bins: int = 8) -> None:
        """Flows that start at the identity.

        Args:
            dimension: Number of weights d.
            n_flows: Number of spline flows.
            hidden: Units of the one residual block behind each flow's knots.
            n_bins: Pieces of each spline.
        """
        super().__init__(dimension)
        self.n_flows, self.hidden, self.n_bins = n_flows, hidden, n_bins
        flows: list[nf.flows.Flow] = []
        for _ in range(n_flows):
            spline = nf.flows.AutoregressiveRationalQuadraticSpline(
                dimension, num_blocks=1, num_hidden_channels=hidden, num_bins=n_bins, tail_bound=self.TAIL
            )
            flows += [spline, nf.flows.LULinearPermute(dimension)]
        self.flow = nf.NormalizingFlow(nf.distributions.DiagGaussian(dimension, trainable=False), flows)

    def settings(self) -> dict[str, Any]:
        """Number and size of the flows."""
        return {"n_flows": self.n_flows, "hidden": self.hidden, "n_bins": self.n_bins}
