r"""Residual of the components: its curves, and how much of each training flights have.

Components leave out what every flight does in its own way: it holds a speed or a rate, then changes it. Gaussian
numbers of the curves drift instead, and a classifier recognises them. So a sample takes the residual numbers of a
training flight with weights near its own: a nearest-neighbour bootstrap (Lall and Sharma 1996,
doi:10.1029/95WR02966), which knows sparse changes, and whatever else goes with the weights, of any density alike.

Where a flight is conditioned on levels that were flown, a Gaussian takes its place: numbers r of flights with weights w
are $r \mid w \sim N(a + B w, \operatorname{diag} s^2)$, by least squares over the same flights.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import torch
from torch import Tensor, nn

NEIGHBOURS = 5
"""Training flights of which a sample takes one's residual: with more, weights and residual go together less."""
SHORT_LEVELS = 5.0
"""Levels by which a neighbour may enter below a sample, for as much distance as a standard deviation of a weight: what
it has above its entry it does not show."""
AT_ONCE = 256
"""Samples whose distances to the training flights are in memory at once: they stay in the caches."""
RIDGE = 10.0
"""Flights that say that the residual does not depend on the weights, for the line's slopes."""
LEAST_SPREAD = 0.1
"""Of the line: residual numbers have a spread of about one."""


@dataclass(frozen=True)
class ResidualLine:
    """Normal law of R residual numbers given d weights: ``offset`` (R,), ``slope`` (R, d) and ``spread`` (R,).

    Example:
        >>> line = ResidualLine.standard(3, 2)
        >>> line.joint_means(torch.ones(1, 2).double())
        tensor([[1., 1., 0., 0., 0.]], dtype=torch.float64)
    """

    offset: Tensor
    slope: Tensor
    spread: Tensor

    @classmethod
    def standard(cls, n_residual: int, n_weights: int) -> "ResidualLine":
        """Standard normals, whatever the weights."""
        zero = torch.zeros(n_residual, dtype=torch.float64)
        return cls(zero, torch.zeros(n_residual, n_weights, dtype=torch.float64), zero + 1)

    @classmethod
    def fitted(cls, weights: Tensor, numbers: Tensor) -> "ResidualLine":
        """Least squares, with slopes shrunk.

        Args:
            weights: (m, d).
            numbers: (m, R).

        Example:
            >>> weights = torch.linspace(-1, 1, 1000).double()[:, None]
            >>> round(float(ResidualLine.fitted(weights, 2 * weights).slope), 1)
            1.9
        """
        centre, middle = weights.mean(0), numbers.mean(0)
        design = weights - centre
        inner = design.T @ design + RIDGE * torch.eye(design.shape[1]).to(design)
        slope = torch.linalg.solve(inner, design.T @ (numbers - middle)).T
        left = numbers - middle - design @ slope.T
        spread = left.square().mean(0).sqrt().clamp(min=LEAST_SPREAD)
        return cls(middle - slope @ centre, slope.contiguous(), spread)

    def joint_means(self, locs: Tensor) -> Tensor:
        """Means (..., d + R) of weights and residual numbers, where those of the weights are (..., d)."""
        return torch.cat([locs, self.offset + locs @ self.slope.T], -1)

    def joint_roots(self, scale_trils: Tensor) -> Tensor:
        """Lower triangular roots (k, d + R, d + R) of the covariances of both together."""
        own = torch.diag(self.spread).expand(len(scale_trils), -1, -1)
        upper = torch.nn.functional.pad(scale_trils, (0, len(self.spread)))
        return torch.cat([upper, torch.cat([self.slope @ scale_trils, own], 2)], 1)


class Residuals(nn.Module):
    """Residual curves of drag and of speed, and what m training flights have of them.

    Shapes: ``drag`` (r, L) N on the scale of drag, ``speed`` (s, L) m/s, ``weights`` (m, d) standardised,
    ``numbers`` (m, r + s), and ``entry`` (m,) their levels of entry as indices of the grid.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> model = load_model("best.ckpt")
        >>> residuals = model.representation.decoder.residuals
        >>> numbers = residuals.draw(model.sample(100, seed=0), torch.full((100,), 150), torch.rand(100))
        >>> numbers.shape[1] == residuals.n_numbers
        True
    """

    drag: Tensor
    speed: Tensor
    weights: Tensor
    numbers: Tensor
    entry: Tensor

    def __init__(self, drag: Tensor, speed: Tensor, weights: Tensor, numbers: Tensor, entry: Tensor) -> None:
        """Hold curves and flights."""
        super().__init__()
        held = {"drag": drag, "speed": speed, "weights": weights, "numbers": numbers, "entry": entry}
        for name, value in held.items():
            self.register_buffer(name, value.to(torch.float64), persistent=False)

    @classmethod
    def none(cls, n_levels: int, n_weights: int) -> "Residuals":
        """Of samples that follow their components."""
        drag, speed, weights, numbers = (torch.zeros(0, n) for n in (n_levels, n_levels, n_weights, 0))
        return cls(drag, speed, weights, numbers, torch.zeros(0))

    @property
    def n_numbers(self) -> int:
        """Residual numbers r + s of a flight."""
        return len(self.drag) + len(self.speed)

    def added(self, drag: Tensor, cas_mps: Tensor, numbers: Tensor) -> tuple[Tensor, Tensor]:
        """Drag on its scale and CAS (m/s), each (n, L), with the curves of residual numbers (n, r + s)."""
        of_drag, of_speed = torch.split(numbers, [len(self.drag), len(self.speed)], 1)
        return torch.addmm(drag, of_drag, self.drag.to(drag)), torch.addmm(cas_mps, of_speed, self.speed.to(drag))

    def draw(self, weights: Tensor, entry: Tensor, uniform: Tensor) -> Tensor:
        """Draw residual numbers (n, r + s): those of training flights near these.

        Args:
            weights: (n, d) standardised.
            entry: (n,) index of the level of entry.
            uniform: (n,) uniform numbers in [0, 1), which pick one of the neighbours.
        """
        if self.n_numbers == 0:
            return self.numbers.new_zeros(len(weights), 0)
        n_near = min(NEIGHBOURS, len(self.weights))
        which = (uniform.to(self.weights) * n_near).long().clamp(max=n_near - 1)
        parts = [(weights.to(self.weights), entry)]
        if not torch.compiler.is_compiling():
            parts = list(zip(*(torch.split(values, AT_ONCE) for values in parts[0]), strict=True))
        near = torch.cat([self._squares(*part).topk(n_near, dim=1, largest=False).indices for part in parts])
        return self.numbers[near.gather(1, which[:, None])[:, 0]]

    def _squares(self, weights: Tensor, entry: Tensor) -> Tensor:
        """Squared distances (n, m), up to the squares of the samples' own weights, which all neighbours share."""
        short = (entry[:, None] - self.entry).clamp_(min=0.0).div_(SHORT_LEVELS)
        squares = torch.addmm(self.weights.square().sum(1), weights, self.weights.T, alpha=-2)
        return squares.addcmul_(short, short)

    @cached_property
    def line(self) -> ResidualLine:
        """Normal law of the numbers given weights."""
        return ResidualLine.fitted(self.weights.cpu(), self.numbers.cpu())

    def to_state(self) -> dict[str, Any]:
        """Tensors from which :meth:`from_state` rebuilds it."""
        return {name: value.cpu() for name, value in self.named_buffers()}

    @classmethod
    def from_state(cls, state: dict[str, Any]) -> "Residuals":
        """Rebuild from :meth:`to_state`."""
        return cls(**state)
