"""Blocks of the flows that normflows lacks: networks and inverted flows with a context, bounded scales, fast splines.

The splines are rational-quadratic (Durkan et al. 2019, arXiv 1906.04032).
"""

from collections.abc import Callable
from functools import cached_property

import normflows as nf
import torch
from torch import Tensor, nn
from torch.nn import functional

MAX_INPUT = 3.0
"""Standard deviations beyond which a weight no longer changes the maps of later ones in a whitened affine flow."""
MAX_LOG_SCALE = 1.0
"""Bound of the log scale. With 2, held-out NLL of small types is 0.07 nats worse, most of it from a few flights."""


class ContextNet(nn.Module):
    """normflows' MADE over context and weights, context first: every weight's map may depend on all of the context.

    MADE's own ``context_features`` are not used: they do not work in its feedforward blocks, and no hidden unit that
    carries them reaches the first weight's map.

    Example:
        >>> net = ContextNet(dimension=3, n_context=2, hidden=8, n_outputs=2, residual=False)
        >>> net(torch.zeros(5, 3), torch.zeros(5, 2)).shape
        torch.Size([5, 6])
    """

    def __init__(self, dimension: int, n_context: int, hidden: int, n_outputs: int, *, residual: bool) -> None:
        """A network that gives ``n_outputs`` numbers for each of ``dimension`` weights."""
        super().__init__()
        self.skipped = n_context * n_outputs
        self.made = nf.nets.MADE(
            dimension + n_context,
            hidden,
            num_blocks=1,
            output_multiplier=n_outputs,
            use_residual_blocks=residual,
            activation=nn.functional.relu,
        )

    def forward(self, weights: Tensor, context: Tensor) -> Tensor:
        """Numbers (n, d n_outputs) of weights (n, d) and context (n, c)."""
        outputs: Tensor = self.made(torch.cat([context, weights], 1))
        # The spline divides them in place.
        return outputs[:, self.skipped :].contiguous()


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


class LinearMap(nf.flows.LULinearPermute):  # type: ignore[misc]
    """normflows' LU-decomposed linear map after a permutation, whose density side is one matrix product.

    Of a few weights, making the two triangles and their gradients costs more than using them: here one look-up makes
    both, and their product takes the permutation in. Parameters and draws are normflows'.

    Example:
        >>> z, flow = torch.randn(4, 3), LinearMap(3)
        >>> theirs, log_det = nf.flows.LULinearPermute.inverse(flow, z)
        >>> torch.allclose(flow.inverse(z)[0], theirs), torch.allclose(flow.inverse(z)[1].expand(4), log_det)
        (True, True)
    """

    def inverse(self, z: Tensor, context: Tensor | None = None) -> tuple[Tensor, Tensor]:
        """Weights (n, d) to (n, d), and the log-determinant (1,), which is the same for all."""
        linear = self.linear
        diagonal: Tensor = linear.upper_diag
        numbers = torch.cat([linear.lower_entries, linear.upper_entries, diagonal, diagonal.new_tensor([0.0, 1.0])])
        lower, upper = numbers[self._places.to(z.device)].unbind()
        mapped = nn.functional.linear(z, lower @ upper, linear.bias)
        return mapped, diagonal.log().sum()[None]

    @cached_property
    def _places(self) -> Tensor:
        """Indices of the numbers (2, d, d) in the lower triangle, and in the upper one with permuted columns."""
        d, linear = self.linear.features, self.linear
        below = len(linear.lower_entries)
        nothing, one = 2 * below + d, 2 * below + d + 1
        lower, upper = torch.full((2, d, d), nothing).unbind()
        lower[linear.lower_indices] = torch.arange(below)
        lower[linear.diag_indices] = one
        upper[linear.upper_indices] = below + torch.arange(below)
        upper[linear.diag_indices] = 2 * below + torch.arange(d)
        return torch.stack([lower, upper[:, self.permutation._inverse_permutation.cpu()]])


def turned_linear(dimension: int) -> LinearMap:
    """A linear map that starts as the reversal of the order of the weights.

    normflows permutes at random. Then some seeds leave a weight before another in every flow, and training of affine
    flows does not reverse that: three in twenty ended 0.75 nats worse on a bent density.

    Example:
        >>> turned_linear(3).forward(torch.tensor([[1.0, 2.0, 3.0]]))[0].abs().round()
        tensor([[3., 2., 1.]], ...
    """
    mix = LinearMap(dimension)
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
        >>> net = ContextNet(2, 1, hidden=4, n_outputs=2, residual=False)
        >>> made(net) is net.made
        True
    """
    return net.made if isinstance(net, ContextNet) else net


ROWS = 4096
"""Rows at once on a CPU: splines of 15 weights take 1.3 s for 131,072 rows in place of 3.5, masked affine flows the
same as all at once."""

Map = Callable[[Tensor, Tensor], tuple[Tensor, Tensor]]


def in_parts(compute: Map, rows: Tensor, context: Tensor) -> tuple[Tensor, Tensor]:
    """Apply ``compute`` to rows part by part; each row is computed by itself.

    On an accelerator, and where gradients keep everything that lies between, at once.

    Args:
        compute: Rows (n, d), and context (n, c) or None -> two tensors of n rows.
        rows: (n, d).
        context: (n, c), if there is one.

    Example:
        >>> with torch.no_grad():
        ...     twice, total = in_parts(lambda x, _: (2 * x, x.sum(1)), torch.ones(10_000, 2), torch.zeros(10_000, 0))
        >>> twice.shape, total.shape
        (torch.Size([10000, 2]), torch.Size([10000]))
    """
    if torch.is_grad_enabled() or rows.device.type != "cpu" or len(rows) <= ROWS:
        return compute(rows, context)
    first, second = zip(*map(compute, torch.split(rows, ROWS), torch.split(context, ROWS)), strict=True)
    return torch.cat(first), torch.cat(second)


LEAST_SIZE = 1e-3
"""Share of the interval that each piece spans at least, and the least slope at a knot: as in normflows."""


class Spline(nf.flows.AutoregressiveRationalQuadraticSpline):  # type: ignore[misc]
    """normflows' autoregressive spline, whose density side takes all weights alike, inside the interval or beyond.

    normflows picks the weights inside the interval, and looks up widths, heights and slopes one by one. Parameters and
    draws are normflows'.

    Example:
        >>> z, flow = 3 * torch.randn(50, 2), Spline(2, num_blocks=1, num_hidden_channels=8, tail_bound=5.0)
        >>> theirs, log_det = nf.flows.AutoregressiveRationalQuadraticSpline.inverse(flow, z)
        >>> found = flow.inverse(z)
        >>> torch.allclose(found[0], theirs, atol=1e-5), torch.allclose(found[1], log_det, atol=1e-5)
        (True, True)
    """

    def inverse(self, z: Tensor, context: Tensor | None = None) -> tuple[Tensor, Tensor]:
        """Weights (n, d) at contexts (n, c) to (n, d), and the log-determinant (n,)."""
        own = self.mprqat
        raw = own.autoregressive_net(z, context).reshape(*z.shape, -1)
        moved, log_slope = rational_quadratic(z, raw, own.tail_bound)
        return moved, log_slope.sum(1)


def rational_quadratic(x: Tensor, raw: Tensor, bound: float) -> tuple[Tensor, Tensor]:
    """Monotone splines from the interval to itself, the identity beyond it.

    Args:
        x: (n, d) where they are asked for.
        raw: (n, d, 3 k - 1) unconstrained widths and heights of k pieces, and slopes between them.
        bound: Half the interval.

    Returns:
        Values (n, d) and the logarithm of the slopes (n, d).

    Example:
        >>> straight = torch.zeros(1, 1, 5)
        >>> straight[..., 4] = 0.54  # softplus gives a slope of one
        >>> moved, log_slope = rational_quadratic(torch.tensor([[0.7]]), straight, bound=2.0)
        >>> moved.round(decimals=2), log_slope.abs().round(decimals=2)
        (tensor([[0.7000]]), tensor([[0.]]))
    """
    k = (raw.shape[2] + 1) // 3
    # Pieces first: a softmax over the last eight numbers takes ten times as long as one over the first.
    raw = raw.permute(2, 0, 1).contiguous()
    sizes, slopes = raw[: 2 * k].reshape(2, k, *x.shape), raw[2 * k :]
    shares = LEAST_SIZE + (1 - LEAST_SIZE * k) * sizes.softmax(1)
    ends = 2 * bound * shares[:, :-1].cumsum(1) - bound
    edge, one = torch.full_like(ends[:, :1], bound), torch.ones_like(slopes[:1])
    knots = torch.cat([-edge, ends, edge], 1)
    slopes = torch.cat([one, LEAST_SIZE + functional.softplus(slopes), one])
    inner = x.clamp(-bound, bound)
    piece = (inner >= ends[0]).sum(0, keepdim=True)
    both = torch.cat([piece, piece + 1])
    (left, right), (low, high) = (pair.unbind() for pair in knots.gather(1, both.expand(2, -1, -1, -1)).unbind())
    at_left, at_right = slopes.gather(0, both).unbind()
    width, height = right - left, high - low
    steep = height / width
    along = (inner - left) / width
    rest = 1 - along
    mixed = along * rest
    below = steep + (at_left + at_right - 2 * steep) * mixed
    moved = low + height * (steep * along.square() + at_left * mixed) / below
    slope = steep.square() * (at_right * along.square() + 2 * steep * mixed + at_left * rest.square())
    inside = inner == x
    log_slope = slope.log() - 2 * below.log()
    return torch.where(inside, moved, x), torch.where(inside, log_slope, 0.0)
