"""Sums by fold of what every fit needs, so that a fit costs small matrices and not flights.

The free mean and the common columns are in every fit: they are summed and factored once. A fit brings columns of the
real flights alone; columns that are alike in all of them (how signatures may be off) need no sum over flights at all.
"""

from dataclasses import dataclass

import torch
from torch import Tensor

from descentflow.core.recent import Recent
from descentflow.diagnosis.inference.aircraft_groups import FOLDS
from descentflow.diagnosis.inference.linear_algebra import Common, Design, solve
from descentflow.diagnosis.inference.whitening import Whitening

KEPT = 2
"""Designs whose sums are kept: they are asked for several times in a row, and take 0.2 GB each at 2,000 flights."""
NUDGE = 1e-9
"""Share of the diagonal added to what is factored once: columns that the mean contains."""


@dataclass(frozen=True)
class Sums:
    """By fold: products of columns with the common ones (F, b, k), and with one another (F, k, k).

    Example:
        >>> Sums(torch.zeros(5, 7, 2), torch.zeros(5, 2, 2)).inner.shape
        torch.Size([5, 2, 2])
    """

    cross: Tensor
    inner: Tensor


@dataclass(frozen=True)
class Profiled:
    """Sums (T, k, k) of training flights with the common columns at their best, and these (T, b, k) for each column.

    Example:
        >>> Profiled(torch.zeros(6, 3, 3), torch.zeros(6, 9, 3)).inner.shape
        torch.Size([6, 3, 3])
    """

    inner: Tensor
    common: Tensor


class FoldSums:
    """What every fit of some flights shares.

    Training sets are the flights without each fold, and then all flights: T = F + 1.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_likelihood
        >>> from descentflow.effects import EFFECTS
        >>> likelihood = example_likelihood(EFFECTS["temperature"], [10.0])
        >>> rest = likelihood.sums.rest(torch.zeros_like(likelihood.y))
        >>> left = float(likelihood.sums.profiled(rest, everyone=True).inner[0, 0, 0])  # with a mean for all flights
        >>> 0.5 < left / float((likelihood.y * likelihood.qy).sum()) < 1.0
        True
    """

    def __init__(
        self, whitening: Whitening, y: Tensor, real: Tensor, free: Tensor, common: Common, fold: Tensor
    ) -> None:
        """Sum and factor.

        Args:
            whitening: Precision of the flights.
            y: (n, p), zero where not seen.
            real: (n,) bool.
            free: (p,) bool: entries with a free mean.
            common: Columns of all flights.
            fold: (n,) of the cross-validation.
        """
        self.whitening, self.y, self.real, self.free, self.fold = whitening, y, real, free, fold
        self.common = common.columns
        self._known = Recent[tuple[Design, Sums]](KEPT)
        self.of_real = whitening.rows(real)
        parts = [self._base(fold == k, common) for k in range(FOLDS)]
        self.base = torch.stack(parts)
        self.n_base = self.base.shape[1]
        prior = torch.zeros(self.n_base, dtype=y.dtype)
        prior[int(free.sum()) :] = common.ridge
        whole = self._training(self.base) + torch.diag(prior)
        nudge = torch.diag_embed(NUDGE * whole.diagonal(dim1=1, dim2=2) + 1e-300)
        self.factor = torch.linalg.cholesky(whole + nudge) if self.n_base else whole
        # What belongs to real flights alone.
        self.members = [torch.nonzero(fold[real] == k)[:, 0] for k in range(FOLDS)]
        self.common_real = common.columns[real]
        within, shown = common.products[real], fold[real]
        self.precision = torch.stack([self.of_real.total(shown == k) for k in range(FOLDS)])
        self.common_precision = torch.stack([within[at].sum(0).T for at in self.members])
        simulated = torch.where(real[:, None], 0.0, whitening.apply(torch.where(real[:, None], 0.0, y)))
        self.of_simulated = torch.stack([self.gradient(simulated, fold == k) for k in range(FOLDS)])
        self.square_simulated = torch.stack([(simulated * y)[fold == k].sum() for k in range(FOLDS)])

    def _base(self, at: Tensor, common: Common) -> Tensor:
        mean = self.whitening.total(at)[self.free][:, self.free]
        cross = common.products[at].sum(0)[self.free]
        inner = common.columns[at].flatten(0, 1).T @ common.products[at].flatten(0, 1)
        return torch.cat([torch.cat([mean, cross], 1), torch.cat([cross.T, inner], 1)], 0)

    def gradient(self, weighted: Tensor, at: Tensor) -> Tensor:
        """Products (b,) of the common columns with weighted values (n, p), over some flights (n,)."""
        return torch.cat([weighted[at].sum(0)[self.free], self.common[at].flatten(0, 1).T @ weighted[at].flatten()])

    def _training(self, by_fold: Tensor) -> Tensor:
        """Sums over the flights of each training set, from those by fold."""
        total = by_fold.sum(0, keepdim=True)
        return torch.cat([total - by_fold, total])

    def of_columns(self, design: Design) -> Sums:
        """Sums of the columns of the real flights; those of the last few designs are known, whatever their ridge."""
        key = id(design.own), id(design.own_products), id(design.alike)
        # The design stays with its sums, so that no other tensor can have its identity.
        return self._known.get(key, lambda: (design, self._of_columns(design)))[1]

    def _of_columns(self, design: Design) -> Sums:
        own, products, alike = design.own, design.own_products, design.alike
        cross, inner = [], []
        for k, at in enumerate(self.members):
            total, mine = products[at].sum(0), own[at].flatten(0, 1)
            weighted = products[at].flatten(0, 1)
            answer = self.precision[k] @ alike
            with_common = torch.cat(
                [self.common_real[at].flatten(0, 1).T @ weighted, self.common_precision[k] @ alike], 1
            )
            cross.append(torch.cat([torch.cat([total, answer], 1)[self.free], with_common], 0))
            both = total.T @ alike
            inner.append(
                torch.cat([torch.cat([mine.T @ weighted, both], 1), torch.cat([both.T, alike.T @ answer], 1)], 0)
            )
        return Sums(torch.stack(cross), torch.stack(inner))

    def rest(self, shift: Tensor, design: Design | None = None, sums: Sums | None = None) -> Sums:
        """Sums of columns and, last, of what a shift (n, p) leaves of the flights, the simulator's own included."""
        left = self.y[self.real] - shift[self.real]
        weighted = self.of_real.apply(left)
        cross, square, own, alike = [], [], [], []
        for k, at in enumerate(self.members):
            total = weighted[at].sum(0)
            of_common = self.common_real[at].flatten(0, 1).T @ weighted[at].flatten()
            cross.append(torch.cat([total[self.free], of_common]) + self.of_simulated[k])
            square.append((left[at] * weighted[at]).sum() + self.square_simulated[k])
            if design is not None:
                own.append(design.own[at].flatten(0, 1).T @ weighted[at].flatten())
                alike.append(design.alike.T @ total)
        mine, last = torch.stack(cross)[:, :, None], torch.stack(square)[:, None, None]
        if design is None or sums is None:
            return Sums(mine, last)
        edge = torch.cat([torch.stack(own), torch.stack(alike)], 1)[:, :, None]
        inner = torch.cat([torch.cat([sums.inner, edge], 2), torch.cat([edge.transpose(1, 2), last], 2)], 1)
        return Sums(torch.cat([sums.cross, mine], 2), inner)

    def profiled(self, sums: Sums, *, everyone: bool = False) -> Profiled:
        """Training sums with the common columns at their best (of all flights alone, if so wanted)."""
        if everyone:
            cross, inner, factor = sums.cross.sum(0)[None], sums.inner.sum(0)[None], self.factor[-1:]
        else:
            cross, inner, factor = self._training(sums.cross), self._training(sums.inner), self.factor
        if not self.n_base:
            return Profiled(inner, cross)
        half = torch.linalg.solve_triangular(factor, cross, upper=False)
        common = torch.linalg.solve_triangular(factor.transpose(1, 2), half, upper=True)
        return Profiled(inner - half.transpose(1, 2) @ half, common)

    def held_out(self, sums: Sums, profiled: Profiled) -> Tensor:
        """Products (F, k, k) of columns with one another in each fold, the common columns as the other folds say."""
        common = profiled.common[:FOLDS]
        with_common = sums.cross.transpose(1, 2) @ common
        return sums.inner - with_common - with_common.transpose(1, 2) + common.transpose(1, 2) @ (self.base @ common)

    def errors(self, shift: Tensor, design: Design, steps: Tensor, common: Tensor) -> Tensor:
        """What is left (n, p) of each flight under coefficients (F, k) and common ones (F, b) of the other folds."""
        left = self.y - torch.where(self.real[:, None], shift, 0.0)
        k, f = design.own.shape[2], int(self.free.sum())
        real = torch.nonzero(self.real)[:, 0]
        for number, at in enumerate(self.members):
            step = steps[number]
            left[real[at]] -= design.own[at] @ step[:k] + design.alike @ step[k:]
        for number in range(FOLDS):
            out = self.fold == number
            left[out] -= self.common[out] @ common[number, f:]
            mean = torch.zeros(left.shape[1], dtype=left.dtype)
            mean[self.free] = common[number, :f]
            left[out] -= mean
        return left


def solved(profiled: Profiled, ridge: Tensor) -> Tensor:
    """Coefficients (T, k) of all columns but the last, which they explain.

    Example:
        >>> inner = torch.tensor([[[4.0, 2.0], [2.0, 9.0]]]).double()
        >>> solved(Profiled(inner, inner), torch.zeros(1).double()).round(decimals=3)
        tensor([[0.5000]], dtype=torch.float64)
    """
    inner = profiled.inner
    raw = inner.diagonal(dim1=1, dim2=2)[:, :-1]
    return solve(inner[:, :-1, :-1] + torch.diag(ridge), inner[:, :-1, -1], raw)
