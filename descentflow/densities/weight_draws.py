"""Maps from standard normals, and uniform numbers for mixtures, to weights of a density: modules for export."""

from torch import Tensor, nn

from descentflow.densities.entry_gate import EntryGate
from descentflow.densities.mixture_parameters import Mixture


class WeightDraw(nn.Module):
    """Map from standard normals, and uniform numbers where it picks, to weights; called as :class:`MixtureDraw` is.

    Example:
        >>> WeightDraw().redraw
        'noise, with the same entry_fl'
    """

    picks = False
    """True if a uniform number picks each flight's component."""
    redraw = "noise, with the same entry_fl"
    """Parts of a draw that are drawn again where it is not accepted."""


class MixtureDraw(WeightDraw):
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

    def __init__(self, mixture: Mixture, entry_gate: EntryGate | None = None) -> None:
        """Copy a mixture and its gate."""
        super().__init__()
        shares = mixture.probs[None] if entry_gate is None else entry_gate.shares
        self.n_components = mixture.n_components
        self.picks = mixture.n_components > 1
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
        }
        for name, value in kept.items():
            self.register_buffer(name, None if value is None else _constant(value))
        if self.picks:
            every = "noise and uniform, with the same entry_fl"
            self.redraw = every if self.edges is None else "noise, with the same entry_fl and uniform"

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


def _constant(value: Tensor) -> Tensor:
    kept = value.detach().cpu().clone()
    return kept.double() if kept.is_floating_point() else kept
