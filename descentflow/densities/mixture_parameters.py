"""Parameters of a Gaussian mixture whose means and proportions may follow a context, and how many there are."""

from dataclasses import dataclass

from torch import Tensor


@dataclass(frozen=True)
class Mixture:
    """``p(w | c) = sum_k pi_k(c) N(w; loc_k + slope_k c, S_k)`` with ``pi(c) = softmax(log p + gate c)``.

    A mixture of linear regressions (Jacobs et al. 1991, doi:10.1162/neco.1991.3.1.79); without a context, the Gaussian
    mixture of the paper (section 2.3).

    Args:
        probs: (k,) mixing proportions, at context zero where there is a context.
        locs: (k, d) means, at context zero.
        scale_trils: (k, d, d) lower Cholesky factors of the covariances.
        slopes: (k, d, c) change of the means with the context; None without a context.
        gate: (k, c) change of the log proportions with the context; None without a context.

    Example:
        >>> line = Mixture(torch.ones(1), torch.zeros(1, 2), torch.eye(2)[None], torch.ones(1, 2, 1), torch.zeros(1, 1))
        >>> line.at(torch.tensor([3.0])).locs
        tensor([[3., 3.]])
    """

    probs: Tensor
    locs: Tensor
    scale_trils: Tensor
    slopes: Tensor | None = None
    gate: Tensor | None = None

    @property
    def n_components(self) -> int:
        """Number of mixture components k."""
        return len(self.probs)

    def cpu(self) -> "Mixture":
        """The same parameters on the CPU, without their graph."""
        line = (None if one is None else one.detach().cpu() for one in (self.slopes, self.gate))
        return Mixture(*(one.detach().cpu() for one in (self.probs, self.locs, self.scale_trils)), *line)

    def at(self, context: Tensor) -> "Mixture":
        """The Gaussian mixture at one context (c,)."""
        if self.slopes is None or self.gate is None:
            return self
        probs = (self.probs.log() + self.gate @ context).softmax(0)
        return Mixture(probs, self.locs + self.slopes @ context, self.scale_trils)


def n_parameters(n_components: int, dimension: int, n_context: int = 0) -> int:
    """Free parameters of a mixture of full Gaussians (paper, appendix C), and the slopes of means and proportions.

    Example:
        >>> n_parameters(16, 15)
        2175
    """
    plain = n_components * dimension * (dimension + 3) // 2 + n_components - 1
    return plain + n_context * (n_components * dimension + n_components - 1)
