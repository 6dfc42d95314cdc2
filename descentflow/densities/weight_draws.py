"""Maps from standard normals, and uniform numbers for mixtures, to weights of a density: modules for export."""

from torch import Tensor, nn

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
    """Weights of a Gaussian mixture, with or without a context; of one Gaussian as well.

    Example:
        >>> two = Mixture(torch.tensor([0.5, 0.5]), torch.tensor([[0.0], [90.0]]), torch.ones(2, 1, 1))
        >>> draw = MixtureDraw(two)
        >>> draw(torch.zeros(2, 1), uniform=torch.tensor([0.4, 0.6]))
        tensor([[ 0.],
                [90.]], dtype=torch.float64)
    """

    locs: Tensor
    scale_trils: Tensor
    log_probs: Tensor
    slopes: Tensor
    gate: Tensor

    def __init__(self, mixture: Mixture) -> None:
        """Copy a mixture."""
        super().__init__()
        self.n_components = mixture.n_components
        self.picks = mixture.n_components > 1
        kept = {"locs": mixture.locs, "scale_trils": mixture.scale_trils, "log_probs": mixture.probs.log()}
        # Absent and not empty where there is none: empty tensors cannot be saved with a program.
        kept |= {"slopes": mixture.slopes, "gate": mixture.gate} if mixture.slopes.numel() else {}
        for name, value in kept.items():
            self.register_buffer(name, value.detach().cpu().double().clone())
        if self.picks:
            self.redraw = "noise and uniform, with the same entry_fl"

    def component(self, uniform: Tensor, context: Tensor | None = None) -> Tensor:
        """Components (n,) of flights by uniform numbers (n,): the inverse of the cumulative proportions."""
        logits = self.log_probs[None]
        if context is not None:
            logits = logits + context.double() @ self.gate.T
        cumulative = logits.softmax(1).cumsum(1)
        # The last is one but for rounding, and every number is below it.
        return (uniform.double()[:, None] > cumulative[:, :-1]).sum(1)

    def forward(self, noise: Tensor, uniform: Tensor | None = None, context: Tensor | None = None) -> Tensor:
        """Weights (n, d), float64, of standard normals (n, d) and, for several components, uniform numbers (n,)."""
        white = noise.double()
        if uniform is None:
            weights = self.locs[0] + white @ self.scale_trils[0].T
            return weights if context is None else weights + context.double() @ self.slopes[0].T
        chosen = self.component(uniform, context)
        weights = self.locs[chosen] + (self.scale_trils[chosen] @ white[:, :, None])[:, :, 0]
        return weights if context is None else weights + (self.slopes[chosen] @ context.double()[:, :, None])[:, :, 0]
