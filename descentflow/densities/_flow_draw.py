"""Draws of a masked affine flow as one expression to export."""

from copy import deepcopy

import torch
from torch import Tensor, nn

from descentflow.densities.layers import TurnedRound, made
from descentflow.densities.weight_draws import WeightDraw


class FlowDraw(WeightDraw):
    """Map of normals to weights of a masked affine flow, without densities.

    Linear maps become one matrix each, and networks have their masks multiplied in.

    Example:
        >>> from descentflow.densities.flow import MaskedAffineFlowDensity
        >>> flow = MaskedAffineFlowDensity(dimension=3, n_flows=2, whitened=True)
        >>> noise = torch.randn(4, 3)
        >>> flow.weight_draw(torch.float64)(noise).shape
        torch.Size([4, 3])
    """

    loc: Tensor
    slope: Tensor
    scale: Tensor
    correlation_tril: Tensor

    def __init__(self, flows: nn.ModuleList, dimension: int, dtype: torch.dtype, whitening: dict[str, Tensor]) -> None:
        """Copy a flow.

        Args:
            flows: Its steps.
            dimension: Number of weights d.
            dtype: Precision of its arithmetic; its parameters are float32.
            whitening: ``loc``, ``slope``, ``scale`` and ``correlation_tril`` of a whitened flow; empty for another.
        """
        super().__init__()
        self.dtype, self.whitened = dtype, bool(whitening)
        copied = deepcopy(flows).to("cpu", dtype).eval()
        self.steps = nn.ModuleList(_step(flow, dimension) for flow in copied)
        for name, value in whitening.items():
            self.register_buffer(name, value.detach().cpu().clone())

    def forward(
        self,
        noise: Tensor,
        uniform: Tensor | None = None,
        context: Tensor | None = None,
    ) -> Tensor:
        """Weights (n, d), float64, of standard normals (n, d) at contexts (n, c) if there are any."""
        z = noise.to(self.dtype)
        if self.whitened:
            z = z @ self.correlation_tril.to(self.dtype).T
        inner = None if context is None else context.to(self.dtype)
        for step in self.steps:
            z = step(z, inner)
        weights = z.double()
        if not self.whitened:
            return weights
        loc = self.loc if context is None else self.loc + context.double() @ self.slope.T
        return loc + self.scale * weights


class _Linear(nn.Module):
    """A linear map, found by what it makes of the axes."""

    matrix: Tensor
    shift: Tensor

    @torch.no_grad()
    def __init__(self, flow: nn.Module, dimension: int) -> None:
        super().__init__()
        # In float64, since the map may be defined by the inverse of a product.
        flow = deepcopy(flow).double()
        zero = torch.zeros(1, dimension, dtype=torch.float64)
        shift, dtype = flow.forward(zero)[0], next((p.dtype for p in flow.parameters()), torch.float64)
        axes = flow.forward(torch.eye(dimension, dtype=dtype))[0] - shift
        self.register_buffer("matrix", axes)
        self.register_buffer("shift", shift)

    def forward(self, z: Tensor, context: Tensor | None = None) -> Tensor:
        return z @ self.matrix.to(z) + self.shift.to(z)


class _Autoregressive(nn.Module):
    """A masked affine flow, or its inverse, which takes a pass of the network for each weight."""

    def __init__(self, flow: nn.Module, inverse: bool) -> None:
        super().__init__()
        self.flow, self.inverse = flow, inverse
        _multiply_masks(flow)

    def forward(self, z: Tensor, context: Tensor | None = None) -> Tensor:
        net = self.flow.autoregressive_net
        if not self.inverse:
            forward: Tensor = self.flow._elementwise_forward(z, net(z, context))[0]  # type: ignore[operator]
            return forward
        x = torch.zeros_like(z)
        for _ in range(z.shape[1]):
            x = self.flow._elementwise_inverse(z, net(x, context))[0]  # type: ignore[operator]
        return x


def _step(flow: nn.Module, dimension: int) -> nn.Module:
    inner = flow.flow if isinstance(flow, TurnedRound) else flow
    if isinstance(getattr(inner, "autoregressive_net", None), nn.Module):
        return _Autoregressive(inner, inverse=isinstance(flow, TurnedRound))
    return _Linear(flow, dimension)


def _multiply_masks(flow: nn.Module) -> None:
    """Replace linear layers that multiply their weights by a mask at each pass by plain ones."""
    net = made(flow.autoregressive_net)  # type: ignore[arg-type]
    for parent in list(net.modules()):
        for name, layer in list(parent.named_children()):
            mask = getattr(layer, "mask", None)
            if isinstance(layer, nn.Linear) and isinstance(mask, Tensor):
                plain = nn.Linear(layer.in_features, layer.out_features).to(layer.weight)
                plain.weight.data.copy_(layer.weight.data * mask)
                plain.bias.data.copy_(layer.bias.data)
                setattr(parent, name, plain)
