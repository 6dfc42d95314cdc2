"""Maps from standard normals, and uniform numbers for mixtures, to weights of a density: modules for export."""

import torch
from torch import Tensor, nn

from descentflow.core.errors import ConfigError
from descentflow.densities.density import Density
from descentflow.densities.entry_gate import EntryGate
from descentflow.densities.entry_law import EntryLaw
from descentflow.densities.gaussian import GaussianDensity
from descentflow.densities.mixture_parameters import Mixture
from descentflow.densities.residual_law import ResidualLaw
from descentflow.densities.transformed import TransformedDensity
from descentflow.generation.samplers import GatedSampler


class MixtureDraw(nn.Module):
    """Weights of a Gaussian mixture, with or without a context and an entry gate; of one Gaussian as well.

    Example:
        >>> two = Mixture(torch.tensor([0.5, 0.5]), torch.tensor([[0.0], [90.0]]), torch.ones(2, 1, 1))
        >>> draw = MixtureDraw(two)
        >>> draw(torch.zeros(2, 1), entry=torch.tensor([0, 0]), uniform=torch.tensor([0.4, 0.6]))
        tensor([[ 0.],
                [90.]], dtype=torch.float64)
    """

    cumulative: Tensor
    locs: Tensor
    scale_trils: Tensor
    log_probs: Tensor
    slopes: Tensor | None
    gate: Tensor | None
    edges: Tensor | None
    residual_offset: Tensor | None
    residual_slope: Tensor | None
    residual_spread: Tensor | None

    def __init__(
        self, mixture: Mixture, entry_gate: EntryGate | None = None, residual_law: ResidualLaw | None = None
    ) -> None:
        """Copy a mixture, its gate and its residual law."""
        super().__init__()
        shares = mixture.probs[None] if entry_gate is None else entry_gate.shares
        if residual_law is not None:  # of one scale, of which there are more components
            shares = (shares[:, :, None] * residual_law.scale_probs.to(shares)).flatten(1)
            mixture, residual_law = residual_law.by_scale(mixture)
        self.n_components = mixture.n_components
        # Absent and not empty where there is none: empty tensors cannot be saved with a program.
        kept = {
            # Normalised: a gate's shares, like probabilities of torch's multinomial, may be any weights.
            "cumulative": (shares / shares.sum(1, keepdim=True)).cumsum(1),
            "edges": None if entry_gate is None or not len(entry_gate.edges) else entry_gate.edges,
            "locs": mixture.locs,
            "scale_trils": mixture.scale_trils,
            "log_probs": mixture.probs.log(),
            "slopes": mixture.slopes,
            "gate": mixture.gate,
            "residual_offset": None if residual_law is None else residual_law.offset,
            "residual_slope": None if residual_law is None else residual_law.slope,
            "residual_spread": None if residual_law is None else residual_law.spread,
        }
        for name, value in kept.items():
            self.register_buffer(name, None if value is None else _constant(value))

    def component(self, entry: Tensor, uniform: Tensor, context: Tensor | None = None) -> Tensor:
        """Components (n,) of flights by uniform numbers (n,): the inverse of the cumulative proportions."""
        if context is not None and self.gate is not None:
            cumulative = (self.log_probs + context.double() @ self.gate.T).softmax(1).cumsum(1)
        elif self.edges is not None:
            cumulative = self.cumulative[(entry[:, None] > self.edges).sum(1)]
        else:
            cumulative = self.cumulative
        # The last is one but for rounding, and every number is below it.
        return (uniform.double()[:, None] > cumulative[:, :-1]).sum(1)

    def forward(
        self, noise: Tensor, entry: Tensor, uniform: Tensor | None = None, context: Tensor | None = None
    ) -> Tensor:
        """Weights (n, d), float64, of standard normals (n, d) and, for several components, uniform numbers (n,)."""
        white = noise.double()
        if uniform is None:
            weights = self.locs[0] + white @ self.scale_trils[0].T
            shift = None if context is None or self.slopes is None else context.double() @ self.slopes[0].T
        else:
            chosen = self.component(entry, uniform, context)
            weights = self.locs[chosen] + (self.scale_trils[chosen] @ white[:, :, None])[:, :, 0]
            at = None if context is None or self.slopes is None else self.slopes[chosen] @ context.double()[:, :, None]
            shift = None if at is None else at[:, :, 0]
        return weights if shift is None else weights + shift

    def residual(
        self,
        weights: Tensor,
        noise: Tensor,
        entry: Tensor,
        uniform: Tensor | None = None,
        context: Tensor | None = None,
    ) -> Tensor:
        """Residual numbers (n, r), float64, of weights that the same numbers gave and standard normals (n, r)."""
        white = noise.double()
        if self.residual_offset is None or self.residual_slope is None or self.residual_spread is None:
            return white
        law = ResidualLaw.of_one_scale(self.residual_offset, self.residual_slope, self.residual_spread)
        chosen = torch.zeros_like(entry) if uniform is None else self.component(entry, uniform, context)
        return law.of(weights, white, chosen)


def _constant(value: Tensor) -> Tensor:
    kept = value.detach().cpu().clone()
    return kept.double() if kept.is_floating_point() else kept


class _NormalDraw(nn.Module):
    """Map of normals, beyond whose components lie standard normals that do not go with the weights."""

    def residual(
        self,
        weights: Tensor,
        noise: Tensor,
        entry: Tensor,
        uniform: Tensor | None = None,
        context: Tensor | None = None,
    ) -> Tensor:
        """Residual numbers (n, r) as they come."""
        return noise


class DrawByEntry(_NormalDraw):
    """Map of standard normals, with their law by bins of the entry level before it.

    Example:
        >>> from descentflow.densities.entry_law import EntryLaw
        >>> shift, root = torch.tensor([[0.0], [90.0]]).double(), torch.ones(2, 1, 1).double()
        >>> law = EntryLaw(torch.tensor([100]), torch.tensor([0.5, 0.5]).double(), shift, root)
        >>> one = Mixture(torch.ones(1), torch.zeros(1, 1), torch.ones(1, 1, 1))
        >>> DrawByEntry(MixtureDraw(one), law)(torch.zeros(2, 1), entry=torch.tensor([90, 110]))
        tensor([[ 0.],
                [90.]], dtype=torch.float64)
    """

    edges: Tensor
    shift: Tensor
    root: Tensor

    def __init__(self, draw: nn.Module, law: EntryLaw) -> None:
        """Copy the law."""
        super().__init__()
        self.draw = draw
        for name in ("edges", "shift", "root"):
            self.register_buffer(name, _constant(getattr(law, name)))

    def forward(
        self, noise: Tensor, entry: Tensor, uniform: Tensor | None = None, context: Tensor | None = None
    ) -> Tensor:
        """Weights (n, d), float64, of standard normals (n, d) and entry levels (n,), indices of the grid."""
        bins = (entry[:, None] > self.edges).sum(1)
        normals = self.shift[bins] + (self.root[bins] @ noise.double()[:, :, None])[:, :, 0]
        weights: Tensor = self.draw(normals, entry, uniform, context)
        return weights


def weight_draw(density: Density, dtype: torch.dtype) -> "MixtureDraw | DrawByEntry | _Flow":
    """The module that draws a density's weights.

    Args:
        density: A Gaussian, a mixture or a masked affine flow.
        dtype: Precision of a flow's arithmetic.

    Raises:
        ConfigError: If it is another density.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> type(weight_draw(load_model("best.ckpt"), torch.float64)).__name__  # a Gaussian in each bin of the entry
        'DrawByEntry'
    """
    if isinstance(density, TransformedDensity):
        plain = _plain_draw(density, dtype)
        return plain if density.entry_law is None else DrawByEntry(plain, density.entry_law)
    mixture = density.mixture
    if mixture is None:
        raise _no_graph(density)
    gate = density.entry_gate if isinstance(density, GatedSampler) else None
    return MixtureDraw(mixture, gate, density.residual_law)


def _plain_draw(density: TransformedDensity, dtype: torch.dtype) -> "MixtureDraw | _Flow":
    """The map of normals alone."""
    if isinstance(density, GaussianDensity):
        return MixtureDraw(density.overall)
    # Here and not above: whoever exports a Gaussian need not have imported normflows.
    from descentflow.densities.flow import MaskedAffineFlowDensity
    from descentflow.densities.flow_draw import FlowDraw

    if not isinstance(density, MaskedAffineFlowDensity):
        raise _no_graph(density)
    return _Flow(FlowDraw(density, dtype))


def _no_graph(density: Density) -> ConfigError:
    return ConfigError(
        f"a {type(density).__name__}, whose draws cannot be written as a graph",
        expected="a Gaussian, a mixture or a masked affine flow",
        mend="fit one of those, or export samples (--to parquet)",
    )


class _Flow(_NormalDraw):
    """A flow, called as a mixture is."""

    def __init__(self, draw: nn.Module) -> None:
        super().__init__()
        self.draw = draw

    def forward(
        self, noise: Tensor, entry: Tensor, uniform: Tensor | None = None, context: Tensor | None = None
    ) -> Tensor:
        weights: Tensor = self.draw(noise, context)
        return weights
