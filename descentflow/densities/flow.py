"""Masked affine flow from normflows (paper, section 2.3 and appendix C)."""

from typing import Any

import normflows as nf
import torch
from torch import Tensor, nn

from descentflow.densities._flow_draw import FlowDraw
from descentflow.densities.gaussian import TransformedDensity
from descentflow.densities.importance import widened
from descentflow.densities.layers import Bounded, ContextNet, ExponentialAffine, Flip, TurnedRound, made, turned_linear
from descentflow.densities.mixture_parameters import Mixture, log_observed
from descentflow.densities.weight_draws import WeightDraw
from descentflow.representation.evidence import WeightEvidence


class MaskedAffineFlowDensity(TransformedDensity):
    """Masked affine flows over a standard normal: ``log p(w | c) = log N(u; 0, I) + log |det du/dw|``.

    The paper's sizes: 5 flows, each with one hidden layer of ``2 d`` units (Papamakarios et al. 2017, arXiv
    1705.07057). As shipped, normflows evaluates this density one dimension at a time and its scale never exceeds 1.001.
    ``Reverse`` makes the density one pass (and sampling sequential), and an LU-decomposed linear map between
    flows (arXiv 1906.04032) gives the scale back.

    A whitened flow starts from the Gaussian of the weights, whose parameters are not trained: for each weight its mean
    (at the context) is subtracted and its standard deviation divided out before the flows, and the correlation is
    removed after them. While the flows are the identity the density is that Gaussian.

    Example:
        >>> flow = MaskedAffineFlowDensity(dimension=4, n_flows=2, whitened=True)
        >>> weights = flow.sample(3, seed=0)  # a whitened flow is its Gaussian until it is trained
        >>> expected = flow.base_log_observed(WeightEvidence.of_weights(weights))
        >>> torch.allclose(flow.log_prob(weights).double(), expected, atol=1e-5)
        True
    """

    flow: nf.NormalizingFlow
    loc: Tensor
    slope: Tensor
    scale: Tensor
    correlation_tril: Tensor
    order: Tensor

    def __init__(
        self,
        dimension: int,
        n_flows: int = 5,
        hidden_per_weight: int = 2,
        n_context: int = 0,
        whitened: bool = False,
        linear: bool = True,
        turned_round: bool = True,
    ) -> None:
        """Flows that start close to the identity; at the identity where they are whitened.

        Args:
            dimension: Number of weights d.
            n_flows: Number of masked affine flows.
            hidden_per_weight: Hidden units of each flow, as a multiple of the number of weights and context.
            n_context: Numbers of context c.
            whitened: Start at the weights' Gaussian, with maps that can be the identity.
            linear: LU-decomposed maps between the flows; their order is reversed otherwise.
            turned_round: Whether one pass of the networks gives the density and sampling is sequential; as shipped,
                normflows has it the other way about.
        """
        super().__init__(dimension, n_context)
        self.whitened, self.n_flows, self.hidden_per_weight = whitened, n_flows, hidden_per_weight
        self.linear, self.turned_round = linear, turned_round
        hidden = hidden_per_weight * (dimension + n_context)
        flows: list[nf.flows.Flow] = []
        for _ in range(n_flows):
            kind = ExponentialAffine if whitened else nf.flows.MaskedAffineAutoregressive
            affine = kind(dimension, hidden, num_blocks=1, use_residual_blocks=False)
            if n_context:
                affine.autoregressive_net = ContextNet(dimension, n_context, hidden)
            if whitened:
                made(affine.autoregressive_net).preprocessing = Bounded()
                final: nn.Linear = made(affine.autoregressive_net).final_layer  # type: ignore[assignment]
                nn.init.zeros_(final.weight)
                nn.init.zeros_(final.bias)
            mix = turned_linear(dimension) if linear else Flip()
            flows += [TurnedRound(affine) if turned_round else affine, mix]
        base = nf.distributions.DiagGaussian(dimension, trainable=False)
        chain = nf.ConditionalNormalizingFlow if n_context else nf.NormalizingFlow
        # In one precision whatever torch's default is: draws are made in it, and another one draws other numbers.
        self.flow = chain(base, flows).to(torch.float32)
        if whitened:
            self.register_buffer("loc", torch.zeros(dimension, dtype=torch.float64))
            self.register_buffer("slope", torch.zeros(dimension, n_context, dtype=torch.float64))
            self.register_buffer("scale", torch.ones(dimension, dtype=torch.float64))
            self.register_buffer("correlation_tril", torch.eye(dimension, dtype=torch.float64))
            self.register_buffer("order", torch.arange(dimension))

    @torch.no_grad()
    def whiten(self, loc: Tensor, slope: Tensor, scale_tril: Tensor) -> None:
        """Set the Gaussian of an untrained flow: loc (d,), slope (d, c), lower Cholesky factor (d, d)."""
        self.loc.copy_(loc)
        self.slope.copy_(slope)
        self.scale.copy_(scale_tril.norm(dim=1))
        # The identity but for the order of the weights, which the linear maps change.
        eye = torch.eye(self.dimension, dtype=self.white_dtype, device=self.device)
        order = self.flow.inverse(eye, *self._extra(eye.new_zeros(self.dimension, self.n_context))).argmax(1).argsort()
        self.order.copy_(order)
        rows = (scale_tril / self.scale[:, None])[order]
        self.correlation_tril.copy_(torch.linalg.cholesky(rows @ rows.T))

    @torch.no_grad()
    def base_log_observed(self, evidence: WeightEvidence, context: Tensor | None = None) -> Tensor:
        """Log-likelihood (n,) of what was observed under an untrained flow, the Gaussian alone."""
        return log_observed(self.base_gaussian(), evidence, self.rows_of_context(context, len(evidence)))

    def base_gaussian(self) -> Mixture:
        """The Gaussian of a whitened flow, as a mixture of one."""
        place = self.order.argsort()
        correlation = (self.correlation_tril @ self.correlation_tril.T)[place][:, place]
        factor = torch.linalg.cholesky(self.scale[:, None] * correlation * self.scale)
        one = self.loc.new_ones(1)
        return Mixture(one, self.loc[None], factor[None], self.slope[None], self.loc.new_zeros(1, self.n_context))

    @torch.no_grad()
    def wide_gaussian(self, context: Tensor) -> Mixture:
        """A Gaussian wider than the density: of a whitened flow the one that it starts from, widened."""
        return widened(self.base_gaussian()) if self.whitened else super().wide_gaussian(context)

    def to_white(self, weights: Tensor, context: Tensor) -> tuple[Tensor, Tensor]:
        """Normals (n, d) of weights (n, d), and the log-determinant (n,) of that map."""
        if not self.whitened:
            return self._pass(weights.to(self.white_dtype), context)
        standardised = (weights.to(self.loc.dtype) - self._locs(context)) / self.scale
        z, log_det = self._pass(standardised.to(self.white_dtype), context)
        own = self.scale.log().sum() + self.correlation_tril.diagonal().log().sum()
        white: Tensor = torch.linalg.solve_triangular(self.correlation_tril.to(z.dtype), z.T, upper=False)
        return white.T, log_det - own.to(z.dtype)

    def _extra(self, context: Tensor) -> tuple[Tensor, ...]:
        """The context as normflows takes it: an argument where there is one."""
        return (context.to(self.white_dtype),) if self.n_context else ()

    def _pass(self, z: Tensor, context: Tensor) -> tuple[Tensor, Tensor]:
        """Through the flows, from weights to the standard normal, with the log-determinant."""
        log_det = torch.zeros(len(z), dtype=z.dtype, device=z.device)
        for flow in reversed(self.flow.flows):
            # Not normflows' own loop, which adds up log-determinants in single precision.
            z, part = flow.inverse(z, *self._extra(context))
            log_det = log_det + part
        return z, log_det

    def of_white(self, white: Tensor, context: Tensor) -> Tensor:
        """Weights (n, d) of standard normals (n, d), at context (n, c) if it takes one.

        Example:
            >>> flow = MaskedAffineFlowDensity(dimension=2, whitened=True)
            >>> flow.of_white(torch.zeros(1, 2), torch.zeros(1, 0))  # its Gaussian, until it is trained
            tensor([[0., 0.]], dtype=torch.float64...)
        """
        extra = self._extra(context)
        if not self.whitened:
            plain: Tensor = self.flow.forward(white.to(self.white_dtype), *extra)
            return plain.to(torch.float64)
        start = white.to(self.white_dtype) @ self.correlation_tril.to(self.white_dtype).T
        z: Tensor = self.flow.forward(start, *extra)
        return self._locs(context) + self.scale * z.to(torch.float64)

    @property
    def white_dtype(self) -> torch.dtype:
        """Precision of the flows' arithmetic."""
        dtype: torch.dtype = next(self.flow.parameters()).dtype
        return dtype

    def _locs(self, context: Tensor) -> Tensor:
        return self.loc + context.to(self.loc.dtype) @ self.slope.T

    def weight_draw(self, dtype: torch.dtype) -> WeightDraw:
        """The flow as one expression, with arithmetic in a precision."""
        names = ("loc", "slope", "scale", "correlation_tril") if self.whitened else ()
        return FlowDraw(self.flow.flows, self.dimension, dtype, {name: getattr(self, name) for name in names})

    def settings(self) -> dict[str, Any]:
        """Number, width and kind of the flows; those that older checkpoints do not have where they are no defaults."""
        size = {"n_flows": self.n_flows, "hidden_per_weight": self.hidden_per_weight}
        mix = {"whitened": True} if self.whitened else {}
        mix |= {} if self.linear else {"linear": False}
        mix |= {} if self.turned_round else {"turned_round": False}
        return {**size, **super().settings(), **mix}
