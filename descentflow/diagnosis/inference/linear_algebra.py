"""Normal equations of what is linear: a mean for all flights, what all show, and what real ones have."""

from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import count

import torch
from torch import Tensor

RIDGE = 1e-6
"""Added to scaled normal equations, so that columns which are nearly alike share what they explain."""


@dataclass(frozen=True)
class Common:
    """Columns (n, p, q) of all flights, precision times them, and their prior precision (q,).

    What flights that answer more to a cause show more of anyway, effect or not: a transponder's usual lag shows most
    where the rate changes most.

    Example:
        >>> Common(torch.ones(4, 2, 3), torch.ones(4, 2, 3), torch.zeros(3)).count
        3
    """

    columns: Tensor
    products: Tensor
    ridge: Tensor

    @property
    def count(self) -> int:
        """Q."""
        return self.columns.shape[2]


@dataclass(frozen=True, eq=False)
class Block:
    """Columns (r, p, k) of the real flights and precision times them, flights in the order of their folds.

    Sums over flights of a block, and of two blocks, are known by their ``key``: a fit shares most of them with others.

    Example:
        >>> first, second = (Block(torch.ones(3, 2, 1), torch.ones(3, 2, 1)) for _ in range(2))
        >>> first.key == second.key, first.count
        (False, 1)
    """

    columns: Tensor
    products: Tensor
    key: int = field(default_factory=count().__next__)

    @property
    def count(self) -> int:
        """K."""
        return self.columns.shape[2]


@dataclass(frozen=True)
class Design:
    """A linear model beside its mean: q columns of all flights, k of the r real ones, then c alike in all of these.

    Attributes:
        shared: Of all flights.
        real: (n,) bool.
        order: (r,) real flights in the order of the blocks.
        blocks: Columns of the real flights, k in all.
        alike: (p, c) columns that all real flights have.
        own_ridge: (k + c,) prior precision.
        n_parameters: How many columns are sensitivities to parameters of effects: those of the first blocks.

    Example:
        >>> shared = Common(torch.ones(4, 2, 1), torch.ones(4, 2, 1), torch.zeros(1))
        >>> block = Block(torch.ones(3, 2, 2), torch.ones(3, 2, 2))
        >>> order, alike = torch.arange(3), torch.ones(2, 1)
        >>> design = Design(shared, torch.arange(4) > 0, order, (block,), alike, torch.zeros(3), 2)
        >>> design.count, design.parameters, design.columns.shape
        (4, slice(1, 3, None), torch.Size([4, 2, 4]))
    """

    shared: Common
    real: Tensor
    order: Tensor
    blocks: tuple[Block, ...]
    alike: Tensor
    own_ridge: Tensor
    n_parameters: int

    @property
    def n_common(self) -> int:
        """Q."""
        return self.shared.count

    @property
    def n_own(self) -> int:
        """K."""
        return sum(block.count for block in self.blocks)

    @property
    def count(self) -> int:
        """Q + k + c."""
        return self.n_common + self.n_own + self.alike.shape[1]

    @property
    def parameters(self) -> slice:
        """Which columns are sensitivities to parameters."""
        return slice(self.n_common, self.n_common + self.n_parameters)

    @cached_property
    def ridge(self) -> Tensor:
        """Prior precision (q + k + c,)."""
        return torch.cat([self.shared.ridge, self.own_ridge])

    @property
    def own(self) -> Tensor:
        """Columns (r, p, k) of the real flights, in their own order."""
        found = torch.zeros(len(self.order), self.alike.shape[0], self.n_own, dtype=self.alike.dtype)
        found[self.order] = torch.cat([found[:, :, :0], *(block.columns for block in self.blocks)], 2)
        return found

    @property
    def columns(self) -> Tensor:
        """All of them (n, p, q + k + c), zero for the simulator's flights where they belong to the real ones."""
        own = self.own
        mine = torch.zeros(*self.shared.columns.shape[:2], self.count - self.n_common, dtype=own.dtype)
        mine[self.real] = torch.cat([own, self.alike.expand(len(own), -1, -1)], 2)
        return torch.cat([self.shared.columns, mine], 2)

    def without_parameters(self) -> "Design":
        """All but the sensitivities."""
        left, k = list(self.blocks), self.n_parameters
        while k > 0:
            k -= left.pop(0).count
        return replace(self, blocks=tuple(left), own_ridge=self.own_ridge[self.n_parameters :], n_parameters=0)


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
    """Solve (..., k, k), leaving alone what the data say nothing about: an absent channel, a column in the free mean.

    Args:
        matrix: (..., k, k), symmetric.
        vector: (..., k).
        raw: (..., k) diagonal before anything was taken off it.

    Example:
        >>> matrix = torch.tensor([[2.0, 0.0], [0.0, 0.0]]).double()
        >>> solve(matrix, torch.tensor([4.0, 1.0]).double(), matrix.diagonal())  # of the second nothing is known
        tensor([2.0000, 0.0000], dtype=torch.float64)
    """
    diagonal = matrix.diagonal(dim1=-2, dim2=-1)
    known = diagonal > 1e-9 + 1e-7 * raw
    size = torch.where(known, diagonal, 1.0).sqrt()
    eye = torch.eye(matrix.shape[-1], dtype=matrix.dtype)
    both = known[..., :, None] & known[..., None, :]
    scaled = torch.where(both, matrix / (size[..., :, None] * size[..., None, :]), eye) + RIDGE * eye
    answer: Tensor = torch.linalg.solve(scaled, torch.where(known, vector, 0.0) / size)
    return answer / size
