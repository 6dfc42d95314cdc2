"""Normal equations of what is linear: a mean for all flights, what all show, and what real ones have."""

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

RIDGE = 1e-6
"""Added to scaled normal equations, so that columns which are nearly alike share what they explain."""


@dataclass(frozen=True)
class Design:
    """Columns (n, p, q + k) of a linear model beside its mean, precision times them, and prior precision (q + k,).

    The first q belong to all flights: what flights that answer more to a cause show more of anyway, effect or not (a
    transponder's usual lag shows most where the rate changes most). The k after them belong to real flights alone.

    Example:
        >>> columns = torch.ones(4, 2, 3)
        >>> Design(columns, columns, n_common=1, ridge=torch.zeros(3)).common().columns.shape
        torch.Size([4, 2, 1])
    """

    columns: Tensor
    products: Tensor
    n_common: int
    ridge: Tensor

    def common(self) -> "Design":
        """The first q alone."""
        q = self.n_common
        return Design(self.columns[:, :, :q], self.products[:, :, :q], q, self.ridge[:q])


@dataclass(frozen=True)
class Moments:
    """Sums over some flights: precision (f, f) of the free mean, its product with the columns (f, q + k), and so on.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_likelihood
        >>> from descentflow.effects import EFFECTS
        >>> likelihood = example_likelihood(EFFECTS["temperature"], [10.0])
        >>> moments = likelihood.moments(likelihood.qy, likelihood.design({"temperature": torch.zeros(1).double()}))
        >>> round(float(moments.solved()[1][-1]))  # K
        10
    """

    mean: Tensor
    cross: Tensor
    curvature: Tensor
    mean_gradient: Tensor
    gradient: Tensor
    ridge: Tensor

    def solved(self) -> tuple[Tensor, Tensor]:
        """Mean (f,) and coefficients (q + k,) that maximise the penalised likelihood."""
        information, gradient = self.profiled()
        step = solve(information + torch.diag(self.ridge), gradient, self.curvature.diagonal())
        if not len(self.mean):
            return self.mean_gradient, step
        return torch.linalg.solve(self.mean, self.mean_gradient - self.cross @ step), step

    def profiled(self) -> tuple[Tensor, Tensor]:
        """Information and gradient of the coefficients with the mean at its best."""
        if not len(self.mean):
            return self.curvature, self.gradient
        stacked = torch.linalg.solve(self.mean, torch.cat([self.mean_gradient[:, None], self.cross], 1))
        return self.curvature - self.cross.T @ stacked[:, 1:], self.gradient - self.cross.T @ stacked[:, 0]


def solve(matrix: Tensor, vector: Tensor, raw: Tensor) -> Tensor:
    """Solve, leaving alone what the data say nothing about: an absent channel, or a column that the mean contains.

    Example:
        >>> matrix = torch.tensor([[2.0, 0.0], [0.0, 0.0]]).double()
        >>> solve(matrix, torch.tensor([4.0, 1.0]).double(), matrix.diagonal())  # of the second nothing is known
        tensor([2.0000, 0.0000], dtype=torch.float64)
    """
    known = matrix.diagonal() > 1e-9 + 1e-7 * raw
    step = torch.zeros_like(vector)
    if bool(known.any()):
        part = matrix[known][:, known]
        size = part.diagonal().sqrt()
        scaled = part / (size[:, None] * size) + RIDGE * torch.eye(len(part), dtype=part.dtype)
        step[known] = torch.linalg.solve(scaled, vector[known] / size) / size
    return step


def sum_of(parts: Sequence[Moments]) -> Moments:
    """Moments of all flights from those of parts of them.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_likelihood
        >>> from descentflow.effects import EFFECTS
        >>> likelihood = example_likelihood(EFFECTS["temperature"], [10.0])
        >>> halves = [likelihood.moments(likelihood.qy, likelihood.common, torch.arange(160) % 2 == k) for k in (0, 1)]
        >>> whole = likelihood.moments(likelihood.qy, likelihood.common)
        >>> torch.allclose(sum_of(halves).curvature, whole.curvature)
        True
    """
    first, *rest = parts
    names = ("mean", "cross", "curvature", "mean_gradient", "gradient")
    totals = {name: sum((getattr(p, name) for p in rest), getattr(first, name)) for name in names}
    return Moments(**totals, ridge=first.ridge)
