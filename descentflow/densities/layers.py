"""Blocks of the flows that normflows lacks: networks and inverted flows with a context, bounded scales."""

import normflows as nf
import torch
from torch import Tensor, nn

MAX_INPUT = 3.0
"""Standard deviations beyond which a weight no longer changes the maps of later ones in a whitened affine flow."""
MAX_LOG_SCALE = 1.0
"""Bound of the log scale. With 2, held-out NLL of small types is 0.07 nats worse, most of it from a few flights."""


class ContextNet(nn.Module):
    """normflows' MADE over context and weights, context first: every weight's map may depend on all of the context.

    MADE's own ``context_features`` are not used: they do not work in its feedforward blocks, and no hidden unit that
    carries them reaches the first weight's map.

    Example:
        >>> net = ContextNet(dimension=3, n_context=2, hidden=8)
        >>> net(torch.zeros(5, 3), torch.zeros(5, 2)).shape
        torch.Size([5, 6])
    """

    def __init__(self, dimension: int, n_context: int, hidden: int) -> None:
        """A network that gives scale and shift of each of ``dimension`` weights."""
        super().__init__()
        self.skipped = 2 * n_context
        self.made = nf.nets.MADE(
            dimension + n_context,
            hidden,
            num_blocks=1,
            output_multiplier=2,
            use_residual_blocks=False,
            activation=nn.functional.relu,
        )

    def forward(self, weights: Tensor, context: Tensor) -> Tensor:
        """Numbers (n, 2 d) of weights (n, d) and context (n, c)."""
        outputs: Tensor = self.made(torch.cat([context, weights], 1))
        return outputs[:, self.skipped :]


class TurnedRound(nf.flows.Reverse):  # type: ignore[misc]
    """The inverse of another flow, as normflows' ``Reverse``, with the context passed on.

    Example:
        >>> flow = turned_linear(3)
        >>> z = torch.randn(2, 3)
        >>> torch.allclose(TurnedRound(flow).forward(z)[0], flow.inverse(z)[0])
        True
    """

    def forward(self, z: Tensor, context: Tensor | None = None) -> tuple[Tensor, Tensor]:
        """The other flow's inverse."""
        turned: tuple[Tensor, Tensor] = self.flow.inverse(z, context)
        return turned

    def inverse(self, z: Tensor, context: Tensor | None = None) -> tuple[Tensor, Tensor]:
        """The other flow's forward."""
        turned: tuple[Tensor, Tensor] = self.flow.forward(z, context)
        return turned


class Flip(nf.flows.Flow):  # type: ignore[misc]
    """Weights in the opposite order.

    Example:
        >>> Flip().forward(torch.tensor([[1.0, 2.0]]))[0]
        tensor([[2., 1.]])
    """

    def forward(self, z: Tensor, context: Tensor | None = None) -> tuple[Tensor, Tensor]:
        """Flip."""
        return z.flip(1), z.new_zeros(len(z))

    def inverse(self, z: Tensor, context: Tensor | None = None) -> tuple[Tensor, Tensor]:
        """Flip back."""
        return self.forward(z)


def turned_linear(dimension: int) -> nf.flows.LULinearPermute:
    """A linear map that starts as the reversal of the order of the weights.

    normflows permutes at random. Then some seeds leave a weight before another in every flow, and training of affine
    flows does not reverse that: three in twenty ended 0.75 nats worse on a bent density.

    Example:
        >>> turned_linear(3).forward(torch.tensor([[1.0, 2.0, 3.0]]))[0].abs().round()
        tensor([[3., 2., 1.]], ...
    """
    mix = nf.flows.LULinearPermute(dimension)
    mix.permutation._permutation.copy_(torch.arange(dimension - 1, -1, -1))
    return mix


class ExponentialAffine(nf.flows.MaskedAffineAutoregressive):  # type: ignore[misc]
    """Masked affine flow whose scale is ``exp(m tanh(s / m))``: as free to grow as to shrink, and 1 for s = 0.

    normflows' sigmoid scale ends at 1.001, where its gradient vanishes.

    Example:
        >>> z = torch.randn(4, 3)
        >>> flow = ExponentialAffine(3, 6, num_blocks=1, use_residual_blocks=False)
        >>> torch.allclose(flow.inverse(flow.forward(z)[0])[0], z, atol=1e-5)
        True
    """

    def _elementwise_forward(self, inputs: Tensor, autoregressive_params: Tensor) -> tuple[Tensor, Tensor]:
        log_scale, shift = self._log_scale_and_shift(autoregressive_params)
        return log_scale.exp() * inputs + shift, log_scale.sum(1)

    def _elementwise_inverse(self, inputs: Tensor, autoregressive_params: Tensor) -> tuple[Tensor, Tensor]:
        log_scale, shift = self._log_scale_and_shift(autoregressive_params)
        return (inputs - shift) * (-log_scale).exp(), -log_scale.sum(1)

    def _log_scale_and_shift(self, autoregressive_params: Tensor) -> tuple[Tensor, Tensor]:
        raw, shift = self._unconstrained_scale_and_shift(autoregressive_params)
        return MAX_LOG_SCALE * torch.tanh(raw / MAX_LOG_SCALE), shift


class Bounded(nn.Module):
    """``m tanh(x / m)``: far from the training flights a map is what it is at their edge, and tails stay Gaussian.

    Example:
        >>> Bounded()(torch.tensor([0.01, 100.0]))
        tensor([0.0100, 3.0000])
    """

    def forward(self, x: Tensor) -> Tensor:
        """Bound."""
        return MAX_INPUT * torch.tanh(x / MAX_INPUT)


def made(net: nn.Module) -> nn.Module:
    """The network of normflows (MADE) in a flow's network, with or without context.

    Example:
        >>> net = ContextNet(2, 1, hidden=4)
        >>> made(net) is net.made
        True
    """
    return net.made if isinstance(net, ContextNet) else net
