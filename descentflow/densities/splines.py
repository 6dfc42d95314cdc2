"""Rational-quadratic splines (Durkan et al. 2019, arXiv 1906.04032): their density side in few calls."""

import normflows as nf
import torch
from torch import Tensor
from torch.nn import functional

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
