r"""Masked affine flows with linear maps between them in a few calls: densities, and draws as one expression to export.

Of a few weights, a step costs what calling into torch costs. So what only depends on the parameters is made of all
flows at once, as stacks: matrices of the linear maps, networks with their masks multiplied in. Each network begins with
two linear layers and nothing between, which are one; without bounded inputs they take the linear map in as well.
"""

from collections.abc import Sequence
from copy import deepcopy
from dataclasses import dataclass

import torch
from torch import Tensor, nn

from descentflow.densities.layers import MAX_INPUT, MAX_LOG_SCALE, ExponentialAffine, LinearMap, TurnedRound, made
from descentflow.densities.weight_draws import WeightDraw

SIGMOID_SHIFT, LEAST_SCALE = 2.0, 1e-3
"""Of normflows' scale, ``sigmoid(s + 2) + 0.001``."""


@dataclass(frozen=True)
class _Constants:
    """Constants of all flows in training: masks of the layers, and places of numbers in the linear maps."""

    masks: tuple[Tensor, Tensor, Tensor]
    places: Tensor
    rows: Tensor
    """Outputs of a network that are used: the log scales of all weights, then their shifts."""
    shift: Tensor
    """Addition to these outputs (2 d,) before the sigmoid."""


class AffinePass:
    """Weights to the standard normal through pairs of an affine flow and a linear map, and the log-determinant.

    Parameters stay those of the flows, which are normflows' modules; what comes out is theirs to rounding.

    Example:
        >>> from descentflow.densities.flow import MaskedAffineFlowDensity
        >>> flows, weights = MaskedAffineFlowDensity(dimension=3, n_flows=2).flow, torch.randn(4, 3)
        >>> affine, maps = [turned.flow for turned in flows.flows[::2]], list(flows.flows[1::2])
        >>> torch.allclose(AffinePass(affine, maps)(weights, torch.empty(4, 0))[0], flows.inverse(weights), atol=1e-6)
        True
    """

    def __init__(self, affine: Sequence[nn.Module], maps: Sequence[LinearMap]) -> None:
        """Take flows in the order of drawing, which is the reverse of the order here.

        Args:
            affine: Masked affine flows.
            maps: The linear map after each.
        """
        self.affine, self.maps = affine[::-1], maps[::-1]
        self.bounded = isinstance(affine[0], ExponentialAffine)
        self._constants: _Constants | None = None

    def forget(self, *_: object) -> None:
        """Forget what was kept, masks and permutations: those that a checkpoint brings may be others."""
        self._constants = None
        for one in self.maps:
            one.__dict__.pop("_places", None)

    def __call__(self, z: Tensor, context: Tensor) -> tuple[Tensor, Tensor]:
        """Weights (n, d) at contexts (n, c): (n, d), and the log-determinant (n,)."""
        constants = self._kept(z.device)
        maps, shifts, log_det = self._linear(constants)
        layers = [made(one.autoregressive_net) for one in self.affine]  # type: ignore[arg-type]
        (first, second, last), (at_first, at_second, at_last) = self._layers(layers, constants)
        at_hidden = torch.baddbmm(at_second[:, :, None], second, at_first[:, :, None])[:, :, 0]
        hidden = second @ first
        given: tuple[Tensor, ...] = ()
        if context.shape[1]:
            known = MAX_INPUT * torch.tanh(context / MAX_INPUT) if self.bounded else context
            c = context.shape[1]
            given, hidden = (known @ hidden[:, :, :c].mT).unbind(), hidden[:, :, c:]
        # Of each flow in one product: the weights, and what its network takes of them.
        inner = maps / MAX_INPUT if self.bounded else hidden @ maps
        at_inner = shifts / MAX_INPUT if self.bounded else (hidden @ shifts[:, :, None])[:, :, 0] + at_hidden
        both, at_both = torch.cat([maps, inner], 1).mT.unbind(), torch.cat([shifts, at_inner], 1).unbind()
        scales, sizes = [], [z.shape[1], inner.shape[1]]
        hiddens = (MAX_INPUT * hidden).mT.unbind() if self.bounded else ()
        at_hiddens, lasts, at_lasts = at_hidden.unbind(), last.mT.unbind(), at_last.unbind()
        for one in range(len(self.affine)):
            z, taken = torch.split(torch.addmm(at_both[one], z, both[one]), sizes, 1)
            if self.bounded:
                taken = torch.addmm(at_hiddens[one], taken.tanh(), hiddens[one])
            if given:
                taken = taken + given[one]
            raw, shift = torch.addmm(at_lasts[one], taken.relu(), lasts[one]).chunk(2, 1)
            if self.bounded:
                scales.append(MAX_LOG_SCALE * (raw / MAX_LOG_SCALE).tanh())
                z = torch.addcmul(shift, scales[-1].exp(), z)
            else:
                scales.append(raw.sigmoid() + LEAST_SCALE)
                z = torch.addcmul(shift, scales[-1], z)
        logs = torch.cat(scales, 1)
        return z, (logs if self.bounded else logs.log()).sum(1) + log_det

    def _linear(self, constants: _Constants) -> tuple[Tensor, Tensor, Tensor]:
        """Matrices (F, d, d) and shifts (F, d) of the linear maps, and the sum of their log-determinants."""
        parts = [one.linear for one in self.maps]
        raw = torch.stack([one.unconstrained_upper_diag for one in parts])
        diagonal = nn.functional.softplus(raw) + parts[0].eps
        below, above = (torch.stack([getattr(one, f"{side}_entries") for one in parts]) for side in ("lower", "upper"))
        zero_one = diagonal.new_tensor([0.0, 1.0]).expand(len(parts), 2)
        numbers = torch.cat([below, above, diagonal, zero_one], 1)
        d = diagonal.shape[1]
        lower, upper = numbers.gather(1, constants.places).reshape(-1, 2, d, d).unbind(1)
        return lower @ upper, torch.stack([one.bias for one in parts]), diagonal.log().sum()

    def _layers(
        self, nets: list[nn.Module], constants: _Constants
    ) -> tuple[tuple[Tensor, Tensor, Tensor], tuple[Tensor, Tensor, Tensor]]:
        """Weights, with their masks, and biases of the three layers of each network, (F, out, in) and (F, out)."""
        layers = [[_layers(net)[place] for net in nets] for place in range(3)]
        weights = [torch.stack([one.weight for one in of_place]) for of_place in layers]
        biases = [torch.stack([one.bias for one in of_place]) for of_place in layers]
        weights[2], biases[2] = weights[2].index_select(1, constants.rows), biases[2].index_select(1, constants.rows)
        if not self.bounded:
            biases[2] = biases[2] + constants.shift
        first, second, last = (weight * mask for weight, mask in zip(weights, constants.masks, strict=True))
        return (first, second, last), (biases[0], biases[1], biases[2])

    def _kept(self, device: torch.device) -> _Constants:
        if self._constants is None or self._constants.places.device != device:
            nets = [made(one.autoregressive_net) for one in self.affine]  # type: ignore[arg-type]
            d = self.maps[0].linear.features
            skipped = len(_layers(nets[0])[2].bias) - 2 * d
            rows = skipped + torch.arange(2 * d).reshape(d, 2).T.flatten()
            masks = [torch.stack([_layers(net)[place].mask for net in nets]) for place in range(3)]  # type: ignore[misc]
            places = torch.stack([one._places.flatten() for one in self.maps])
            self._constants = _Constants(
                (masks[0].to(device), masks[1].to(device), masks[2][:, rows].to(device)),
                places.to(device),
                rows.to(device),
                torch.tensor([SIGMOID_SHIFT, 0.0]).repeat_interleave(d).to(masks[0]).to(device),
            )
        return self._constants


def _layers(net: nn.Module) -> tuple[nn.Linear, nn.Linear, nn.Linear]:
    return net.initial_layer, net.blocks[0].linear, net.final_layer  # type: ignore[return-value, index, union-attr]


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
